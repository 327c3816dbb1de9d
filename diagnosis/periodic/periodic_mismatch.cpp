#include "diagnosis/periodic/periodic_mismatch.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/free_motion/changing_coefficient.hpp"
#include "diagnosis/free_motion/transients.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/hypotheses/physical_evidence.hpp"
#include "diagnosis/periodic/candidate_scores.hpp"
#include "diagnosis/periodic/cleared_fit.hpp"
#include "diagnosis/periodic/compared_responses.hpp"
#include "diagnosis/periodic/gradual_fit.hpp"
#include "diagnosis/periodic/periodic_assessment.hpp"
#include "diagnosis/periodic/periodic_fit.hpp"
#include "diagnosis/periodic/periodic_hypotheses.hpp"
#include "diagnosis/periodic/periodic_shapes.hpp"
#include "diagnosis/periodic/response_starts.hpp"
#include "diagnosis/periodic/rival_experiments.hpp"
#include "diagnosis/periodic/telling_recordings.hpp"
#include "diagnosis/periodic_pictures/law_pictures.hpp"
#include "diagnosis/periodic_pictures/mismatch_map.hpp"
#include "diagnosis/periodic_pictures/residual_spectra.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// How much of a b b^T can be taken from a matrix that is positive semidefinite, so that it stays
// so: 1/(b^T A^+ b), and nothing where b is not in its range.
double removable(const MatrixXd& matrix, const VectorXd& b) {
  constexpr double kOutside = 1e-6;
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> factor(matrix);
  const VectorXd solution = factor.solve(b);
  const double along = b.dot(solution);
  if ((matrix * solution - b).norm() > kOutside * b.norm() || !(along > 0.0)) return 0.0;
  return 1.0 / along;
}

// Not a number where there is none.
double largest_of(const std::vector<double>& forces) {
  double largest = std::numeric_limits<double>::quiet_NaN();
  for (const double force : forces) largest = std::fmax(largest, std::abs(force));
  return largest;
}

// Excited frequencies, levels, positions, and how far the outputs went (rms).
CheckedRange range_of(const PeriodicData& data, const std::vector<MeasuredRecord>& records,
                      bool kept_out) {
  constexpr double kHertz = 0.5 / std::numbers::pi;
  CheckedRange range;
  range.kept_out = kept_out;
  if (data.excited.empty() || records.empty()) return range;
  range.spans.push_back({"frequency", "Hz", data.frequencies[data.excited.front()] * kHertz,
                         data.frequencies[data.excited.back()] * kHertz});
  const auto add = [&](std::string quantity, std::string unit, const std::vector<double>& values) {
    const auto [least, most] = std::ranges::minmax_element(values);
    range.spans.push_back({std::move(quantity), std::move(unit), *least, *most});
  };
  std::vector<double> levels;
  std::vector<std::vector<double>> amplitudes(data.outputs.size());
  const double rms_of_lines = std::sqrt(2.0 / static_cast<double>(data.period));
  for (const MeasuredRecord& record : records) {
    levels.push_back(record.level);
    for (std::size_t y = 0; y < amplitudes.size(); ++y) {
      amplitudes[y].push_back(rms_of_lines * record.output.row(static_cast<Index>(y)).norm());
    }
    if (std::ranges::find(range.files, record.name) == range.files.end()) {
      range.files.push_back(record.name);
    }
    if (record.position < data.position_names.size() &&
        std::ranges::find(range.positions, data.position_names[record.position]) ==
            range.positions.end()) {
      range.positions.push_back(data.position_names[record.position]);
    }
  }
  if (*std::ranges::max_element(levels) > 0.0) add("level", "", levels);
  for (std::size_t y = 0; y < amplitudes.size(); ++y) {
    add("rms of " + data.outputs[y], data.output_units[y], amplitudes[y]);
  }
  std::erase(range.positions, std::string());
  return range;
}

// How many positions the recordings of the fit were made at.
std::size_t positions_of(const PeriodicData& data) {
  std::set<std::size_t> positions;
  for (const MeasuredRecord& record : data.estimation) positions.insert(record.position);
  return positions.size();
}

bool can_clear_with(const ExtendedFit& fit) {
  constexpr double kMisfit = 100.0;
  return fit.estimation.chi_square_per_dof() <= kMisfit;
}

bool leaves_more_than_noise(const ExtendedFit& fit) {
  constexpr double kNoNoise = 0.01;
  const Assessment& rest = fit.estimation;
  return chi_square_tail(rest.chi_square, rest.degrees_of_freedom) < kNoNoise;
}

// Beyond what a model without it takes out.
bool bends_free_motion(const ActingLaw& law) {
  return law.place->location.kind == LocationKind::kElement &&
         (law.entry->name == "mode" || has_varying_slopes(law));
}

// Mean logarithm of the standard deviations of lines, up to a constant.
double noise_level(const PeriodicData& data) {
  double sum = 0.0, count = 0.0;
  for (const auto& group : data.whitening) {
    for (Index k = data.first_line; k <= data.last_line; ++k) {
      const MatrixXcd& whitening = group[at(k)];
      sum -= std::log(std::abs(whitening.determinant()));
      count += static_cast<double>(whitening.rows());
    }
  }
  return sum / count;
}

// Far beyond any level of detection, so that a motion that holds noise of the residuals is taken
// only where tests of single hypotheses no longer decide whether anything is missing.
bool is_clearly_wrong(const ExtendedFit& fit) {
  constexpr double kLevel = 1e-6;
  return chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom) < kLevel;
}

// The parameter of the model with the largest relative error; none where the data see none.
std::optional<Index> least_determined(const PlantFamily& family, const PeriodicFit& fit) {
  const VectorXd errors = standard_errors(fit.information);
  std::optional<Index> least;
  double largest = 0.0;
  for (Index p = 0; p < fit.parameters.size(); ++p) {
    const double error = errors(p) / std::abs(fit.parameters(p));
    if (!family.parameters()[at(p)].positive || !(error > largest)) continue;
    least = p;
    largest = error;
  }
  return least;
}

// A fit to the records of `data` in the search's terms. `frame` has the model's positions.
ExtendedFit assessed(const PeriodicHypotheses& hypotheses, const PeriodicData& frame,
                     const PeriodicData& data, const PeriodicFit& fitted,
                     std::span<const LawStart> laws, int threads) {
  ExtendedFit result = hypotheses.report(fitted, laws);
  if (fitted.parameters.size() == 0) return result;
  result.estimation = assess_records(
      hypotheses.family(), frame,
      evaluate_model(hypotheses.family(), frame, fitted.parameters, fitted.laws, false, threads),
      data.estimation, result.parameter_count, threads);
  return result;
}

// Where one force acted freely at a place, and what came of it (freed_fit()).
struct FreedFit {
  const CandidatePlace* place;
  std::vector<ActingLaw> others;
  PeriodicFit fit;
};

// Fits of the model with laws, from a fit that is known. Keeps references.
class PeriodicLawFits {
 public:
  // `first`: the fit of the model as it is, if there is one. `freed_fits`: those that are known;
  // others are added.
  PeriodicLawFits(const PeriodicHypotheses& hypotheses, const PeriodicData& data,
                  PeriodicFitOptions how, const VectorXd& start,
                  const std::optional<PeriodicFit>& first, std::deque<FreedFit>& freed_fits)
      : hypotheses_(hypotheses),
        data_(data),
        how_(std::move(how)),
        start_(start),
        first_(first),
        freed_fits_(freed_fits) {}

  // From the parameters of the fit nearby and those that the ranking found for the law, the best of
  // them.
  [[nodiscard]] ExtendedFit fit_from(const PeriodicData& data, const PeriodicFitOptions& how,
                                     std::span<const LawStart> laws,
                                     const ExtendedFit& nearby) const {
    VectorXd start = start_;
    std::vector<ActingLaw> acting = hypotheses_.with_base_laws(laws);
    hypotheses_.take_model_parameters(nearby, start, acting);
    std::vector<VectorXd> starts{start};
    if (!laws.empty() && !laws.back().model_parameters.empty()) {
      const std::vector<double>& other = laws.back().model_parameters;
      starts.emplace_back(Eigen::Map<const VectorXd>(other.data(), start_.size()));
    }
    PeriodicFit best = fit_periodic(hypotheses_.family(), data, starts, acting, how);
    if (!laws.empty()) begin_elsewhere(data, how, starts, acting, laws, best);
    ExtendedFit result = report(data, best, laws);
    // A model alone that is far off has its parameters far off, and its valleys need not be those
    // of the law.
    const bool is_near = result.usable && can_clear_with(result);
    if (laws.empty() || !first_ || can_clear_with(nearby) || is_near) return result;
    std::vector<VectorXd> early{start_};
    if (first_->start.size() > 0 && first_->start != start_) early.push_back(first_->start);
    const PeriodicFit afresh =
        can_free(data, acting.back())
            ? fit_from_freed(data, how, early, acting)
            : fit_periodic_if_near(hypotheses_.family(), data, early, acting, how);
    const bool is_better =
        afresh.converged && (!best.converged || afresh.chi_square < best.chi_square);
    return is_better ? report(data, afresh, laws) : result;
  }

 private:
  [[nodiscard]] ExtendedFit report(const PeriodicData& data, const PeriodicFit& fitted,
                                   std::span<const LawStart> laws) const {
    return assessed(hypotheses_, data_, data, fitted, laws, how_.threads);
  }

  // Where the law fits best without what refines it (a limit far above the motion with a corner
  // that reaches down to it is another valley), at all its other valleys, and at its spare starts
  // until one leads to a steady state.
  void begin_elsewhere(const PeriodicData& data, const PeriodicFitOptions& how,
                       const std::vector<VectorXd>& starts, std::vector<ActingLaw> acting,
                       std::span<const LawStart> laws, PeriodicFit& best) const {
    std::vector<VectorXd> from = starts;
    double least = std::numeric_limits<double>::infinity();  // of all valleys
    const auto take_if_better = [&](const std::vector<double>& parameters) {
      acting.back().parameters = parameters;
      PeriodicFitOptions rest = how;
      if (best.converged) {
        least = std::min(least, best.chi_square);
        rest.to_beat = data.validation.empty() ? least : least + kUndecided;
      }
      PeriodicFit fit = fit_periodic(hypotheses_.family(), data, from, acting, rest);
      if (is_better_valley(data, fit, best)) best = std::move(fit);
    };
    if (has_refinements(*acting.back().entry)) {
      const PeriodicFit plain =
          fit_periodic(hypotheses_.family(), data, starts, with_refinements_held(acting), how);
      if (plain.has_steady_state) {
        from = {plain.parameters};
        take_if_better(plain.laws.back().parameters);
        from = starts;
      }
    }
    std::ranges::for_each(laws.back().others, take_if_better);
    for (const std::vector<double>& spare : laws.back().spares) {
      if (best.has_steady_state) break;
      take_if_better(spare);
    }
  }

  static constexpr double kUndecided = 10.0;  // of chi-square

  // Valleys that the fit's recordings hardly tell from each other are told apart by those kept out,
  // as laws are (FitComparison::held_out_difference): a motion that only grazes a limit says little
  // of where that is. Not in a race, which knows none kept out.
  [[nodiscard]] bool is_better_valley(const PeriodicData& data, const PeriodicFit& fit,
                                      const PeriodicFit& than) const {
    if (!fit.converged || !than.converged) return fit.converged;
    const double difference = fit.chi_square - than.chi_square;
    if (data.validation.empty() || std::abs(difference) > kUndecided || !is_another(fit, than)) {
      return difference < 0.0;
    }
    const auto cost = [&](const PeriodicFit& each) {
      const ModelState model = evaluate_model(hypotheses_.family(), data, each.parameters,
                                              each.laws, true, how_.threads);
      return graybox::predict_held_out(hypotheses_.family(), data, model, graybox::values_of(each),
                                       how_.threads)
          .cost.value_or(0.0);
    };
    const double of_fit = cost(fit), of_other = cost(than);
    const double held_out = of_fit == of_other ? 0.0 : of_fit - of_other;  // both may be infinite
    return difference + kHeldOutShare * held_out < 0.0;
  }

  // Farther away than its own errors allow.
  [[nodiscard]] static bool is_another(const PeriodicFit& fit, const PeriodicFit& than) {
    constexpr double kErrors = 3.0;
    VectorXd change(than.information.rows());
    Index k = than.parameters.size();
    change.head(k) = fit.parameters - than.parameters;
    for (std::size_t l = 0; l < than.laws.size(); ++l) {
      for (std::size_t p = 0; p < than.laws[l].parameters.size(); ++p) {
        change(k++) = fit.laws[l].parameters[p] - than.laws[l].parameters[p];
      }
    }
    return change.dot(than.information * change) > kErrors * kErrors;
  }

  [[nodiscard]] PeriodicFit fit_from_freed(const PeriodicData& data, const PeriodicFitOptions& how,
                                           const std::vector<VectorXd>& early,
                                           const std::vector<ActingLaw>& laws) const {
    const PeriodicFit& freed = freed_at(*laws.back().place, {laws.begin(), laws.end() - 1}, early);
    if (!freed.converged) return freed;
    return fit_periodic_after_freed(hypotheses_.family(), data, freed, laws.back(), how);
  }

  // Many laws share a place: its fit is kept.
  const PeriodicFit& freed_at(const CandidatePlace& place, const std::vector<ActingLaw>& others,
                              const std::vector<VectorXd>& early) const {
    const auto is_same = [](const ActingLaw& a, const ActingLaw& b) {
      return a.place == b.place && a.entry == b.entry && a.parameters == b.parameters;
    };
    for (const FreedFit& known : freed_fits_) {
      if (known.place == &place && std::ranges::equal(known.others, others, is_same)) {
        return known.fit;
      }
    }
    freed_fits_.push_back(
        {&place, others,
         freed_fit(hypotheses_.family(), data_, early, others, place.location, how_)});
    return freed_fits_.back().fit;
  }

  const PeriodicHypotheses& hypotheses_;
  const PeriodicData& data_;
  const PeriodicFitOptions how_;
  const VectorXd& start_;
  const std::optional<PeriodicFit>& first_;
  std::deque<FreedFit>& freed_fits_;
};

// The problem of the search where recordings are periodic.
class PeriodicProblem : public MismatchProblem, public PhysicalEvidence {
 public:
  PeriodicProblem(std::shared_ptr<const PlantFamily> family, PeriodicData data,
                  const PeriodicDataOptions& reading, const PeriodicMismatchOptions& options)
      : data_(std::move(data)),
        reading_(reading),
        options_(options),
        hypotheses_(std::move(family), positions_of(data_)) {
    start_ = hypotheses_.family().start_values();
    faults_ = find_channel_faults(compared_responses(hypotheses_.family(), data_, start_));
    if (!faults_.empty()) return;
    telling_ = telling_recordings(hypotheses_.family(), data_, start_, hypotheses_.base_laws(),
                                  options_.threads);
  }

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override {
    return hypotheses_.list();
  }
  [[nodiscard]] double sample_count() const override { return data_.numbers_in(data_.estimation); }
  [[nodiscard]] bool noise_is_known() const override { return true; }

  [[nodiscard]] std::vector<ChannelFault> channel_faults() const override { return faults_; }

  // Fits the model as it is to recordings freed of their transients by polynomials, then frees them
  // with the fitted model, until the fit no longer moves. What is between the lines is a hundredth
  // of what is on them or less, and so is what the wrong model's response does to it: a tenth of
  // the noise at most up to the misfit below. Beyond, polynomials do less harm.
  void clear_transients() {
    if (data_.estimation.front().output_bins.size() == 0 || !faults_.empty()) return;
    first_ = first_fit(hypotheses_.base_laws());
    if (!first_->converged || !can_clear_with(report(*first_, {}))) return;
    if (is_doubtful(*first_)) look_across_the_least_determined(*first_);
    clear_with(*first_);
  }

  // Where clear_transients() could not; and where the fit leaves more than noise, and has laws
  // found that make of the free motion what the model without them could not take out.
  [[nodiscard]] std::unique_ptr<MismatchProblem> renewed(const ExtendedFit& fit) const override {
    if (data_.estimation.front().output_bins.size() == 0 || !can_clear_with(fit)) return nullptr;
    const ModelState model = state_of(fit);
    const std::span<const ActingLaw> found =
        std::span(model.laws).subspan(hypotheses_.base_laws().size());
    if (cleared_start_ &&
        !(leaves_more_than_noise(fit) && std::ranges::any_of(found, bends_free_motion))) {
      return nullptr;
    }
    PeriodicFit near;
    near.parameters = model.parameters;
    near.laws = model.laws;
    auto problem = std::make_unique<PeriodicProblem>(*this);
    problem->freed_fits_.clear();
    problem->predictions_.clear();
    problem->clear_with(near);
    // A law that is not there may leave more between the lines, and pass that for noise.
    constexpr double kMoreNoise = 0.01;
    const bool is_noisier =
        cleared_start_ && noise_level(problem->data_) > noise_level(data_) + kMoreNoise;
    return is_noisier ? nullptr : std::move(problem);
  }

  [[nodiscard]] PeriodicFitOptions how_to_fit() const {
    PeriodicFitOptions how;
    how.iteration_limit = options_.iteration_limit;
    how.threads = options_.threads;
    how.keep_going = options_.keep_going;
    how.telling = telling_;
    return how;
  }

  // From those that the measured responses suggest and the model's own values.
  [[nodiscard]] PeriodicFit first_fit(const std::vector<ActingLaw>& acting) const {
    std::vector<VectorXd> starts = response_starts(hypotheses_.family(), data_, options_.threads);
    starts.push_back(start_);
    return fit_periodic_gradually(hypotheses_.family(), data_, starts, acting, how_to_fit());
  }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> laws,
                                const ExtendedFit* nearby) const override {
    if (!lacks_parameters(nearby)) return fits().fit_from(data_, how_to_fit(), laws, *nearby);
    if (laws.empty() && cleared_start_) {
      return report(fit_periodic(hypotheses_.family(), data_, {*cleared_start_},
                                 hypotheses_.base_laws(), how_to_fit()),
                    laws);
    }
    return report(first_ && laws.empty() ? *first_ : first_fit(hypotheses_.with_base_laws(laws)),
                  laws);
  }

  // Where these save most of the time, and are enough to tell laws apart.
  [[nodiscard]] bool has_few() const override {
    constexpr std::size_t kTimesFewer = 3, kFewest = 10;
    return telling_.size() >= kFewest && kTimesFewer * telling_.size() <= data_.estimation.size();
  }

  [[nodiscard]] std::optional<ExtendedFit> fit_to_few(std::span<const LawStart> laws,
                                                      const ExtendedFit& nearby) const override {
    if (!has_few() || lacks_parameters(&nearby)) return {};
    const PeriodicData few = with_records(data_, telling_);
    PeriodicFitOptions how = how_to_fit();
    how.telling.resize(few.estimation.size());
    std::iota(how.telling.begin(), how.telling.end(), std::size_t{0});  // all of them
    return fits().fit_from(few, how, laws, nearby);
  }

  [[nodiscard]] ScoreTable scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                  int null_draws, std::uint64_t seed) const override {
    std::vector<HypotheticalLaw> laws;
    for (const std::size_t hypothesis : asked) {
      laws.push_back({hypothesis, hypotheses_.place(hypothesis), hypotheses_.entry(hypothesis)});
    }
    return score_candidates(hypotheses_.family(), data_, state_of(fit), laws,
                            {.follows_data = is_clearly_wrong(fit),
                             .null_draws = null_draws,
                             .seed = seed,
                             .deviance = fit.deviance,
                             .threads = options_.threads});
  }

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& fit) const override {
    return mismatch_map(hypotheses_.family(), data_, state_of(fit), options_.threads);
  }

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    return assess_records(hypotheses_.family(), data_, state_of(fit), data_.validation, 0,
                          options_.threads);
  }

  [[nodiscard]] std::optional<HeldOutPrediction> predict_held_out(
      const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    const VectorXd values = values_of(fit);
    std::vector<std::size_t> laws;
    for (const FittedLaw& law : fit.laws) laws.push_back(law.hypothesis);
    for (const KnownPrediction& known : predictions_) {
      if (known.laws == laws && known.values == values) return known.prediction;
    }
    predictions_.push_back({laws, values,
                            graybox::predict_held_out(hypotheses_.family(), data_, state_of(fit),
                                                      values, options_.threads)});
    return predictions_.back().prediction;
  }

  // Laws that were not there when recordings were freed of their free motion change that: where a
  // change is seen, they are freed once more with them, and it must still be there.
  [[nodiscard]] std::optional<TimeVariation> time_variation(const ExtendedFit& fit,
                                                            double gain) const override {
    const ModelState model = state_of(fit);
    const Assessment& rest = fit.estimation;
    const double left =
        leaves_more_than_noise(fit) ? rest.chi_square - rest.degrees_of_freedom : 0.0;
    const auto find_in = [&](const PeriodicData& data) {
      return find_time_variation(hypotheses_.family(), data, model, hypotheses_.base_laws().size(),
                                 gain, left, options_.threads);
    };
    constexpr double kPlain = 0.05;
    std::optional<TimeVariation> found = find_in(data_);
    if (!found || found->p_value > kPlain || fit.laws.empty() || !can_clear_with(fit)) return found;
    PeriodicData again = data_;
    graybox::clear_transients(hypotheses_.family(), model, reading_, again);
    return find_in(again);
  }

  [[nodiscard]] PhysicalContext physical_context(const ExtendedFit& fit) const override {
    PhysicalContext context;
    for (const ModelParameter& parameter : hypotheses_.family().parameters()) {
      context.starts.push_back(parameter.positive ? parameter.start
                                                  : std::numeric_limits<double>::quiet_NaN());
    }
    const ModelState model = state_of(fit);
    const LinearPlant& plant = model.positions.front().plant;
    const std::vector<ForcePicture> pictures =
        law_pictures(hypotheses_.family(), data_, model, hypotheses_.base_laws().size());
    for (std::size_t l = 0; l < fit.laws.size(); ++l) {
      const Location& place = hypotheses_.place(fit.laws[l].hypothesis)->location;
      PhysicalContext::OfLaw& own = context.laws.emplace_back();
      // A force that follows the motion elsewhere may well feed energy in.
      if (place.kind != LocationKind::kElement || place.is_flange || place.input != place.output) {
        continue;
      }
      own.stiffness = removable(plant.stiffness, place.output);
      // Gravity may hold what no spring does.
      if (own.stiffness == 0.0 && place.units.deflection == "rad") {
        own.stiffness = PhysicalQuantity::kNone;
      }
      own.damping = removable(plant.damping, place.output);
      own.inertia = removable(plant.mass, place.output);
      own.trace.deflection = pictures[l].deflection;
      own.trace.rate = pictures[l].rate;
      own.trace.force = pictures[l].law_force;
      own.trace.carried = largest_of(own.trace.force);
    }
    return context;
  }

  [[nodiscard]] CheckedRange checked_range() const override {
    return range_of(data_, data_.validation.empty() ? data_.estimation : data_.validation,
                    !data_.validation.empty());
  }

  [[nodiscard]] std::vector<ForcePicture> force_pictures(const ExtendedFit& fit) const override {
    std::vector<ForcePicture> pictures =
        law_pictures(hypotheses_.family(), data_, state_of(fit), hypotheses_.base_laws().size());
    for (std::size_t l = 0; l < pictures.size(); ++l) {
      pictures[l].hypothesis = fit.laws[l].hypothesis;
    }
    return pictures;
  }

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    return residual_spectra(hypotheses_.family(), data_, state_of(fit));
  }

  [[nodiscard]] std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& a, const ExtendedFit& b) const override {
    return rival_experiments(hypotheses_.family(), data_, state_of(a), state_of(b),
                             options_.threads);
  }

 private:
  [[nodiscard]] bool lacks_parameters(const ExtendedFit* nearby) const {
    return nearby == nullptr ||
           nearby->model_parameters.size() != hypotheses_.model_parameter_count();
  }

  void clear_with(const PeriodicFit& fit) {
    constexpr double kAtRest = 0.1;  // standard errors
    cleared_start_ =
        fit_and_clear_transients(hypotheses_.family(), fit, reading_, how_to_fit(), kAtRest, data_)
            .fit.parameters;
  }

  // Far worse on recordings kept out than on its own: it may be in a valley that its recordings
  // hardly tell from the right one, with a parameter far off. Whatever the errors of its parameters
  // do there: in such valleys they are large.
  [[nodiscard]] bool is_doubtful(const PeriodicFit& fit) const {
    constexpr double kDoubt = 3.0;
    if (data_.validation.empty()) return false;
    const ExtendedFit reported = report(fit, {});
    return validate(reported)->chi_square_per_dof() >
           kDoubt * std::max(1.0, reported.estimation.chi_square_per_dof());
  }

  // Begins again with other values, from half to twice what the model says, of the parameter with
  // the largest relative error (those of combinations that the data do not see have none). Whether
  // one is better its own recordings decide.
  void look_across_the_least_determined(PeriodicFit& fit) const {
    constexpr int kValues = 13;
    const std::optional<Index> least = least_determined(hypotheses_.family(), fit);
    const VectorXd middle = fit.parameters;
    for (int i = 0; least && i < kValues; ++i) {
      VectorXd start = middle;
      start(*least) = start_(*least) * std::exp2(2.0 * i / (kValues - 1.0) - 1.0);
      PeriodicFit other =
          fit_periodic(hypotheses_.family(), data_, {start}, fit.laws, how_to_fit());
      if (!other.converged || other.chi_square >= fit.chi_square) continue;
      other.start = fit.start;
      fit = std::move(other);
    }
  }

  [[nodiscard]] PeriodicLawFits fits() const {
    return {hypotheses_, data_, how_to_fit(), start_, first_, freed_fits_};
  }

  [[nodiscard]] ModelState state_of(const ExtendedFit& fit) const {
    VectorXd parameters = start_;
    std::vector<ActingLaw> laws = hypotheses_.laws_of(fit);
    hypotheses_.take_model_parameters(fit, parameters, laws);
    return evaluate_model(hypotheses_.family(), data_, parameters, std::move(laws), true,
                          options_.threads);
  }

  [[nodiscard]] ExtendedFit report(const PeriodicFit& fitted,
                                   std::span<const LawStart> laws) const {
    return assessed(hypotheses_, data_, data_, fitted, laws, options_.threads);
  }

  PeriodicData data_;
  PeriodicDataOptions reading_;
  PeriodicMismatchOptions options_;
  PeriodicHypotheses hypotheses_;
  VectorXd start_;
  std::vector<ChannelFault> faults_;
  mutable std::deque<FreedFit> freed_fits_;
  struct KnownPrediction {
    std::vector<std::size_t> laws;  // hypotheses
    VectorXd values;
    HeldOutPrediction prediction;
  };
  mutable std::deque<KnownPrediction> predictions_;
  std::vector<std::size_t> telling_;       // telling_recordings() at the start
  std::optional<PeriodicFit> first_;       // of the model as it is, transients not cleared with it
  std::optional<VectorXd> cleared_start_;  // that the transients were cleared with
};

}  // namespace

std::unique_ptr<MismatchProblem> periodic_mismatch_problem(const std::filesystem::path& model,
                                                           const Campaign& campaign,
                                                           const PeriodicMismatchOptions& options) {
  std::unique_ptr<PlantFamily> family = plant_family(model, options.place_files);
  PeriodicDataOptions reading;
  reading.line_factor = options.line_factor;
  reading.model_accuracy = options.model_accuracy;
  reading.threads = options.threads;
  PeriodicData data = read_periodic_data(campaign, *family, reading);
  auto problem =
      std::make_unique<PeriodicProblem>(std::move(family), std::move(data), reading, options);
  problem->clear_transients();
  return problem;
}

}  // namespace graybox
