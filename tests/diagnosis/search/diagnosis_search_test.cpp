// The search on a problem small enough to know everything about: linear regression, y = X theta +
// sum of effects + noise, where score tests, refits and their distributions are exact.
#include "diagnosis/search/diagnosis_search.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

#include "diagnosis/evidence/fit_comparison.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kSamples = 240;

// Columns of a regression: harmonics of one axis for the model, and hypotheses at two places.
class RegressionProblem : public MismatchProblem {
 public:
  RegressionProblem() : model_(kSamples, 3) {
    for (Eigen::Index i = 0; i < kSamples; ++i) {
      const double x = axis(i);
      model_.row(i) << 1.0, x, x * x;
    }
    for (int harmonic = 3; harmonic < 9; ++harmonic) {
      add("first", "harmonic_" + std::to_string(harmonic),
          [harmonic](double x) { return std::sin(harmonic * x) + 0.3 * std::cos(harmonic * x); });
    }
    add("second", "step", [](double x) { return x > 0.4 ? 1.0 : 0.0; });
    add("second", "slanted_step", [](double x) { return x > 0.4 ? 1.0 + 0.02 * x : 0.0; });
    add("second", "parabola", [](double x) { return x * x; });  // the model has it already
    hypotheses_.back().special_cases = {};
  }

  void measure(const Eigen::VectorXd& effect, Random& random) {
    const Eigen::Vector3d truth(1.0, -0.5, 0.3);
    estimation_ = model_ * truth + effect;
    if (free_motion_) estimation_ += *free_motion_;
    held_out_ = model_ * truth + held_out_motion_ * effect;
    for (double& value : estimation_) value += random.normal();
    for (double& value : held_out_) value += random.normal();
  }
  [[nodiscard]] Eigen::VectorXd column(std::size_t hypothesis) const {
    return columns_[hypothesis];
  }
  [[nodiscard]] std::size_t index_of(const std::string& law) const {
    for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
      if (hypotheses_[i].law == law) return i;
    }
    throw InputError("no such law");
  }
  [[nodiscard]] static double axis(Eigen::Index i) {
    return -3.0 + 6.0 * static_cast<double>(i) / static_cast<double>(kSamples - 1);
  }
  void remove(const std::string& law) {
    const auto at = static_cast<std::ptrdiff_t>(index_of(law));
    hypotheses_.erase(hypotheses_.begin() + at);
    columns_.erase(columns_.begin() + at);
  }
  void only_name(const std::string& twin, const std::string& law) {
    hypotheses_[index_of(law)].twins = {index_of(twin)};
    hypotheses_[index_of(twin)].only_named = true;
    hypotheses_[index_of(twin)].place = hypotheses_[index_of(law)].place;
  }
  // The same law at another place, and how far the best experiment would tell the two apart.
  void repeat_elsewhere(const std::string& law, double distance) {
    const Eigen::VectorXd column = columns_[index_of(law)];
    add("third", law, [](double) { return 0.0; });
    columns_.back() = column;
    distance_ = distance;
  }
  // With one parameter more, with which the data say so much more of them all; less where the new
  // one makes up for the amplitude.
  void generalise(const std::string& law, const std::string& special_case, double information) {
    hypotheses_[index_of(law)].special_cases = {special_case};
    further_information_[index_of(law)] = information;
  }

  void rank_last(const std::string& law) {
    for (Hypothesis& hypothesis : hypotheses_) hypothesis.rank = hypothesis.law == law ? 1 : 0;
  }
  void describe(const std::string& law, Characteristic characteristic) {
    hypotheses_[index_of(law)].characteristic = characteristic;
  }
  void describe_all(const std::string& place, Characteristic characteristic) {
    for (Hypothesis& hypothesis : hypotheses_) {
      if (hypothesis.place == place) hypothesis.characteristic = characteristic;
    }
  }

  // Fits with this law alone do not settle.
  void never_settle_with(const std::string& law) {
    unsettled_ = std::vector<std::size_t>{index_of(law)};
  }
  // Each fit of the model alone from one with a law ends somewhat lower than the last one did.
  void never_quite_ends_without_laws() { never_quite_ends_ = true; }
  [[nodiscard]] int fits_without_laws() const { return fits_without_laws_; }
  // Held-out recordings that do not excite what is missing.
  void keep_out_unexcited(Random& random) {
    held_out_ = model_ * Eigen::Vector3d(1.0, -0.5, 0.3);
    for (double& value : held_out_) value += random.normal();
  }

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override { return hypotheses_; }
  [[nodiscard]] double sample_count() const override { return static_cast<double>(kSamples); }
  [[nodiscard]] bool noise_is_known() const override { return true; }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> laws,
                                const ExtendedFit* nearby) const override {
    if (laws.size() == 1) fitted_alone_.insert(laws[0].hypothesis);
    return fit_every(1, laws, nearby);
  }

  // Every third sample, where asked for.
  [[nodiscard]] bool has_few() const override { return has_few_; }
  [[nodiscard]] std::optional<ExtendedFit> fit_to_few(std::span<const LawStart> laws,
                                                      const ExtendedFit& nearby) const override {
    if (!has_few_) return {};
    return fit_every(3, laws, &nearby);
  }
  void race_on_few() { has_few_ = true; }
  [[nodiscard]] const std::set<std::size_t>& fitted_alone() const { return fitted_alone_; }

  [[nodiscard]] ExtendedFit fit_every(Eigen::Index stride, std::span<const LawStart> laws,
                                      const ExtendedFit* nearby) const {
    std::vector<std::size_t> chosen;
    for (const LawStart& law : laws) chosen.push_back(law.hypothesis);
    const auto rows = Eigen::seq(0, kSamples - 1, stride);
    const Eigen::MatrixXd columns = design(chosen)(rows, Eigen::all);
    const Eigen::VectorXd measured = estimation_(rows);
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor(columns);
    const Eigen::VectorXd solution = factor.solve(measured);
    const Eigen::MatrixXd covariance =
        (columns.transpose() * columns).completeOrthogonalDecomposition().pseudoInverse();
    ExtendedFit result;
    result.usable = !unsettled_ || chosen != *unsettled_;
    std::size_t further_parameters = 0;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k) + model_.cols();
      result.laws.push_back(
          {chosen[k], {{"amplitude", "1", solution(at), std::sqrt(covariance(at, at))}}});
      result.laws_information += std::log1p(solution(at) * solution(at) / covariance(at, at));
      const auto further = further_information_.find(chosen[k]);
      if (further == further_information_.end()) continue;
      result.laws_information += further->second;
      ++further_parameters;
    }
    for (Eigen::Index at = 0; at < model_.cols(); ++at) {
      result.model_parameters.push_back(
          {"theta", "1", solution(at), std::sqrt(covariance(at, at))});
    }
    result.estimation =
        assess(measured - columns * solution, static_cast<double>(measured.size() - factor.rank()));
    if (laws.empty() && nearby != nullptr) ++fits_without_laws_;
    if (laws.empty() && never_quite_ends_) result.estimation.chi_square -= 2.0 * fits_without_laws_;
    result.deviance = result.estimation.chi_square;
    result.parameter_count = static_cast<std::size_t>(factor.rank()) + further_parameters;
    return result;
  }

  [[nodiscard]] ScoreTable scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                  int null_draws, std::uint64_t seed) const override {
    std::vector<std::size_t> present;
    for (const FittedLaw& law : fit.laws) present.push_back(law.hypothesis);
    const Eigen::MatrixXd columns = design(present);
    Eigen::MatrixXd right(kSamples, 1 + null_draws);
    right.col(0) = estimation_ - predict(fit, columns);
    Random random(seed);
    for (Eigen::Index k = kSamples; k < right.size(); ++k) right.data()[k] = random.normal();
    const ScoreTest test({columns.transpose() * columns, columns.transpose() * right});
    ScoreTable table;
    table.null_minima.assign(static_cast<std::size_t>(null_draws), 1.0);
    for (const std::size_t hypothesis : asked) {
      const Eigen::VectorXd& own = columns_[hypothesis];
      const CandidateProducts products{Eigen::MatrixXd::Constant(1, 1, own.squaredNorm()),
                                       own.transpose() * columns, own.transpose() * right};
      HypothesisScore& score = table.scores.emplace_back();
      score.score = test.score(products);
      score.start = {hypothesis, {score.score.amplitudes(0)}};
      score.amplitude = score.score.amplitudes(0);
      score.amplitude_deviation = std::sqrt(score.score.amplitude_covariance(0, 0));
      if (only_positive_ && score.amplitude < 0.0) {
        score.score = {};
        score.start.parameters.clear();
      }
      test.lower_minimum_p_values(
          products,
          [&](const Eigen::VectorXd& amplitude) { return !only_positive_ || amplitude(0) >= 0.0; },
          table.null_minima);
    }
    return table;
  }

  [[nodiscard]] std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& /*a*/, const ExtendedFit& /*b*/) const override {
    if (!distance_) return {};
    RivalExperiments experiments{{}, InformationSet(1, AlignedArray(1))};
    experiments.distance_at_best = *distance_;
    return experiments;
  }

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& /*fit*/) const override {
    return {};
  }

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    std::vector<std::size_t> present;
    for (const FittedLaw& law : fit.laws) present.push_back(law.hypothesis);
    return assess(held_out_ - predict(fit, held_out_design(present)),
                  static_cast<double>(kSamples));
  }
  // r^T (1 + J C J^T)^-1 r, C the covariance of what was fitted.
  [[nodiscard]] std::optional<HeldOutPrediction> predict_held_out(
      const ExtendedFit& fit) const override {
    std::vector<std::size_t> present;
    for (const FittedLaw& law : fit.laws) present.push_back(law.hypothesis);
    const Eigen::MatrixXd columns = design(present), seen = held_out_design(present);
    const Eigen::MatrixXd covariance =
        (columns.transpose() * columns).completeOrthogonalDecomposition().pseudoInverse();
    const Eigen::VectorXd error = held_out_ - predict(fit, seen);
    const Eigen::MatrixXd all =
        Eigen::MatrixXd::Identity(kSamples, kSamples) + seen * covariance * seen.transpose();
    Assessment result = assess(error, static_cast<double>(kSamples));
    result.chi_square = error.dot(all.llt().solve(error));
    return HeldOutPrediction{result, result.chi_square + std::log(all.determinant())};
  }
  void allow_only_positive() { only_positive_ = true; }
  // A law that does so many times as much on recordings kept out.
  void do_elsewhere(const std::string& law, double times) { elsewhere_[index_of(law)] = times; }
  // What a fit with laws can take out of the recordings.
  void hold_free_motion(const Eigen::VectorXd& motion) { free_motion_ = motion; }
  // What taking it out does besides.
  void spoil_when_renewed(const Eigen::VectorXd& error) { spoiled_ = error; }
  [[nodiscard]] std::unique_ptr<MismatchProblem> renewed(const ExtendedFit& fit) const override {
    if (!free_motion_ || fit.laws.empty()) return nullptr;
    auto problem = std::make_unique<RegressionProblem>(*this);
    problem->estimation_ -= *free_motion_;
    if (spoiled_) problem->estimation_ += *spoiled_;
    problem->free_motion_.reset();
    return problem;
  }
  void change_with_time(double p_value) { changes_ = p_value; }
  [[nodiscard]] std::optional<TimeVariation> time_variation(const ExtendedFit& /*fit*/,
                                                            double /*gain*/) const override {
    if (!changes_) return {};
    TimeVariation change;
    change.place = "first";
    change.p_value = *changes_;
    return change;
  }
  // Recordings kept out in which every law moves so many times as much as in those of the fit.
  void keep_out_larger_motion(double times) { held_out_motion_ = times; }

 private:
  template <typename Function>
  void add(const std::string& place, const std::string& law, Function function) {
    Eigen::VectorXd column(kSamples);
    for (Eigen::Index i = 0; i < kSamples; ++i) column(i) = function(axis(i));
    columns_.push_back(column);
    hypotheses_.push_back({place, "{kind: element, mass: " + place + "}", law, {}});
  }
  [[nodiscard]] Eigen::MatrixXd design(const std::vector<std::size_t>& hypotheses) const {
    Eigen::MatrixXd columns(kSamples, model_.cols() + static_cast<Eigen::Index>(hypotheses.size()));
    columns.leftCols(model_.cols()) = model_;
    for (std::size_t k = 0; k < hypotheses.size(); ++k) {
      columns.col(model_.cols() + static_cast<Eigen::Index>(k)) = columns_[hypotheses[k]];
    }
    return columns;
  }
  [[nodiscard]] Eigen::MatrixXd held_out_design(const std::vector<std::size_t>& hypotheses) const {
    Eigen::MatrixXd columns = design(hypotheses);
    columns.rightCols(columns.cols() - model_.cols()) *= held_out_motion_;
    for (std::size_t k = 0; k < hypotheses.size(); ++k) {
      const auto other = elsewhere_.find(hypotheses[k]);
      if (other == elsewhere_.end()) continue;
      columns.col(model_.cols() + static_cast<Eigen::Index>(k)) *= other->second;
    }
    return columns;
  }
  [[nodiscard]] Eigen::VectorXd predict(const ExtendedFit& fit,
                                        const Eigen::MatrixXd& columns) const {
    Eigen::VectorXd parameters(columns.cols());
    for (Eigen::Index i = 0; i < model_.cols(); ++i) {
      parameters(i) = fit.model_parameters[static_cast<std::size_t>(i)].value;
    }
    for (std::size_t k = 0; k < fit.laws.size(); ++k) {
      parameters(model_.cols() + static_cast<Eigen::Index>(k)) = fit.laws[k].parameters[0].value;
    }
    return columns * parameters;
  }
  [[nodiscard]] static Assessment assess(const Eigen::VectorXd& error, double degrees_of_freedom) {
    Assessment result;
    result.chi_square = error.squaredNorm();
    result.degrees_of_freedom = degrees_of_freedom;
    return result;
  }

  Eigen::MatrixXd model_;
  std::vector<Hypothesis> hypotheses_;
  std::map<std::size_t, double> further_information_;
  std::optional<double> distance_;
  bool only_positive_ = false;
  bool never_quite_ends_ = false;
  mutable int fits_without_laws_ = 0;
  bool has_few_ = false;
  double held_out_motion_ = 1.0;
  std::map<std::size_t, double> elsewhere_;
  std::optional<Eigen::VectorXd> free_motion_, spoiled_;
  std::optional<double> changes_;
  mutable std::set<std::size_t> fitted_alone_;
  std::optional<std::vector<std::size_t>> unsettled_;
  std::vector<Eigen::VectorXd> columns_;
  Eigen::VectorXd estimation_, held_out_;
};

Diagnosis diagnose_effect(RegressionProblem& problem, const Eigen::VectorXd& effect,
                          std::uint64_t seed) {
  Random random(seed);
  problem.measure(effect, random);
  SearchOptions options;
  options.seed = seed + 1000;
  return diagnose(problem, options);
}

// The amplitude of standard deviation `deviations` times the estimate's.
Eigen::VectorXd scaled_effect(const RegressionProblem& problem, const std::string& law,
                              double deviations) {
  const Eigen::VectorXd column = problem.column(problem.index_of(law));
  return deviations / column.norm() * column;
}

// A clear effect, asked to stop at the first step that begins like this.
Diagnosis diagnose_until(const std::string& stop) {
  RegressionProblem problem;
  Random random(4);
  problem.measure(scaled_effect(problem, "harmonic_5", 20.0), random);
  SearchOptions options;
  options.proceed = [&](const std::string& step) { return step.rfind(stop, 0) != 0; };
  return diagnose(problem, options);
}

// A force that no hypothesis has, beside one that is there. Laws that lean a little towards the
// first stay out.
TEST(DiagnosisSearch, GivesUpWhereNoLawExplainsEnough) {
  RegressionProblem problem;
  Eigen::VectorXd effect = scaled_effect(problem, "harmonic_4", 30.0);
  for (Eigen::Index i = 0; i < kSamples; ++i) {
    const double x = RegressionProblem::axis(i);
    effect(i) += 3.0 * std::sin(14.3 * x) + 0.5 * std::sin(8.0 * x);
  }
  for (std::uint64_t i = 0; i < 20; ++i) {
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 500 + i);
    EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    EXPECT_EQ(diagnosis.effects[0].law.hypothesis, problem.index_of("harmonic_4"));
    EXPECT_FALSE(diagnosis.effects[0].excluded.empty());
  }
}

// Two laws that are nearly one: the same recordings name whichever comes first.
TEST(DiagnosisSearch, TakesLawsOfALowerRankFirst) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "step", 30.0);
  for (const auto& [first, last] :
       {std::pair("step", "slanted_step"), std::pair("slanted_step", "step")}) {
    problem.rank_last(last);
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 79);
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    EXPECT_EQ(diagnosis.effects[0].law.hypothesis, problem.index_of(first));
  }
}

// Five effects where the search takes four: none of them is said to be better than its rivals.
TEST(DiagnosisSearch, WeighsNoRivalsOfLawsThatLeaveMoreThanNoise) {
  RegressionProblem problem;
  Eigen::VectorXd effect = Eigen::VectorXd::Zero(kSamples);
  for (const char* law : {"harmonic_4", "harmonic_5", "harmonic_6", "harmonic_7", "harmonic_8"}) {
    effect += scaled_effect(problem, law, 25.0);
  }
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 78);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_FALSE(diagnosis.rivals_weighed);
  ASSERT_EQ(diagnosis.effects.size(), 4U);
  for (const FoundEffect& found : diagnosis.effects) {
    EXPECT_TRUE(found.rivals.empty() && found.excluded.empty());
    EXPECT_TRUE(std::isfinite(found.bic_difference));
  }
}

// However much the fifth leaves: an explanation is never one whose rivals were not weighed.
TEST(DiagnosisSearch, WeighsTheRivalsOfWhateverItExplains) {
  RegressionProblem problem;
  Eigen::VectorXd four = Eigen::VectorXd::Zero(kSamples);
  for (const char* law : {"harmonic_4", "harmonic_5", "harmonic_6", "harmonic_7"}) {
    four += scaled_effect(problem, law, 40.0);
  }
  int explained = 0, unweighed = 0;
  for (int deviations = 0; deviations <= 24; ++deviations) {
    const Eigen::VectorXd effect = four + scaled_effect(problem, "harmonic_8", deviations);
    const Diagnosis diagnosis =
        diagnose_effect(problem, effect, 900 + static_cast<std::uint64_t>(deviations));
    EXPECT_TRUE(diagnosis.rivals_weighed || !diagnosis.verified) << deviations;
    explained += diagnosis.verified ? 1 : 0;
    unweighed += diagnosis.rivals_weighed ? 0 : 1;
  }
  EXPECT_GT(explained, 0);
  EXPECT_GT(unweighed, 0);
}

// As many effects as the search looks for, of equal size: each explains its share, and none is
// given up.
TEST(DiagnosisSearch, DoesNotGiveUpFourEqualEffects) {
  RegressionProblem problem;
  Eigen::VectorXd effect = Eigen::VectorXd::Zero(kSamples);
  for (const char* law : {"harmonic_3", "harmonic_5", "harmonic_8", "step"}) {
    effect += scaled_effect(problem, law, 25.0);
  }
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 77);
  EXPECT_EQ(diagnosis.effects.size(), 4U);
  EXPECT_TRUE(diagnosis.verified);
  EXPECT_TRUE(diagnosis.rivals_weighed);
}

// What is left on the fit's own recordings counts where those kept out do not excite it.
TEST(DiagnosisSearch, AsksForNoiseOnTheFitsOwnRecordingsToo) {
  RegressionProblem problem;
  Eigen::VectorXd effect(kSamples);
  for (Eigen::Index i = 0; i < kSamples; ++i) {
    effect(i) = 2.0 * std::sin(14.3 * RegressionProblem::axis(i));
  }
  Random random(5);
  problem.measure(effect, random);
  problem.keep_out_unexcited(random);
  const Diagnosis diagnosis = diagnose(problem, {});
  EXPECT_GT(diagnosis.rest_test.p_value, 0.01);
  EXPECT_LT(diagnosis.rest_test.fit_p_value, 1e-6);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
}

// Two effects; without the second the fit does not settle. Its rivals are weighed all the same, and
// nothing is said of how much worse the model would be without it.
// Where a law explains all there is, the model alone need not be fitted to its very optimum: far
// from the data it ends a little lower from wherever it begins, each time with other parameters.
TEST(DiagnosisSearch, DoesNotFitTheModelAloneForEverWhereALawExplainsAll) {
  RegressionProblem problem;
  problem.never_quite_ends_without_laws();
  const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_5", 40.0);
  const Diagnosis strong = diagnose_effect(problem, effect, 3);
  EXPECT_EQ(strong.verdict, Verdict::kExplained);
  EXPECT_EQ(problem.fits_without_laws(), 1);
  // A weak one may be nothing but a fit that stopped short.
  RegressionProblem weak;
  weak.never_quite_ends_without_laws();
  (void)diagnose_effect(weak, scaled_effect(weak, "harmonic_5", 9.0), 3);
  EXPECT_GT(weak.fits_without_laws(), 1);
}

TEST(DiagnosisSearch, WeighsRivalsOfALawWithoutWhichNothingSettles) {
  RegressionProblem problem;
  const Eigen::VectorXd effect =
      scaled_effect(problem, "harmonic_4", 40.0) + scaled_effect(problem, "step", 20.0);
  problem.remove("slanted_step");
  problem.describe_all("first", Characteristic::kSpring);  // that place takes no second law
  problem.never_settle_with("step");
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 31);
  ASSERT_EQ(diagnosis.effects.size(), 2U);
  const bool first = diagnosis.effects[0].law.hypothesis == problem.index_of("harmonic_4");
  const FoundEffect& missed = diagnosis.effects[first ? 0 : 1];
  EXPECT_TRUE(std::isnan(missed.bic_difference));
  EXPECT_TRUE(std::isnan(missed.explained_share));
  EXPECT_FALSE(missed.excluded.empty());
  EXPECT_TRUE(std::isfinite(diagnosis.effects[first ? 1 : 0].bic_difference));
}

TEST(DiagnosisSearch, FindsNothingWhereNothingIsMissingAtTheStatedLevel) {
  RegressionProblem problem;
  constexpr int cases = 400;
  int alarms = 0;
  for (std::uint64_t i = 0; i < cases; ++i) {
    const Diagnosis diagnosis = diagnose_effect(problem, Eigen::VectorXd::Zero(kSamples), 7 + i);
    EXPECT_EQ(diagnosis.verdict == Verdict::kNone, !diagnosis.detection.detected);
    alarms += diagnosis.detection.detected ? 1 : 0;
  }
  // 5 %, but where both tests reject together; four standard deviations either way.
  EXPECT_NEAR(alarms / static_cast<double>(cases), 0.047, 4.0 * std::sqrt(0.05 * 0.95 / cases));
}

TEST(DiagnosisSearch, NamesOneEffectAndEstimatesIt) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_5", 9.0);
  int right = 0;
  int covered = 0;
  constexpr int cases = 60;
  for (std::uint64_t i = 0; i < cases; ++i) {
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 100 + i);
    if (diagnosis.verdict != Verdict::kExplained || diagnosis.effects.size() != 1) continue;
    const FittedLaw& law = diagnosis.effects[0].law;
    if (law.hypothesis != problem.index_of("harmonic_5")) continue;
    ++right;
    const double truth = 9.0 / problem.column(law.hypothesis).norm();
    const LawParameterEstimate& estimate = law.parameters[0];
    covered += std::abs(estimate.value - truth) < 3.0 * estimate.standard_error ? 1 : 0;
    EXPECT_GT(diagnosis.effects[0].bic_difference, 10.0);
    EXPECT_GT(diagnosis.effects[0].explained_share, 0.5);
  }
  EXPECT_GE(right, 57);
  EXPECT_GE(covered, right - 2);
}

// In larger motion the errors of a law's amplitude are more than the noise. What is found is right,
// but whether nothing else is missing these recordings do not tell: it is not called explained.
TEST(DiagnosisSearch, DoesNotCallExplainedWhatIsNotPredicted) {
  int explained = 0, explained_larger = 0, named = 0;
  constexpr int cases = 40;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    for (const double times : {1.0, 30.0}) {
      RegressionProblem problem;
      problem.keep_out_larger_motion(times);
      const Diagnosis diagnosis =
          diagnose_effect(problem, scaled_effect(problem, "harmonic_5", 12.0), 700 + seed);
      (times > 1.0 ? explained_larger : explained) +=
          diagnosis.verdict == Verdict::kExplained ? 1 : 0;
      const Assessment& held_out = *diagnosis.validation_after;
      const double size = held_out.chi_square_per_dof();
      EXPECT_TRUE(diagnosis.predicts || size > 1.1);
      EXPECT_TRUE(!diagnosis.predicts || size < 1.3);
      if (times > 1.0 && diagnosis.verdict == Verdict::kAmbiguous && !diagnosis.predicts) {
        EXPECT_TRUE(diagnosis.verified);
        ++named;
      }
    }
  }
  EXPECT_GE(explained, 37);
  EXPECT_LE(explained_larger, 16);  // its error is less than the noise by chance in some
  EXPECT_GE(named, 20);
}

// A third of the samples sees a strong effect well enough: laws far behind it are not fitted to
// all, and are excluded nevertheless. Those that are near go on.
TEST(DiagnosisSearch, RacesOnFewRecordingsFirst) {
  RegressionProblem whole, raced;
  raced.race_on_few();
  const Eigen::VectorXd effect = scaled_effect(whole, "slanted_step", 40.0);
  const Diagnosis expected = diagnose_effect(whole, effect, 32);
  const Diagnosis diagnosis = diagnose_effect(raced, effect, 32);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(diagnosis.verdict, expected.verdict);
  EXPECT_EQ(diagnosis.effects[0].law.hypothesis, expected.effects[0].law.hypothesis);
  EXPECT_NEAR(diagnosis.effects[0].law.parameters[0].value,
              expected.effects[0].law.parameters[0].value, 1e-9);
  EXPECT_EQ(diagnosis.effects[0].rivals.size(), expected.effects[0].rivals.size());
  EXPECT_TRUE(raced.fitted_alone().contains(raced.index_of("step")));
  EXPECT_LT(raced.fitted_alone().size(), whole.fitted_alone().size());
  int outpaced = 0;
  for (const Rival& rival : diagnosis.effects[0].excluded) {
    if (!rival.on_few_recordings) continue;
    ++outpaced;
    EXPECT_FALSE(raced.fitted_alone().contains(rival.law.hypothesis));
    EXPECT_GT(rival.bic_difference, 30.0);
    for (const Rival& same : expected.effects[0].excluded) {
      if (same.law.hypothesis != rival.law.hypothesis) continue;
      EXPECT_GT(same.bic_difference, rival.bic_difference);
    }
  }
  EXPECT_GE(outpaced, 2);
}

// Effects that a third of the samples hardly sees are found all the same: nobody is far behind.
TEST(DiagnosisSearch, ARaceLosesNoSmallEffect) {
  int same = 0;
  constexpr int cases = 40;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    RegressionProblem whole, raced;
    raced.race_on_few();
    const Eigen::VectorXd effect = scaled_effect(whole, "harmonic_5", 6.0);
    const Diagnosis expected = diagnose_effect(whole, effect, 400 + seed);
    const Diagnosis diagnosis = diagnose_effect(raced, effect, 400 + seed);
    const bool is_same = diagnosis.verdict == expected.verdict &&
                         diagnosis.effects.size() == expected.effects.size() &&
                         (diagnosis.effects.empty() || diagnosis.effects[0].law.hypothesis ==
                                                           expected.effects[0].law.hypothesis);
    same += is_same ? 1 : 0;
  }
  EXPECT_EQ(same, cases);
}

TEST(DiagnosisSearch, FindsTwoEffectsOneAfterTheOther) {
  RegressionProblem problem;
  const Eigen::VectorXd effect =
      scaled_effect(problem, "harmonic_3", 14.0) + scaled_effect(problem, "harmonic_8", 10.0);
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 5);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
  ASSERT_EQ(diagnosis.effects.size(), 2U);
  EXPECT_EQ(diagnosis.effects[0].law.hypothesis, problem.index_of("harmonic_3"));
  EXPECT_EQ(diagnosis.effects[1].law.hypothesis, problem.index_of("harmonic_8"));
}

// More noise than is known of, as finer physics may leave it: some law always gains a little there.
// The model without it is a rival as others are, and not excluded.
TEST(DiagnosisSearch, TakesNoLawThatDoesNotExcludeTheModelWithoutIt) {
  int tempting = 0, found_two = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    RegressionProblem problem;
    Random random(900 + seed);
    Eigen::VectorXd effect = scaled_effect(problem, "harmonic_3", 30.0);
    for (double& value : effect) value += 0.7 * random.normal();
    const Eigen::VectorXd second = scaled_effect(problem, "harmonic_8", 12.0);
    found_two += diagnose_effect(problem, effect + second, 50 + seed).effects.size() > 1 ? 1 : 0;
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 50 + seed);
    ASSERT_GE(diagnosis.effects.size(), 1U);
    for (const FoundEffect& found : diagnosis.effects) EXPECT_GT(found.bic_difference, 10.0);
    if (diagnosis.effects.size() > 1) continue;
    for (std::size_t law = 0; law < problem.hypotheses().size(); ++law) {
      if (law == problem.index_of("harmonic_3")) continue;
      const std::vector<LawStart> both{{problem.index_of("harmonic_3"), {1.0}}, {law, {1.0}}};
      const double gain =
          diagnosis.after.deviance - problem.fit(both, nullptr).deviance - std::log(kSamples);
      tempting += gain > 2.5 && gain < 10.0 ? 1 : 0;
    }
  }
  EXPECT_GE(tempting, 3);
  EXPECT_GE(found_two, 36);
}

// What is left beside a large effect is noise by its chi-square, but not to the test aimed at it.
// Where that points to the place of the large effect, it may be no more than the imperfection of
// its law.
TEST(DiagnosisSearch, FindsASmallEffectBesideALargeOneAtAnotherPlace) {
  int found = 0, found_here = 0, was_noise = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RegressionProblem problem;
    const Eigen::VectorXd large = scaled_effect(problem, "harmonic_3", 30.0);
    const Diagnosis elsewhere =
        diagnose_effect(problem, large + scaled_effect(problem, "step", 15.0), 50 + seed);
    if (elsewhere.effects.size() == 2) {
      const Hypothesis& second = problem.hypotheses()[elsewhere.effects[1].law.hypothesis];
      found += second.place == "second" ? 1 : 0;
      const std::vector<LawStart> first{{problem.index_of("harmonic_3"), {1.0}, {}}};
      const Assessment alone = problem.fit(first, nullptr).estimation;
      was_noise += chi_square_tail(alone.chi_square, alone.degrees_of_freedom) >= 0.01 ? 1 : 0;
    }
    problem.describe_all("first", Characteristic::kSpring);
    const Diagnosis here =
        diagnose_effect(problem, large + scaled_effect(problem, "harmonic_8", 6.5), 50 + seed);
    found_here += here.effects.size() == 2 ? 1 : 0;
  }
  EXPECT_GE(found, 18);
  EXPECT_GE(was_noise, 5);
  EXPECT_LE(found_here, 20 - was_noise / 2);
}

// A force that only resembles a law leaves something at that law's place, which the chi-square of
// all residuals does not see. It is another effect where it is of another characteristic; and what
// a law leaves by its imperfection is none.
TEST(DiagnosisSearch, SaysThatALawIsNotQuiteWhatIsThere) {
  constexpr double kRest = 7.0;
  int unknown = 0, was_noise = 0, explained_by_two = 0, departed_beside_larger = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RegressionProblem problem;
    const Eigen::VectorXd rest = scaled_effect(problem, "harmonic_8", kRest);
    const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_3", 30.0) + rest;
    const Diagnosis two = diagnose_effect(problem, effect, 50 + seed);
    explained_by_two += two.effects.size() == 2 && two.departures.empty() ? 1 : 0;
    problem.describe_all("first", Characteristic::kSpring);
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 50 + seed);
    if (diagnosis.effects.size() == 1 && diagnosis.verified) {
      ++was_noise;
      EXPECT_TRUE(diagnosis.shapes_compared);
      EXPECT_EQ(diagnosis.verdict == Verdict::kUnknown, !diagnosis.departures.empty());
      if (!diagnosis.departures.empty()) {
        ++unknown;
        const Departure& departure = diagnosis.departures.front();
        EXPECT_EQ(departure.start.hypothesis, problem.index_of("harmonic_8"));
        EXPECT_NEAR(std::sqrt(departure.share), kRest / 30.0, 4.0 / 30.0);
      }
    }
    const Diagnosis beside_larger =
        diagnose_effect(problem, scaled_effect(problem, "harmonic_3", 300.0) + rest, 50 + seed);
    departed_beside_larger += beside_larger.departures.empty() ? 0 : 1;
  }
  EXPECT_GE(was_noise, 5);
  EXPECT_GE(unknown, was_noise - 1);
  EXPECT_GE(explained_by_two, 18);
  EXPECT_EQ(departed_beside_larger, 0);
}

// Where one or two effects are exactly what was fitted few leave something: the level is that of
// all laws at all their places.
TEST(ShapeComparison, LawsThatAreThereLeaveNothingAtTheStatedLevel) {
  RegressionProblem problem;
  const std::vector<std::string> effects{"harmonic_5", "step"};
  constexpr int cases = 500;
  for (const std::size_t count : {1U, 2U}) {
    Eigen::VectorXd effect = Eigen::VectorXd::Zero(kSamples);
    std::vector<LawStart> laws;
    std::vector<std::size_t> others;
    for (std::size_t h = 0; h < problem.hypotheses().size(); ++h) {
      const Hypothesis& hypothesis = problem.hypotheses()[h];
      if (hypothesis.place == "first" || count == 2) others.push_back(h);
    }
    for (std::size_t k = 0; k < count; ++k) {
      effect += scaled_effect(problem, effects[k], 15.0);
      laws.push_back({problem.index_of(effects[k]), {1.0}});
      std::erase(others, laws.back().hypothesis);
    }
    int left = 0;
    for (std::uint64_t i = 0; i < cases; ++i) {
      Random random(3000 + i);
      problem.measure(effect, random);
      const ShapeComparison shapes = compare_shapes(problem, problem.fit(laws, nullptr), others,
                                                    {.level = 0.05, .explained = 1.0, .seed = i});
      EXPECT_TRUE(shapes.could_tell);
      left += shapes.departures.empty() ? 0 : 1;
    }
    EXPECT_NEAR(left / static_cast<double>(cases), 0.05, 4.0 * std::sqrt(0.05 * 0.95 / cases));
  }
}

// A rival that leaves nothing speaks for the class.
TEST(DiagnosisSearch, ALawOfTheClassThatLeavesNothingIsEnough) {
  int unknown = 0, ambiguous = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RegressionProblem problem;
    for (const char* law : {"step", "slanted_step"}) {
      problem.describe(law, Characteristic::kFriction);
    }
    const Diagnosis diagnosis =
        diagnose_effect(problem, scaled_effect(problem, "slanted_step", 25.0), 90 + seed);
    unknown += diagnosis.verdict == Verdict::kUnknown ? 1 : 0;
    ambiguous += diagnosis.verdict == Verdict::kAmbiguous ? 1 : 0;
  }
  EXPECT_LE(unknown, 1);
  EXPECT_GE(ambiguous, 18);
}

// A spring has one curve: two laws that describe it are as likely one that the catalogue lacks.
TEST(DiagnosisSearch, TwoLawsForOneCharacteristicMayBeOneThatTheCatalogueLacks) {
  RegressionProblem problem;
  const Eigen::VectorXd effect =
      scaled_effect(problem, "harmonic_3", 14.0) + scaled_effect(problem, "harmonic_8", 10.0);
  for (const bool is_one : {false, true}) {
    problem.describe("harmonic_3", Characteristic::kSpring);
    problem.describe("harmonic_8", is_one ? Characteristic::kSpring : Characteristic::kFriction);
    const Diagnosis diagnosis = diagnose_effect(problem, effect, 5);
    EXPECT_EQ(diagnosis.verdict, is_one ? Verdict::kUnknown : Verdict::kExplained);
    ASSERT_EQ(diagnosis.effects.size(), 2U);
    ASSERT_EQ(diagnosis.shared_characteristics.size(), is_one ? 1U : 0U);
    if (is_one) {
      EXPECT_EQ(diagnosis.shared_characteristics.front().hypotheses.size(), 2U);
    }
  }
}

// What was asked to stop before its shape was compared is not called explained.
TEST(DiagnosisSearch, IsNotExplainedWhereItWasStoppedBeforeItsEnd) {
  const Diagnosis diagnosis = diagnose_until("comparing");
  EXPECT_TRUE(diagnosis.interrupted);
  EXPECT_FALSE(diagnosis.effects.empty());
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
}

TEST(DiagnosisSearch, ALawThatIsOneSystemAtTwoPlacesIsOneExplanation) {
  for (const double distance : {0.0, 0.5}) {
    RegressionProblem problem;
    problem.repeat_elsewhere("harmonic_5", distance);
    const Diagnosis diagnosis =
        diagnose_effect(problem, scaled_effect(problem, "harmonic_5", 12.0), 3);
    EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    const FoundEffect& effect = diagnosis.effects.front();
    const bool is_one = distance == 0.0;
    EXPECT_EQ(effect.same_at.size(), is_one ? 1U : 0U);
    EXPECT_EQ(effect.rivals.size(), is_one ? 0U : 1U);
  }
}

TEST(DiagnosisSearch, CallsTwinsAmbiguous) {
  RegressionProblem problem;
  const Diagnosis diagnosis = diagnose_effect(problem, scaled_effect(problem, "step", 12.0), 3);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  ASSERT_EQ(diagnosis.effects[0].rivals.size(), 1U);
}

// The better of two by the recordings of the fit, and nonsense elsewhere.
TEST(DiagnosisSearch, TakesNoLawThatRecordingsKeptOutContradict) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "slanted_step", 1500.0);
  const Diagnosis trusting = diagnose_effect(problem, effect, 11);
  ASSERT_EQ(trusting.effects.size(), 1U);
  EXPECT_EQ(trusting.effects[0].law.hypothesis, problem.index_of("slanted_step"));
  problem.do_elsewhere("slanted_step", -20.0);
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 11);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const FoundEffect& found = diagnosis.effects[0];
  EXPECT_EQ(found.law.hypothesis, problem.index_of("step"));
  EXPECT_TRUE(found.rivals.empty());
  const auto slanted = std::ranges::find_if(found.excluded, [&](const Rival& rival) {
    return rival.law.hypothesis == problem.index_of("slanted_step");
  });
  ASSERT_NE(slanted, found.excluded.end());
  EXPECT_TRUE(slanted->is_contradicted);
  EXPECT_LT(slanted->bic_difference, 0.0);
  // Nor as a generalisation, which would else be a rival by its evidence.
  problem.generalise("slanted_step", "step", -4.0);
  const Diagnosis richer = diagnose_effect(problem, effect, 11);
  ASSERT_EQ(richer.effects.size(), 1U);
  EXPECT_EQ(richer.effects[0].law.hypothesis, problem.index_of("step"));
  EXPECT_TRUE(richer.effects[0].rivals.empty());
  EXPECT_TRUE(richer.effects[0].generalisations.empty());
}

// Laws alike on the recordings of the fit that differ in what they make of those kept out.
TEST(DiagnosisSearch, CountsWhatRecordingsKeptOutSayOfRivals) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "step", 12.0);
  const auto slanted = [&](const std::vector<Rival>& rivals) {
    return std::ranges::find_if(rivals, [&](const Rival& rival) {
      return rival.law.hypothesis == problem.index_of("slanted_step");
    });
  };
  const Diagnosis alike = diagnose_effect(problem, effect, 3);
  ASSERT_EQ(alike.effects.size(), 1U);
  EXPECT_EQ(alike.effects[0].law.hypothesis, problem.index_of("step"));
  EXPECT_NE(slanted(alike.effects[0].rivals), alike.effects[0].rivals.end());
  EXPECT_EQ(alike.verdict, Verdict::kAmbiguous);

  problem.do_elsewhere("slanted_step", 3.0);
  const Diagnosis told = diagnose_effect(problem, effect, 3);
  ASSERT_EQ(told.effects.size(), 1U);
  EXPECT_EQ(told.effects[0].law.hypothesis, problem.index_of("step"));
  EXPECT_TRUE(told.effects[0].rivals.empty());
  const auto excluded = slanted(told.effects[0].excluded);
  ASSERT_NE(excluded, told.effects[0].excluded.end());
  EXPECT_LT(excluded->bic_difference, SearchOptions{}.exclusion_margin);
  ASSERT_TRUE(excluded->held_out_difference);
  EXPECT_GT(*excluded->held_out_difference, 0.0);
  EXPECT_GT(excluded->bic_difference + *excluded->held_out_difference,
            SearchOptions{}.exclusion_margin);
  EXPECT_FALSE(excluded->is_contradicted);
  EXPECT_EQ(told.verdict, Verdict::kExplained);

  // The law that fits best is not the one found where those kept out speak against it.
  problem.do_elsewhere("slanted_step", 1.0);
  problem.do_elsewhere("step", 3.0);
  const Diagnosis turned = diagnose_effect(problem, effect, 3);
  ASSERT_EQ(turned.effects.size(), 1U);
  EXPECT_EQ(turned.effects[0].law.hypothesis, problem.index_of("slanted_step"));
}

// Where no other predicts better, it is tried and rejected: it is no explanation.
TEST(DiagnosisSearch, DoesNotCallAContradictedLawAnExplanation) {
  RegressionProblem problem;
  for (int harmonic = 3; harmonic < 9; ++harmonic) {
    problem.remove("harmonic_" + std::to_string(harmonic));
  }
  problem.do_elsewhere("step", -20.0);
  problem.do_elsewhere("slanted_step", -20.0);
  const Diagnosis diagnosis = diagnose_effect(problem, scaled_effect(problem, "step", 300.0), 11);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_TRUE(diagnosis.effects.empty());
  EXPECT_TRUE(diagnosis.after.laws.empty());
  // Without it another is found there, which does no better.
  ASSERT_GE(diagnosis.rejected.size(), 1U);
  for (const RejectedLaw& rejected : diagnosis.rejected) {
    EXPECT_EQ(problem.hypotheses()[rejected.law.hypothesis].place, "second");
    ASSERT_TRUE(rejected.held_out);
    EXPECT_TRUE(rejected.held_out->misleads);
  }
}

TEST(DiagnosisSearch, TakesFreeMotionOutWithALawBeforeItLooksForMore) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_5", 60.0);
  problem.hold_free_motion(scaled_effect(problem, "harmonic_8", 15.0));
  const Diagnosis freed = diagnose_effect(problem, effect, 4);
  EXPECT_EQ(freed.verdict, Verdict::kExplained);
  ASSERT_EQ(freed.effects.size(), 1U);
  EXPECT_EQ(freed.effects[0].law.hypothesis, problem.index_of("harmonic_5"));
  // Not where that leaves more than before.
  problem.spoil_when_renewed(scaled_effect(problem, "harmonic_7", 40.0));
  const Diagnosis kept = diagnose_effect(problem, effect, 4);
  std::set<std::size_t> found;
  for (const FoundEffect& each : kept.effects) found.insert(each.law.hypothesis);
  EXPECT_EQ(found, std::set<std::size_t>{problem.index_of("harmonic_5")});
  // A law that only stands in for free motion is not there in recordings kept out.
  ASSERT_EQ(kept.rejected.size(), 1U);
  EXPECT_EQ(kept.rejected[0].law.hypothesis, problem.index_of("harmonic_8"));
}

// Of a law that leaves a multiple of the noise before that, no fit is needed after it.
TEST(DiagnosisSearch, ExcludesWhatWasFarBehindBeforeFreeMotionWasTakenOut) {
  RegressionProblem problem;
  problem.hold_free_motion(scaled_effect(problem, "harmonic_8", 15.0));
  const Diagnosis diagnosis =
      diagnose_effect(problem, scaled_effect(problem, "harmonic_5", 60.0), 4);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_TRUE(diagnosis.effects[0].rivals.empty());
  EXPECT_FALSE(diagnosis.effects[0].excluded.empty());
  for (const Rival& rival : diagnosis.effects[0].excluded) {
    EXPECT_GT(rival.bic_difference, static_cast<double>(kSamples));
  }
}

// Whatever explains the recordings on average; a p-value that the level allows for does not count.
TEST(DiagnosisSearch, SaysUnknownWhereSomethingChangesWithTime) {
  for (const double amplitude : {0.0, 12.0}) {
    RegressionProblem problem;
    const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_5", amplitude);
    problem.change_with_time(1e-3);
    const Diagnosis steady = diagnose_effect(problem, effect, 8);
    EXPECT_EQ(steady.verdict, amplitude > 0.0 ? Verdict::kExplained : Verdict::kNone);
    EXPECT_FALSE(steady.time_variation);
    EXPECT_TRUE(steady.time_variation_was_tested);
    problem.change_with_time(1e-9);
    const Diagnosis changing = diagnose_effect(problem, effect, 8);
    EXPECT_EQ(changing.verdict, Verdict::kUnknown);
    EXPECT_TRUE(changing.detection.detected);
    ASSERT_TRUE(changing.time_variation);
    EXPECT_EQ(changing.time_variation->place, "first");
    EXPECT_EQ(changing.effects.size(), amplitude > 0.0 ? 1U : 0U);
  }
}

// A law that recordings can't tell from another is never fitted, but named with it.
TEST(DiagnosisSearch, NamesTwinsThatAreNotFitted) {
  RegressionProblem problem;
  problem.only_name("harmonic_8", "harmonic_3");
  const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_3", 14.0);
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 5);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_EQ(diagnosis.effects[0].law.hypothesis, problem.index_of("harmonic_3"));
  ASSERT_EQ(diagnosis.effects[0].rivals.size(), 1U);
  EXPECT_EQ(diagnosis.effects[0].rivals[0].law.hypothesis, problem.index_of("harmonic_8"));
  for (const HypothesisScore& score : diagnosis.ranking) {
    EXPECT_NE(score.start.hypothesis, problem.index_of("harmonic_8"));
  }
  SearchOptions options;
  options.excluded_laws = {"harmonic_8"};
  EXPECT_EQ(diagnose(problem, options).verdict, Verdict::kExplained);
}

// A twin that generalises the law is no rival: it is named beside it.
TEST(DiagnosisSearch, NamesATwinThatGeneralisesTheLawBesideIt) {
  RegressionProblem problem;
  problem.only_name("harmonic_8", "harmonic_3");
  problem.generalise("harmonic_8", "harmonic_3", 0.0);
  const Diagnosis diagnosis =
      diagnose_effect(problem, scaled_effect(problem, "harmonic_3", 14.0), 5);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  EXPECT_TRUE(diagnosis.effects[0].rivals.empty());
  ASSERT_EQ(diagnosis.effects[0].generalisations.size(), 1U);
  EXPECT_EQ(diagnosis.effects[0].generalisations[0].law.hypothesis, problem.index_of("harmonic_8"));
}

// Before one of a rival's: where there is room for one name, it is that of the law found.
TEST(DiagnosisSearch, NamesTheTwinOfTheLawFoundFirst) {
  RegressionProblem problem;
  problem.only_name("harmonic_7", "step");
  problem.only_name("harmonic_8", "slanted_step");
  problem.generalise("harmonic_7", "step", 0.0);
  problem.generalise("harmonic_8", "slanted_step", 0.0);
  for (const char* law : {"step", "slanted_step"}) {
    const Diagnosis diagnosis = diagnose_effect(problem, scaled_effect(problem, law, 12.0), 3);
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    const FoundEffect& effect = diagnosis.effects[0];
    EXPECT_EQ(effect.rivals.size(), 1U);
    ASSERT_EQ(effect.generalisations.size(), 1U);
    EXPECT_EQ(problem.hypotheses()[effect.law.hypothesis].twins.front(),
              effect.generalisations[0].law.hypothesis);
  }
}

// A law that holds the one found fits as well always. It is a rival where the data do not know its
// further parameters, so that the effect may as well be one of it; it is named beside the law where
// they do not ask for it; and it is left out where they speak against it.
TEST(DiagnosisSearch, ALawThatGeneralisesTheBestIsARivalWhereItMayBeTheOne) {
  // Beside what the richer law gains by chance.
  for (const double information : {-4.0, -0.5, 4.0, 40.0}) {
    RegressionProblem problem;
    problem.generalise("slanted_step", "step", information);
    const Diagnosis diagnosis =
        diagnose_effect(problem, scaled_effect(problem, "slanted_step", 12.0), 3);
    ASSERT_EQ(diagnosis.effects.size(), 1U);
    EXPECT_EQ(diagnosis.effects[0].law.hypothesis, problem.index_of("step"));
    const bool is_certain = information > -2.0;
    EXPECT_EQ(diagnosis.verdict, is_certain ? Verdict::kExplained : Verdict::kAmbiguous);
    EXPECT_EQ(diagnosis.effects[0].rivals.size(), is_certain ? 0U : 1U);
    const bool is_named = is_certain && information < 10.0;
    EXPECT_EQ(diagnosis.effects[0].generalisations.size(), is_named ? 1U : 0U);
  }
}

TEST(DiagnosisSearch, SaysUnknownWhereNoHypothesisExplains) {
  RegressionProblem problem;
  const Eigen::VectorXd effect = scaled_effect(problem, "harmonic_6", 30.0);
  problem.remove("harmonic_6");
  const Diagnosis diagnosis = diagnose_effect(problem, effect, 11);
  EXPECT_TRUE(diagnosis.detection.detected);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_FALSE(diagnosis.verified);
}

TEST(DiagnosisSearch, AHypothesisThatTheModelImitatesCanNotBeSeen) {
  RegressionProblem problem;
  const Diagnosis diagnosis = diagnose_effect(problem, Eigen::VectorXd::Zero(kSamples), 2);
  for (const DetectableEffect& effect : diagnosis.detectable) {
    EXPECT_EQ(std::isinf(effect.amplitude), effect.hypothesis == problem.index_of("parabola"));
  }
}

TEST(DiagnosisSearch, TheSmallestDetectableEffectIsFoundWithThePowerStated) {
  RegressionProblem problem;
  const Diagnosis quiet = diagnose_effect(problem, Eigen::VectorXd::Zero(kSamples), 2);
  double amplitude = 0.0;
  for (const DetectableEffect& effect : quiet.detectable) {
    if (effect.hypothesis == problem.index_of("harmonic_4")) amplitude = effect.amplitude;
  }
  const Eigen::VectorXd effect = amplitude * problem.column(problem.index_of("harmonic_4"));
  constexpr int cases = 200;
  int found = 0;
  for (std::uint64_t i = 0; i < cases; ++i) {
    found += diagnose_effect(problem, effect, 3000 + i).detection.detected ? 1 : 0;
  }
  // The overall chi-square only adds to the power of the score test alone.
  EXPECT_GT(found / static_cast<double>(cases), 0.9 - 4.0 * std::sqrt(0.09 / cases));
  EXPECT_LT(found, cases);
}

TEST(DiagnosisSearch, StopsWhenAskedAndSaysSo) {
  const Diagnosis diagnosis = diagnose_until("refitting");
  EXPECT_TRUE(diagnosis.interrupted);
  EXPECT_TRUE(diagnosis.detection.detected);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
}

// A small effect of the fit's recordings that those kept out know nothing of, where chi-square is
// no more than noise: no law is found, and the model is complete as far as can be said. Where they
// show it, too, the law is found.
TEST(DiagnosisSearch, ASmallLawMustGainOnRecordingsKeptOut) {
  int found = 0, unexcited = 0;
  for (std::uint64_t seed = 40; seed < 50; ++seed) {
    for (const bool is_kept_out : {true, false}) {
      RegressionProblem problem;
      Random random(seed);
      problem.measure(scaled_effect(problem, "harmonic_4", 5.5), random);
      if (!is_kept_out) problem.keep_out_unexcited(random);
      const Diagnosis diagnosis = diagnose(problem, {});
      const bool is_small = diagnosis.detection.lack_of_fit_p_value > 0.025;
      if (!is_small) continue;
      (is_kept_out ? found : unexcited) += diagnosis.effects.empty() ? 0 : 1;
      EXPECT_EQ(diagnosis.effects.empty(), diagnosis.verdict == Verdict::kNone) << seed;
    }
  }
  EXPECT_GT(found, 2 * unexcited);
}

// What changes with time was not looked for: "none" would say more than is known.
TEST(DiagnosisSearch, DoesNotSayNoneWhereItWasStopped) {
  RegressionProblem problem;
  Random random(4);
  problem.measure(Eigen::VectorXd::Zero(kSamples), random);
  SearchOptions options;
  EXPECT_EQ(diagnose(problem, options).verdict, Verdict::kNone);
  options.proceed = [](const std::string& step) {
    return step.find("changes") == std::string::npos;
  };
  const Diagnosis stopped = diagnose(problem, options);
  EXPECT_TRUE(stopped.interrupted);
  EXPECT_EQ(stopped.verdict, Verdict::kUnknown);
}

// Noise gives about half of the laws whose size can't be negative a negative one: they were looked
// for all the same.
TEST(DiagnosisSearch, ASignThatALawCanNotHaveHidesNothing) {
  RegressionProblem problem;
  problem.allow_only_positive();
  for (std::uint64_t seed = 2; seed < 5; ++seed) {
    const Diagnosis diagnosis = diagnose_effect(problem, Eigen::VectorXd::Zero(kSamples), seed);
    for (const DetectableEffect& effect : diagnosis.detectable) {
      EXPECT_EQ(std::isinf(effect.amplitude), effect.hypothesis == problem.index_of("parabola"));
    }
  }
}

TEST(ScoreTest, DoesNotDependOnTheUnitsOfParametersAndAmplitudes) {
  Random random(8);
  Eigen::MatrixXd all(60, 8);  // 4 parameters, 2 amplitudes, residual, one draw
  for (double& value : all.reshaped()) value = random.normal();
  const auto products = [&](double unit, double other) {
    Eigen::MatrixXd model = all.leftCols(4);
    Eigen::MatrixXd own = all.middleCols(4, 2);
    model.col(1) *= unit;
    own.col(0) *= other;
    const Eigen::MatrixXd right = all.rightCols(2);
    const ScoreTest test({model.transpose() * model, model.transpose() * right});
    return test.score({own.transpose() * own, own.transpose() * model, own.transpose() * right});
  };
  const CandidateScore plain = products(1.0, 1.0);
  const CandidateScore scaled = products(1e7, 1e-6);
  EXPECT_NEAR(scaled.statistic, plain.statistic, 1e-9 * plain.statistic);
  EXPECT_NEAR(scaled.amplitudes(0), 1e6 * plain.amplitudes(0),
              1e-3 * std::abs(plain.amplitudes(0)));
  // Least squares with and without the two columns, by brute force.
  Eigen::MatrixXd joint = all.leftCols(6);
  const Eigen::VectorXd right = all.col(6);
  const auto rest = [&](const Eigen::MatrixXd& columns) {
    return (right - columns * columns.householderQr().solve(right)).squaredNorm();
  };
  // The residual is not at the optimum of the four, which the score test corrects to first order.
  EXPECT_NEAR(plain.statistic, rest(all.leftCols(4)) - rest(joint), 1e-9);
}

TEST(ScoreTest, CanonicalCorrelationIsOneForTwinsAndZeroForStrangers) {
  Random random(9);
  Eigen::MatrixXd model(40, 2), own(40, 2);
  for (double& value : model.reshaped()) value = random.normal();
  for (double& value : own.reshaped()) value = random.normal();
  const Eigen::MatrixXd none(2, 1);
  const NuisanceProducts nuisance{model.transpose() * model, Eigen::MatrixXd::Zero(2, 1)};
  const auto products = [&](const Eigen::MatrixXd& columns) {
    return CandidateProducts{columns.transpose() * columns, columns.transpose() * model,
                             Eigen::MatrixXd::Zero(columns.cols(), 1)};
  };
  // A twin up to what the parameters can imitate.
  const Eigen::MatrixXd twin = 3.0 * own.col(0) + 7.0 * model.col(1);
  const Eigen::MatrixXd first = own.col(0);
  EXPECT_NEAR(canonical_correlation_squared(nuisance, products(first), products(twin),
                                            first.transpose() * twin),
              1.0, 1e-9);
  const Eigen::HouseholderQR<Eigen::MatrixXd> factor(
      (Eigen::MatrixXd(40, 3) << model, first).finished());
  const Eigen::MatrixXd basis = factor.householderQ() * Eigen::MatrixXd::Identity(40, 5);
  const Eigen::MatrixXd stranger = basis.col(4);
  EXPECT_NEAR(canonical_correlation_squared(nuisance, products(first), products(stranger),
                                            first.transpose() * stranger),
              0.0, 1e-12);
}

TEST(ScoreTest, FamilyThresholdIsMetInTheMean) {
  Random random(10);
  int below = 0;
  const int repeats = 4000;
  for (int i = 0; i < repeats; ++i) {
    std::vector<double> minima(39);
    for (double& value : minima) value = random.uniform();
    below += random.uniform() < family_threshold(minima, 0.05) ? 1 : 0;
  }
  EXPECT_NEAR(below / static_cast<double>(repeats), 0.05, 4.0 * std::sqrt(0.0475 / repeats));
  EXPECT_THROW((void)family_threshold(std::vector<double>(10, 0.5), 0.05), InputError);
}

// What can have one sign only is found by half of all noise: with draws of both signs the level
// would be half of the one that is stated.
TEST(ScoreTest, OneSidedTermsMeetTheirLevel) {
  constexpr int kDraws = 199, kRepeats = 4000;
  constexpr double kLevel = 0.05;
  Random random(12);
  const Eigen::VectorXd term = Eigen::VectorXd::LinSpaced(10, 0.5, 2.0);
  const ScoreTest test({Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 1 + kDraws)});
  const auto is_possible = [](const Eigen::VectorXd& amplitude) { return amplitude(0) > 0.0; };
  int alarms = 0;
  for (int i = 0; i < kRepeats; ++i) {
    Eigen::MatrixXd noise(10, 1 + kDraws);
    for (double& value : noise.reshaped()) value = random.normal();
    const CandidateProducts products{Eigen::MatrixXd::Constant(1, 1, term.squaredNorm()),
                                     Eigen::MatrixXd(1, 0), term.transpose() * noise};
    std::vector<double> minima(kDraws, 1.0);
    test.lower_minimum_p_values(products, is_possible, minima);
    const CandidateScore score = test.score(products);
    alarms +=
        is_possible(score.amplitudes) && score.p_value < family_threshold(minima, kLevel) ? 1 : 0;
  }
  EXPECT_NEAR(alarms / static_cast<double>(kRepeats), kLevel,
              4.0 * std::sqrt(kLevel * (1.0 - kLevel) / kRepeats));
}

TEST(ScoreTest, RefusesProductsThatDoNotBelongTogether) {
  const ScoreTest test({Eigen::MatrixXd::Identity(2, 2), Eigen::MatrixXd::Zero(2, 1)});
  EXPECT_THROW((void)test.score({Eigen::MatrixXd::Identity(1, 1), Eigen::MatrixXd::Zero(1, 3),
                                 Eigen::MatrixXd::Zero(1, 1)}),
               InputError);
}

TEST(PracticalSize, ARestThatIsNoNumberIsNoNoise) {
  Assessment assessment;
  assessment.degrees_of_freedom = 100.0;
  assessment.chi_square = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(practical_size_p_value(assessment, 0.05), 0.0);
}

TEST(PracticalSize, LetsPassWhatIsSmallerThanTheTolerance) {
  Assessment assessment;
  assessment.degrees_of_freedom = 1e5;
  assessment.chi_square = 1.03e5;  // rejected beyond doubt by the plain test
  EXPECT_LT(chi_square_tail(assessment.chi_square, assessment.degrees_of_freedom), 1e-9);
  EXPECT_GT(practical_size_p_value(assessment, 0.05), 0.5);
  assessment.chi_square = 1.1e5;
  EXPECT_LT(practical_size_p_value(assessment, 0.05), 1e-9);
}

}  // namespace
}  // namespace graybox
