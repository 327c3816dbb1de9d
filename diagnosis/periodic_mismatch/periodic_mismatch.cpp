#include "graybox/diagnosis/periodic_mismatch/periodic_mismatch.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "graybox/diagnosis/periodic_mismatch/candidate_products.hpp"
#include "graybox/diagnosis/periodic_mismatch/cleared_fit.hpp"
#include "graybox/diagnosis/periodic_mismatch/compared_responses.hpp"
#include "graybox/diagnosis/periodic_mismatch/gradual_fit.hpp"
#include "graybox/diagnosis/periodic_mismatch/noise_whitening.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_fit.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_shapes.hpp"
#include "graybox/diagnosis/periodic_mismatch/place_observer.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"
#include "graybox/diagnosis/periodic_mismatch/real_products.hpp"
#include "graybox/diagnosis/periodic_mismatch/residual_spectra.hpp"
#include "graybox/diagnosis/periodic_mismatch/response_starts.hpp"
#include "graybox/diagnosis/periodic_mismatch/rival_experiments.hpp"
#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"
#include "graybox/diagnosis/periodic_mismatch/telling_recordings.hpp"
#include "graybox/diagnosis/periodic_mismatch/time_variation.hpp"
#include "graybox/diagnosis/periodic_mismatch/transients.hpp"
#include "graybox/problems/distributions.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/frequency_response.hpp"
#include "graybox/problems/random.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

// Information^+ scores, parameters scaled alike.
MatrixXd solved(const MatrixXd& information, const MatrixXd& scores) {
  const VectorXd unit = information.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  const MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  return unit.asDiagonal() *
         scaled.completeOrthogonalDecomposition().solve(unit.asDiagonal() * scores);
}

class Problem : public MismatchProblem {
 public:
  Problem(std::shared_ptr<const PlantFamily> family, PeriodicData data,
          const PeriodicDataOptions& reading, const PeriodicMismatchOptions& options)
      : family_(std::move(family)), data_(std::move(data)), reading_(reading), options_(options) {
    list_base_laws();
    list_hypotheses();
    start_ = family_->start_values();
    faults_ = find_channel_faults(compared_responses(*family_, data_, start_));
    if (!faults_.empty()) return;
    telling_ = telling_recordings(*family_, data_, start_, base_laws_, options_.threads);
  }

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override { return hypotheses_; }
  [[nodiscard]] double sample_count() const override { return data_.numbers_in(data_.estimation); }
  [[nodiscard]] bool noise_is_known() const override { return true; }

  [[nodiscard]] std::vector<ChannelFault> channel_faults() const override { return faults_; }

  // Fits the model as it is to recordings freed of their transients by polynomials, then frees them with
  // the fitted model, until the fit no longer moves. What is between the lines is a hundredth of what is on
  // them or less, and so is what the wrong model's response does to it: a tenth of the noise at most up to
  // the misfit below. Beyond, polynomials do less harm.
  void clear_transients() {
    if (data_.estimation.front().output_bins.size() == 0 || !faults_.empty()) return;
    first_ = first_fit(base_laws_);
    if (!first_->converged || !can_clear_with(report(data_, *first_, {}))) return;
    if (is_doubtful(*first_)) look_across_the_least_determined(*first_);
    clear_with(*first_);
  }

  // Where clear_transients() could not; and where the fit leaves more than noise, and has laws found that
  // make of the free motion what the model without them could not take out.
  [[nodiscard]] std::unique_ptr<MismatchProblem> renewed(const ExtendedFit& fit) const override {
    if (data_.estimation.front().output_bins.size() == 0 || !can_clear_with(fit)) return nullptr;
    const ModelState model = state_of(fit);
    const std::span<const ActingLaw> found = std::span(model.laws).subspan(base_laws_.size());
    if (cleared_start_ &&
        !(leaves_more_than_noise(fit) && std::ranges::any_of(found, bends_free_motion))) {
      return nullptr;
    }
    PeriodicFit near;
    near.parameters = model.parameters;
    near.laws = model.laws;
    auto problem = std::make_unique<Problem>(*this);
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
    std::vector<VectorXd> starts = response_starts(*family_, data_, options_.threads);
    starts.push_back(start_);
    return fit_periodic_gradually(*family_, data_, starts, acting, how_to_fit());
  }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> laws,
                                const ExtendedFit* nearby) const override {
    if (!lacks_parameters(nearby)) return fit_from(data_, how_to_fit(), laws, *nearby);
    if (laws.empty() && cleared_start_) {
      return report(
          data_, fit_periodic(*family_, data_, {*cleared_start_}, base_laws_, how_to_fit()), laws);
    }
    return report(data_, first_ && laws.empty() ? *first_ : first_fit(with_base_laws(laws)), laws);
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
    return fit_from(few, how, laws, nearby);
  }

  [[nodiscard]] ScoreTable scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                  int null_draws, std::uint64_t seed) const override;

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& fit) const override;

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    const ModelState model = state_of(fit);
    return assess(model, data_.validation, 0);
  }

  // With C the parameters' covariance, residuals r with derivatives J have the covariance 1 + J C J^T:
  //   chi^2 = r^T r - b^T (C^-1 + J^T J)^-1 b,   b = J^T r,
  //   log det(1 + J C J^T) = log det(C^-1 + J^T J) - log det C^-1.
  [[nodiscard]] std::optional<HeldOutPrediction> predict_held_out(
      const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    const VectorXd values = values_of(fit);
    std::vector<std::size_t> laws;
    for (const FittedLaw& law : fit.laws) laws.push_back(law.hypothesis);
    for (const KnownPrediction& known : predictions_) {
      if (known.laws == laws && known.values == values) return known.prediction;
    }
    predictions_.push_back({laws, values, predict(state_of(fit), values)});
    return predictions_.back().prediction;
  }

  // Laws that were not there when recordings were freed of their free motion change that: where a change is
  // seen, they are freed once more with them, and it must still be there.
  [[nodiscard]] std::optional<TimeVariation> time_variation(const ExtendedFit& fit,
                                                            double gain) const override {
    const ModelState model = state_of(fit);
    const Assessment& rest = fit.estimation;
    const double left =
        leaves_more_than_noise(fit) ? rest.chi_square - rest.degrees_of_freedom : 0.0;
    std::optional<TimeVariation> found = time_variation_in(data_, model, gain, left);
    if (!found || found->p_value > kPlain || fit.laws.empty() || !can_clear_with(fit)) return found;
    PeriodicData again = data_;
    graybox::clear_transients(*family_, model, reading_, again);
    return time_variation_in(again, model, gain, left);
  }

  [[nodiscard]] std::vector<ForcePicture> force_pictures(const ExtendedFit& fit) const override;

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    return residual_spectra(*family_, data_, state_of(fit));
  }

  [[nodiscard]] std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& a, const ExtendedFit& b) const override {
    return rival_experiments(*family_, data_, state_of(a), state_of(b), options_.threads);
  }

 private:
  // `values`: of all parameters.
  [[nodiscard]] HeldOutPrediction predict(const ModelState& model, const VectorXd& values) const {
    const Linearised fitted = linearised(model, data_.estimation);
    const Linearised held_out = linearised(model, data_.validation);
    const MatrixXd all = fitted.information + held_out.information;
    const double numbers = data_.numbers_in(data_.validation);
    const double unexplained =
        held_out.chi_square - held_out.scores.dot(solved(all, held_out.scores).col(0));
    HeldOutPrediction prediction{judged(data_.validation, unexplained, numbers), {}};
    const double scale = prediction.within_errors.degrees_of_freedom / numbers;
    prediction.cost = prediction.within_errors.chi_square / scale + log_determinant(all, values) -
                      log_determinant(fitted.information, values);
    // A force that no number describes where it was not fitted.
    if (!std::isfinite(*prediction.cost)) {
      prediction.cost = std::numeric_limits<double>::infinity();
    }
    return prediction;
  }

  // Far worse on recordings kept out than on its own: it may be in a valley that its recordings hardly tell from the
  // right one, with a parameter far off. Whatever the errors of its parameters do there: in such valleys they are large.
  [[nodiscard]] bool is_doubtful(const PeriodicFit& fit) const {
    constexpr double kDoubt = 3.0;
    if (data_.validation.empty()) return false;
    const ExtendedFit reported = report(data_, fit, {});
    return validate(reported)->chi_square_per_dof() >
           kDoubt * std::max(1.0, reported.estimation.chi_square_per_dof());
  }

  // Begins again with other values, from half to twice what the model says, of the parameter with the largest relative
  // error (those of combinations that the data do not see have none). Whether one is better its own recordings decide.
  void look_across_the_least_determined(PeriodicFit& fit) const {
    constexpr int kValues = 13;
    const std::optional<Index> least = least_determined(fit);
    const VectorXd middle = fit.parameters;
    for (int i = 0; least && i < kValues; ++i) {
      VectorXd start = middle;
      start(*least) = start_(*least) * std::exp2(2.0 * i / (kValues - 1.0) - 1.0);
      PeriodicFit other = fit_periodic(*family_, data_, {start}, fit.laws, how_to_fit());
      if (!other.converged || other.chi_square >= fit.chi_square) continue;
      other.start = fit.start;
      fit = std::move(other);
    }
  }

  [[nodiscard]] std::optional<Index> least_determined(const PeriodicFit& fit) const {
    const VectorXd errors = standard_errors(fit.information);
    std::optional<Index> least;
    double largest = 0.0;
    for (Index p = 0; p < fit.parameters.size(); ++p) {
      const double error = errors(p) / std::abs(fit.parameters(p));
      if (!family_->parameters()[at(p)].positive || !(error > largest)) continue;
      least = p;
      largest = error;
    }
    return least;
  }

  // From the parameters of the fit nearby and those that the ranking found for the law, the best of them.
  [[nodiscard]] ExtendedFit fit_from(const PeriodicData& data, const PeriodicFitOptions& how,
                                     std::span<const LawStart> laws,
                                     const ExtendedFit& nearby) const {
    VectorXd start = start_;
    std::vector<ActingLaw> acting = with_base_laws(laws);
    take_model_parameters(nearby, start, acting);
    std::vector<VectorXd> starts{start};
    if (!laws.empty() && !laws.back().model_parameters.empty()) {
      const std::vector<double>& other = laws.back().model_parameters;
      starts.emplace_back(Eigen::Map<const VectorXd>(other.data(), start_.size()));
    }
    PeriodicFit best = fit_periodic(*family_, data, starts, acting, how);
    if (!laws.empty()) begin_elsewhere(data, how, starts, acting, laws.back(), best);
    ExtendedFit result = report(data, best, laws);
    // A model alone that is far off has its parameters far off, and its valleys need not be those of the law.
    const bool is_near = result.usable && can_clear_with(result);
    if (laws.empty() || !first_ || can_clear_with(nearby) || is_near) return result;
    std::vector<VectorXd> early{start_};
    if (first_->start.size() > 0) early.push_back(first_->start);
    const PeriodicFit afresh = can_free(data, acting.back())
                                   ? fit_from_freed(data, how, early, acting)
                                   : fit_periodic_if_near(*family_, data, early, acting, how);
    const bool is_better =
        afresh.converged && (!best.converged || afresh.chi_square < best.chi_square);
    return is_better ? report(data, afresh, laws) : result;
  }

  // At all the last law's other valleys, and at its spare starts until one leads to a steady state.
  void begin_elsewhere(const PeriodicData& data, const PeriodicFitOptions& how,
                       const std::vector<VectorXd>& starts, std::vector<ActingLaw> acting,
                       const LawStart& law, PeriodicFit& best) const {
    const auto take_if_better = [&](const std::vector<double>& parameters) {
      acting.back().parameters = parameters;
      PeriodicFit fit = fit_periodic(*family_, data, starts, acting, how);
      const bool is_better = fit.converged && (!best.converged || fit.chi_square < best.chi_square);
      if (is_better) best = std::move(fit);
    };
    std::ranges::for_each(law.others, take_if_better);
    for (const std::vector<double>& spare : law.spares) {
      if (best.has_steady_state) break;
      take_if_better(spare);
    }
  }

  [[nodiscard]] PeriodicFit fit_from_freed(const PeriodicData& data, const PeriodicFitOptions& how,
                                           const std::vector<VectorXd>& early,
                                           const std::vector<ActingLaw>& laws) const {
    const PeriodicFit& freed = freed_at(*laws.back().place, {laws.begin(), laws.end() - 1}, early);
    if (!freed.converged) return freed;
    return fit_periodic_after_freed(*family_, data, freed, laws.back(), how);
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
        {&place, others, freed_fit(*family_, data_, early, others, place.location, how_to_fit())});
    return freed_fits_.back().fit;
  }

  [[nodiscard]] bool lacks_parameters(const ExtendedFit* nearby) const {
    return nearby == nullptr || nearby->model_parameters.size() != model_parameter_count();
  }

  [[nodiscard]] std::vector<ActingLaw> with_base_laws(std::span<const LawStart> laws) const {
    std::vector<ActingLaw> acting = base_laws_;
    for (const LawStart& law : laws) {
      acting.push_back({places_[law.hypothesis], entries_[law.hypothesis], law.parameters, {}});
    }
    return acting;
  }

  [[nodiscard]] static bool can_clear_with(const ExtendedFit& fit) {
    constexpr double kMisfit = 100.0;
    return fit.estimation.chi_square_per_dof() <= kMisfit;
  }

  [[nodiscard]] static bool leaves_more_than_noise(const ExtendedFit& fit) {
    constexpr double kNoNoise = 0.01;
    const Assessment& rest = fit.estimation;
    return chi_square_tail(rest.chi_square, rest.degrees_of_freedom) < kNoNoise;
  }

  // Beyond what a model without it takes out.
  [[nodiscard]] static bool bends_free_motion(const ActingLaw& law) {
    return law.place->location.kind == LocationKind::kElement &&
           (law.entry->name == "mode" || has_varying_slopes(law));
  }

  // Mean logarithm of the standard deviations of lines, up to a constant.
  [[nodiscard]] static double noise_level(const PeriodicData& data) {
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

  // Forces with slopes that vary.
  [[nodiscard]] static bool has_varying_slopes(const ActingLaw& law) {
    if (is_body(*law.place, *law.entry) || law.entry->name == "offset") return false;
    return !PeriodicLaw(*law.entry, law.parameters).is_linear();
  }

  void clear_with(const PeriodicFit& fit) {
    constexpr double kAtRest = 0.1;  // standard errors
    cleared_start_ = fit_and_clear_transients(*family_, fit, reading_, how_to_fit(), kAtRest, data_)
                         .fit.parameters;
  }

  static constexpr double kPlain = 0.05;
  static constexpr double kShareOfFree = 0.1;  // that laws may make of the free motion

  [[nodiscard]] std::optional<TimeVariation> time_variation_in(const PeriodicData& data,
                                                               const ModelState& model, double gain,
                                                               double left) const {
    const std::vector<VariationScore> scores =
        variation_scores(*family_, data, model, options_.threads);
    const auto beyond = [](const VariationScore& score) {
      return score.statistic - score.degrees_of_freedom;
    };
    const auto best = std::ranges::max_element(scores, {}, beyond);
    if (best == scores.end() || !(best->degrees_of_freedom > 0.0)) return {};
    if (beyond(*best) < made_of_free_motion(model, best->free_power, gain, left)) return {};
    TimeVariation result;
    result.place = best->place->location.name;
    result.coefficient = coefficient_name(best->coefficient);
    result.unit = unit_at(coefficient_unit(best->coefficient), best->place->location.units);
    result.p_value = std::min(1.0, static_cast<double>(scores.size()) *
                                       chi_square_tail(best->statistic, best->degrees_of_freedom));
    result.deviation = best->deviation;
    result.frequency = best->frequency;
    result.duration = best->duration;
    result.course = best->course;
    constexpr double kAsWell = 10.0;  // of chi-square
    for (const VariationScore& score : scores) {
      if (&score == &*best || beyond(score) < beyond(*best) - kAsWell) continue;
      result.alternatives.push_back(coefficient_name(score.coefficient) + " at " +
                                    score.place->location.name);
    }
    return result;
  }

  // The most that forces with slopes that vary make of the free motion: a share of it, and of what they do at
  // all. `left`: chi-square that no law explains, which may be such a force; of the model's own laws nothing is known.
  [[nodiscard]] double made_of_free_motion(const ModelState& model, double free_power, double gain,
                                           double left) const {
    if (std::ranges::any_of(base_laws_, has_varying_slopes)) return kShareOfFree * free_power;
    const double of_laws =
        std::ranges::any_of(model.laws, has_varying_slopes) ? std::max(gain, 0.0) : 0.0;
    return kShareOfFree * std::min(free_power, of_laws + left);
  }

  static std::string coefficient_name(Coefficient coefficient) {
    switch (coefficient) {
      case Coefficient::kStiffness:
        return "stiffness";
      case Coefficient::kDamping:
        return "damping";
      case Coefficient::kGain:
        break;
    }
    return "gain";
  }
  static std::string coefficient_unit(Coefficient coefficient) {
    switch (coefficient) {
      case Coefficient::kStiffness:
        return "F/x";
      case Coefficient::kDamping:
        return "F s/x";
      case Coefficient::kGain:
        break;
    }
    return "1";
  }

  static constexpr int kChunks = 8;  // of recordings, whose sums are added in order

  void list_base_laws() {
    const std::vector<Element>& elements = family_->elements();
    base_places_ = std::make_shared<std::vector<CandidatePlace>>(elements.size());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      CandidatePlace& place = (*base_places_)[e];
      place.location = elements[e].location;
      place.shifts_rest = family_->shifts_rest(elements[e].location);
      const bool is_signal = elements[e].location.kind != LocationKind::kElement;
      base_laws_.push_back({&place, find_law(elements[e].law_name, is_signal),
                            elements[e].parameters, elements[e].fixed});
      base_names_.push_back(elements[e].name);
    }
  }

  void list_hypotheses() {
    std::set<std::size_t> positions;
    for (const MeasuredRecord& record : data_.estimation) positions.insert(record.position);
    for (const CandidatePlace& place : family_->places()) {
      for (const LawEntry* entry : hypothetical_laws(place, positions.size())) {
        add_hypothesis(place, *entry);
        const LawEntry* twin = twin_of(*entry, place, positions.size());
        if (twin == nullptr) continue;
        hypotheses_.back().twins = {hypotheses_.size()};
        add_hypothesis(place, *twin);
        hypotheses_.back().only_named = true;
      }
    }
  }

  void add_hypothesis(const CandidatePlace& place, const LawEntry& entry) {
    hypotheses_.push_back(
        {place.location.name, place.yaml, entry.name, special_cases_of(entry, true)});
    hypotheses_.back().characteristic = characteristic_of(entry, place);
    places_.push_back(&place);
    entries_.push_back(&entry);
  }

  [[nodiscard]] std::size_t model_parameter_count() const {
    std::size_t count = family_->parameters().size();
    for (const ActingLaw& law : base_laws_) count += law.parameters.size();
    return count;
  }

  void take_model_parameters(const ExtendedFit& fit, VectorXd& parameters,
                             std::vector<ActingLaw>& laws) const {
    std::size_t k = 0;
    for (double& value : parameters) value = fit.model_parameters[k++].value;
    for (std::size_t l = 0; l < base_laws_.size(); ++l) {
      for (double& value : laws[l].parameters) value = fit.model_parameters[k++].value;
    }
  }

  [[nodiscard]] ModelState state_of(const ExtendedFit& fit) const {
    VectorXd parameters = start_;
    std::vector<ActingLaw> laws = base_laws_;
    take_model_parameters(fit, parameters, laws);
    for (const FittedLaw& law : fit.laws) {
      ActingLaw& acting =
          laws.emplace_back(ActingLaw{places_[law.hypothesis], entries_[law.hypothesis], {}, {}});
      for (const LawParameterEstimate& estimate : law.parameters) {
        acting.parameters.push_back(estimate.value);
      }
    }
    return evaluate_model(*family_, data_, parameters, std::move(laws), true, options_.threads);
  }

  // Works through recordings in chunks that do not depend on the number of threads.
  template <typename Work>
  void for_each_record(const std::vector<MeasuredRecord>& records, const Work& work) const {
#pragma omp parallel num_threads(options_.threads)
    {
      SteadyStateSolver solver(*family_, data_, {});
#pragma omp for schedule(dynamic)
      for (int chunk = 0; chunk < kChunks; ++chunk) {
        const std::size_t first = records.size() * at(chunk) / kChunks;
        const std::size_t last = records.size() * (at(chunk) + 1) / kChunks;
        for (std::size_t i = first; i < last; ++i) work(solver, records[i], i, at(chunk));
      }
    }
  }

  // Scaled so that the chi-square test holds although the noise is an estimate itself.
  [[nodiscard]] Assessment judged(const std::vector<MeasuredRecord>& records, double chi_square,
                                  double degrees_of_freedom) const {
    Assessment result;
    result.degrees_of_freedom = effective_degrees_of_freedom(data_, records, degrees_of_freedom);
    result.chi_square = chi_square * result.degrees_of_freedom / degrees_of_freedom;
    return result;
  }

  [[nodiscard]] Assessment assess(const ModelState& model,
                                  const std::vector<MeasuredRecord>& records,
                                  std::size_t parameters) const {
    const auto outputs = static_cast<Index>(data_.outputs.size());
    std::vector<double> chi_square(records.size());
    std::vector<VectorXd> error(records.size()), signal(records.size());
    for_each_record(records, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                 std::size_t i, std::size_t) {
      const SteadyState& state = solver.solve(model, record, nullptr);
      chi_square[i] = state.chi_square;
      const Index count = data_.line_count();
      error[i] = (record.output - state.output).rightCols(count).rowwise().squaredNorm();
      signal[i] = record.output.rightCols(count).rowwise().squaredNorm();
    });
    double sum = 0.0;
    VectorXd errors = VectorXd::Zero(outputs), signals = VectorXd::Zero(outputs);
    for (std::size_t i = 0; i < records.size(); ++i) {
      sum += chi_square[i];
      errors += error[i];
      signals += signal[i];
    }
    Assessment result =
        judged(records, sum, data_.numbers_in(records) - static_cast<double>(parameters));
    const double share = errors.cwiseQuotient(signals).mean();
    result.nrmse = 100.0 * std::sqrt(share);
    result.variance_accounted_for = 100.0 * (1.0 - share);
    return result;
  }

  // J^T J, J^T r and r^T r of all parameters over some recordings.
  struct Linearised {
    MatrixXd information;
    VectorXd scores;
    double chi_square = 0.0;
  };
  [[nodiscard]] Linearised linearised(const ModelState& model,
                                      const std::vector<MeasuredRecord>& records) const {
    std::vector<Linearised> sums(records.size());
    for_each_record(records, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                 std::size_t i, std::size_t) {
      const SteadyState& state = solver.solve(model, record, nullptr);
      VectorXcd residual = state.residual.reshaped();
      MatrixXcd jacobian;
      solver.differentiate(model, record, true, jacobian);
      record.decorrelate(residual);
      record.decorrelate(jacobian);
      sums[i] = {as_real(jacobian).transpose() * as_real(jacobian),
                 as_real(jacobian).transpose() * as_real(residual), state.chi_square};
    });
    Linearised total = sums.front();
    for (std::size_t i = 1; i < sums.size(); ++i) {
      total.information += sums[i].information;
      total.scores += sums[i].scores;
      total.chi_square += sums[i].chi_square;
    }
    return total;
  }

  // Of the model's parameters, then of the laws'.
  [[nodiscard]] static VectorXd values_of(const ExtendedFit& fit) {
    std::vector<double> values;
    for (const LawParameterEstimate& each : fit.model_parameters) values.push_back(each.value);
    for (const FittedLaw& law : fit.laws) {
      for (const LawParameterEstimate& each : law.parameters) values.push_back(each.value);
    }
    return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
  }

  // log det(1 + D S D), D the parameters' values: of information and a prior as wide as these, over the prior's.
  [[nodiscard]] static double log_determinant(const MatrixXd& information, const VectorXd& values) {
    if (values.size() == 0) return 0.0;
    const MatrixXd whole = values.asDiagonal() * information * values.asDiagonal();
    if (!whole.allFinite()) return std::numeric_limits<double>::infinity();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(whole, Eigen::EigenvaluesOnly);
    return eigen.eigenvalues().array().max(0.0).log1p().sum();
  }

  [[nodiscard]] ExtendedFit report(const PeriodicData& data, const PeriodicFit& fitted,
                                   std::span<const LawStart> laws) const {
    ExtendedFit result;
    result.usable = fitted.converged;
    result.trouble = fitted.trouble;
    if (fitted.parameters.size() == 0) return result;
    result.parameter_count = static_cast<std::size_t>(fitted.information.rows());
    const VectorXd errors = standard_errors(fitted.information);
    Index k = 0;
    for (const ModelParameter& parameter : family_->parameters()) {
      result.model_parameters.push_back(
          {parameter.name, parameter.unit, fitted.parameters(k), errors(k)});
      ++k;
    }
    for (std::size_t l = 0; l < fitted.laws.size(); ++l) {
      const ActingLaw& law = fitted.laws[l];
      const bool is_base = l < base_laws_.size();
      if (!is_base) result.laws.push_back({laws[l - base_laws_.size()].hypothesis, {}});
      for (std::size_t p = 0; p < law.parameters.size(); ++p, ++k) {
        LawParameterEstimate estimate = estimate_of(
            law.entry->parameters[p], law.place->location.units, law.parameters[p], errors(k));
        if (is_base) {  // whoever states a law knows its sizes
          estimate.name = base_names_[l] + "." + estimate.name;
          estimate.standard_error = errors(k);
          estimate.conditional_error = std::numeric_limits<double>::quiet_NaN();
          estimate.sets_scale = estimate.sets_scale && is_fixed(law, p);
        }
        if (is_fixed(law, p)) --result.parameter_count;
        (is_base ? result.model_parameters : result.laws.back().parameters).push_back(estimate);
      }
    }
    result.deviance = fitted.chi_square;
    result.laws_information = information_of_laws(fitted, result.model_parameters.size());
    result.estimation = assess(
        evaluate_model(*family_, data_, fitted.parameters, fitted.laws, false, options_.threads),
        data.estimation, result.parameter_count);
    return result;
  }

  // log det(1 + D S D) of the parameters after those of the model (ExtendedFit::laws_information).
  static double information_of_laws(const PeriodicFit& fitted, std::size_t model_parameters) {
    const auto own = static_cast<Index>(model_parameters);
    const Index count = fitted.information.rows() - own;
    if (count == 0) return 0.0;
    VectorXd values(count);
    Index k = -own;
    for (const double value : fitted.parameters) {
      if (k >= 0) values(k) = value;
      ++k;
    }
    for (const ActingLaw& law : fitted.laws) {
      for (const double value : law.parameters) {
        if (k >= 0) values(k) = value;
        ++k;
      }
    }
    MatrixXd information = fitted.information.bottomRightCorner(count, count);
    if (own > 0) {
      const MatrixXd cross = fitted.information.topRightCorner(own, count);
      information -= cross.transpose() * solved(fitted.information.topLeftCorner(own, own), cross);
    }
    return log_determinant(information, values);
  }

  // ---- scores --------------------------------------------------------------------------------------

  // Far beyond any level of detection, so that a motion that holds noise of the residuals is taken only
  // where tests of single hypotheses no longer decide whether anything is missing.
  static bool is_clearly_wrong(const ExtendedFit& fit) {
    constexpr double kLevel = 1e-6;
    return chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom) < kLevel;
  }

  [[nodiscard]] std::map<const CandidatePlace*, MotionScale> motion_scales(
      const ModelState& model, std::span<const std::size_t> asked, bool follows_data) const;
  [[nodiscard]] std::vector<Candidate> candidates(
      std::span<const std::size_t> asked,
      const std::map<const CandidatePlace*, MotionScale>& scales) const;
  [[nodiscard]] std::vector<std::vector<PlantChange>> body_changes(
      const ModelState& model, const std::vector<Candidate>& list) const;
  struct ShapeStart {
    double statistic = 0.0;
    int valley = -1;
    std::vector<double> parameters;
  };
  static std::vector<std::vector<double>> other_starts(std::vector<ShapeStart> starts,
                                                       const std::vector<double>& best);
  [[nodiscard]] std::vector<double> parameters_with(const ModelState& model, const BlockSums& own,
                                                    const MatrixXd& nuisance,
                                                    const VectorXd& amplitudes) const;

  // Shared with renewed problems, whose hypotheses point into it.
  std::shared_ptr<const PlantFamily> family_;
  PeriodicData data_;
  PeriodicDataOptions reading_;
  PeriodicMismatchOptions options_;
  VectorXd start_;
  std::vector<ChannelFault> faults_;
  struct FreedFit {
    const CandidatePlace* place;
    std::vector<ActingLaw> others;
    PeriodicFit fit;
  };
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
  std::shared_ptr<std::vector<CandidatePlace>> base_places_;
  std::vector<ActingLaw> base_laws_;
  std::vector<std::string> base_names_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const CandidatePlace*> places_;  // of each hypothesis
  std::vector<const LawEntry*> entries_;
};

std::map<const CandidatePlace*, MotionScale> Problem::motion_scales(
    const ModelState& model, std::span<const std::size_t> asked, bool follows_data) const {
  constexpr Index kSamples = 48;  // of each recording
  std::map<const CandidatePlace*, MotionScale> scales;
  for (const std::size_t hypothesis : asked) scales[places_[hypothesis]];
  std::vector<const CandidatePlace*> list;
  for (const auto& [place, scale] : scales) {
    if (!place->location.is_flange) list.push_back(place);
  }
  struct Values {
    VectorXd deflections, excursions, rates;
  };
  const std::size_t records = data_.estimation.size();
  std::vector<std::vector<Values>> values(records);  // of each place
  std::vector<std::vector<double>> ranges(records);
  for_each_record(data_.estimation, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                        std::size_t i, std::size_t) {
    solver.solve(model, record, nullptr);
    const PlaceObserver observer(solver, model, data_, follows_data);
    MatrixXcd answer;
    PeriodicMotion motion;
    for (const CandidatePlace* place : list) {
      answer_at(solver, model, record, place->location, answer);
      VectorXcd deflection = observer.observe(record, place->location, answer).deflection;
      if (place->location.kind == LocationKind::kActuator) {
        deflection(0) +=
            solver.static_scale() *
            model.positions[record.position].plant.holding_input(place->location.channel);
      }
      solver.motion_of(deflection, motion);
      const Index step = std::max<Index>(1, motion.deflection.size() / kSamples);
      const auto samples = Eigen::seq(0, motion.deflection.size() - 1, step);
      const VectorXd excursion = motion.deflection.array() - motion.deflection.mean();
      values[i].push_back({motion.deflection(samples).cwiseAbs(), excursion(samples).cwiseAbs(),
                           motion.rate(samples).cwiseAbs()});
      ranges[i].push_back(motion.deflection.maxCoeff() - motion.deflection.minCoeff());
    }
  });
  for (std::size_t p = 0; p < list.size(); ++p) {
    MotionScale& scale = scales[list[p]];
    for (std::size_t i = 0; i < records; ++i) {
      const auto& [deflections, excursions, rates] = values[i][p];
      scale.deflections.insert(scale.deflections.end(), deflections.begin(), deflections.end());
      scale.excursions.insert(scale.excursions.end(), excursions.begin(), excursions.end());
      scale.rates.insert(scale.rates.end(), rates.begin(), rates.end());
      scale.range = std::max(scale.range, ranges[i][p]);
    }
    std::ranges::sort(scale.deflections);
    std::ranges::sort(scale.excursions);
    std::ranges::sort(scale.rates);
  }
  return scales;
}

std::vector<Candidate> Problem::candidates(
    std::span<const std::size_t> asked,
    const std::map<const CandidatePlace*, MotionScale>& scales) const {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const FrequencyBand band{data_.frequencies[data_.excited.front()] / kTurn,
                           data_.frequencies[data_.excited.back()] / kTurn};
  std::vector<Candidate> list;
  std::size_t column = 0;
  for (const std::size_t hypothesis : asked) {
    Candidate candidate{hypothesis, places_[hypothesis], entries_[hypothesis], {}, column, 0};
    if (!list.empty()) {
      const Candidate& last = list.back();
      const bool is_same =
          last.place == candidate.place &&
          is_body(*last.place, *last.entry) == is_body(*candidate.place, *candidate.entry) &&
          may_follow_data(*last.entry) == may_follow_data(*candidate.entry);
      candidate.block = last.block + (is_same ? 0 : 1);
    }
    candidate.shapes =
        periodic_shapes(*candidate.entry, *candidate.place, scales.at(candidate.place), band);
    for (const LawShape& shape : candidate.shapes) column += shape.basis.size();
    list.push_back(std::move(candidate));
  }
  return list;
}

// [position][column of body laws, in the candidates' order]
std::vector<std::vector<PlantChange>> Problem::body_changes(
    const ModelState& model, const std::vector<Candidate>& list) const {
  std::vector<std::vector<PlantChange>> changes(data_.positions.size());
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const LinearPlant& plain = model.positions[i].plant;
    for (const Candidate& candidate : list) {
      if (!is_body(*candidate.place, *candidate.entry)) continue;
      for (const LawShape& shape : candidate.shapes) {
        std::vector<Element> bodies = model.bodies;
        Element& body = bodies.emplace_back();
        body.location = candidate.place->location;
        body.law_name = candidate.entry->name;
        body.use = candidate.entry->use;
        body.parameters = shape.basis.front();
        // The change is linear in the amplitude.
        const double small = 10.0 * small_change(plain, body, 1.0);
        body.parameters.front() *= small;
        const LinearPlant changed = family_->plant(data_.positions[i], model.parameters, bodies);
        changes[i].push_back(entries_of({(changed.mass - plain.mass) / small,
                                         {},
                                         (changed.stiffness - plain.stiffness) / small,
                                         (changed.rest - plain.rest) / small}));
      }
    }
  }
  return changes;
}

// The plant's parameters that go with these amplitudes, kept positive where they must be.
std::vector<double> Problem::parameters_with(const ModelState& model, const BlockSums& own,
                                             const MatrixXd& nuisance,
                                             const VectorXd& amplitudes) const {
  const VectorXd change = solved(own.information, own.scores - nuisance.transpose() * amplitudes);
  std::vector<double> values;
  for (std::size_t p = 0; p < family_->parameters().size(); ++p) {
    const double now = model.parameters(static_cast<Index>(p));
    const double then = now + change(static_cast<Index>(p));
    values.push_back(family_->parameters()[p].positive ? std::clamp(then, 0.5 * now, 2.0 * now)
                                                       : then);
  }
  return values;
}

// The best few besides, each of another valley.
std::vector<std::vector<double>> Problem::other_starts(std::vector<ShapeStart> starts,
                                                       const std::vector<double>& best) {
  constexpr std::size_t kOthers = 7;
  std::ranges::stable_sort(starts, std::greater{}, &ShapeStart::statistic);
  std::set<int> valleys;
  for (const ShapeStart& start : starts) {
    if (start.parameters == best && start.valley >= 0) valleys.insert(start.valley);
  }
  std::vector<std::vector<double>> others;
  for (ShapeStart& start : starts) {
    const bool is_new =
        start.valley < 0 ? start.parameters != best : valleys.insert(start.valley).second;
    if (is_new && others.size() < kOthers) others.push_back(std::move(start.parameters));
  }
  return others;
}

ScoreTable Problem::scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                           int null_draws, std::uint64_t seed) const {
  const ModelState model = state_of(fit);
  const bool follows_data = is_clearly_wrong(fit);
  const std::vector<Candidate> list = candidates(asked, motion_scales(model, asked, follows_data));
  const auto bodies = body_changes(model, list);
  CandidateSums empty;
  Index columns = 0;
  for (const Candidate& candidate : list) {
    for (const LawShape& shape : candidate.shapes) {
      const auto size = static_cast<Index>(shape.basis.size());
      empty.information.push_back(MatrixXd::Zero(size, size));
      columns += size;
    }
  }
  auto parameters = static_cast<Index>(family_->parameters().size());
  for (const ActingLaw& law : model.laws) parameters += static_cast<Index>(law.parameters.size());
  empty.scores = MatrixXd::Zero(columns, 1 + null_draws);
  empty.nuisance = empty.moved_nuisance = MatrixXd::Zero(columns, parameters);
  const std::size_t blocks = list.empty() ? 0 : list.back().block + 1;
  empty.blocks.assign(blocks, {MatrixXd::Zero(parameters, parameters), VectorXd::Zero(parameters)});
  empty.own_information = MatrixXd::Zero(parameters, parameters);
  empty.own_scores = MatrixXd::Zero(parameters, 1 + null_draws);
  std::vector<CandidateSums> sums(kChunks, empty);
  for_each_record(data_.estimation, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                        std::size_t i, std::size_t chunk) {
    solver.solve(model, record, nullptr);
    NoiseDraws draws(data_, record.group, null_draws, seed, i);
    add_products(*family_, data_, model, solver, record, follows_data, list,
                 bodies[record.position], std::move(draws), sums[chunk]);
  });
  for (int chunk = 1; chunk < kChunks; ++chunk) sums.front().add(sums[at(chunk)]);
  const CandidateSums& total = sums.front();
  const ScoreTest null_test({total.own_information, total.own_scores});
  std::vector<ScoreTest> tests;
  std::vector<double> by_parameters;  // what they explain under each block's motion, beyond the fit
  for (const BlockSums& block : total.blocks) {
    tests.emplace_back(NuisanceProducts{block.information, block.scores});
    by_parameters.push_back(block.scores.dot(solved(block.information, block.scores).col(0)));
  }
  ScoreTable table;
  table.null_minima.assign(static_cast<std::size_t>(null_draws), 1.0);
  std::size_t shape_index = 0;
  for (const Candidate& candidate : list) {
    HypothesisScore& best = table.scores.emplace_back();
    best.start.hypothesis = candidate.hypothesis;
    best.shapes = candidate.shapes.size();
    std::vector<ShapeStart> starts;
    const LawParameter& leading = candidate.entry->parameters.front();
    best.amplitude_unit = unit_at(leading.unit, candidate.place->location.units);
    auto column = static_cast<Index>(candidate.first_column);
    double head_start = 0.0;  // of the best
    for (const LawShape& shape : candidate.shapes) {
      const auto size = static_cast<Index>(shape.basis.size());
      CandidateProducts products{total.information[shape_index++],
                                 total.nuisance.middleRows(column, size),
                                 total.scores.middleRows(column, size)};
      if (null_draws > 0) null_test.lower_minimum_p_values(products, table.null_minima);
      products.nuisance = total.moved_nuisance.middleRows(column, size);
      products.scores = total.scores.col(0).segment(column, size);
      column += size;
      const CandidateScore score = tests[candidate.block].score(products);
      if (score.degrees_of_freedom == 0.0) continue;
      const std::vector<double> start = shape.parameters(score.amplitudes);
      if (!start.empty()) starts.push_back({score.statistic, shape.valley, start});
      const double statistic = score.statistic + by_parameters[candidate.block];
      if (best.start.parameters.empty() ||
          (!start.empty() && statistic + shape.head_start > best.score.statistic + head_start)) {
        best.amplitude = score.amplitudes(0);
        best.amplitude_deviation = std::sqrt(score.amplitude_covariance(0, 0));
        if (start.empty()) continue;  // the sign that it found is impossible
        head_start = shape.head_start;
        best.score = score;
        best.score.statistic = statistic;
        best.start.parameters = start;
        best.start.model_parameters = parameters_with(model, total.blocks[candidate.block],
                                                      products.nuisance, score.amplitudes);
      }
    }
    (has_many_valleys(*candidate.entry) ? best.start.others : best.start.spares) =
        other_starts(std::move(starts), best.start.parameters);
    best.explained_share =
        fit.deviance > 0.0 ? std::min(1.0, best.score.statistic / fit.deviance) : 0.0;
  }
  return table;
}

std::vector<MismatchCell> Problem::mismatch(const ExtendedFit& fit) const {
  constexpr int kBands = 5;
  const ModelState model = state_of(fit);
  std::vector<MatrixXd> power(data_.estimation.size());
  for_each_record(data_.estimation, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                        std::size_t i, std::size_t) {
    const SteadyState& state = solver.solve(model, record, nullptr);
    VectorXcd residual = state.residual.reshaped();
    record.decorrelate(residual);
    power[i] = residual.reshaped(state.residual.rows(), state.residual.cols()).cwiseAbs2();
  });
  const double from = std::log(static_cast<double>(data_.first_line));
  const double to = std::log(static_cast<double>(data_.last_line) + 1.0);
  const auto band_of = [&](Index k) {
    const double share = (std::log(static_cast<double>(k)) - from) / (to - from);
    return std::min(kBands - 1, static_cast<int>(share * kBands));
  };
  std::map<std::tuple<std::size_t, double, Index, int>, MismatchCell> cells;
  for (std::size_t i = 0; i < power.size(); ++i) {
    const MeasuredRecord& record = data_.estimation[i];
    for (Index c = 0; c < power[i].rows(); ++c) {
      for (Index k = data_.first_line; k <= data_.last_line; ++k) {
        MismatchCell& cell = cells[{record.position, record.level, c, band_of(k)}];
        const double frequency = data_.frequencies[at(k)] / (2.0 * std::numbers::pi);
        if (cell.degrees_of_freedom == 0.0) {
          cell.channel = data_.outputs[at(c)];
          cell.position = data_.position_names[record.position];
          cell.level = record.level;
          cell.from = frequency;
        }
        cell.to = std::max(cell.to, frequency);
        cell.statistic += power[i](c, k);
        cell.degrees_of_freedom += 2.0;
      }
    }
  }
  std::vector<MismatchCell> result;
  for (auto& [key, cell] : cells) result.push_back(std::move(cell));
  return result;
}

// At the level where the laws of the fit move most: the recording of the largest force.
std::vector<ForcePicture> Problem::force_pictures(const ExtendedFit& fit) const {
  constexpr Index kPoints = 1500;
  const ModelState model = state_of(fit);
  std::vector<ForcePicture> pictures(fit.laws.size());
  std::vector<double> largest(fit.laws.size(), -1.0);
  SteadyStateSolver solver(*family_, data_, {});
  MatrixXcd answer;
  PeriodicMotion motion, left;
  VectorXd law_force;
  for (const MeasuredRecord& record : data_.estimation) {
    solver.solve(model, record, nullptr);
    for (std::size_t l = 0; l < fit.laws.size(); ++l) {
      const ActingLaw& law = model.laws[base_laws_.size() + l];
      const Location& place = law.place->location;
      ForcePicture& picture = pictures[l];
      picture.hypothesis = fit.laws[l].hypothesis;
      const PeriodicLaw periodic(*law.entry, law.parameters);
      if (place.kind != LocationKind::kElement || is_body(*law.place, *law.entry) ||
          periodic.is_linear()) {
        continue;
      }
      answer_at(solver, model, record, place, answer);
      const PlaceMotion seen =
          PlaceObserver(solver, model, data_, true).observe(record, place, answer);
      solver.motion_of(seen.deflection, motion);
      solver.motion_of(seen.force, left);
      periodic.force(motion, law_force);
      if (law_force.norm() <= largest[l]) continue;
      largest[l] = law_force.norm();
      picture.deflection_unit = place.units.deflection;
      picture.rate_unit = place.units.deflection + "/s";
      picture.force_unit = place.units.force;
      const Index step = std::max<Index>(1, law_force.size() / kPoints);
      for (auto* values :
           {&picture.deflection, &picture.rate, &picture.force, &picture.law_force}) {
        values->clear();
      }
      for (Index t = 0; t < law_force.size(); t += step) {
        picture.deflection.push_back(motion.deflection(t));
        picture.rate.push_back(motion.rate(t));
        picture.force.push_back(law_force(t) + left.deflection(t));
        picture.law_force.push_back(law_force(t));
      }
    }
  }
  return pictures;
}

}  // namespace

std::unique_ptr<MismatchProblem> periodic_mismatch_problem(const std::filesystem::path& model,
                                                           const Campaign& campaign,
                                                           const PeriodicMismatchOptions& options) {
  std::unique_ptr<PlantFamily> family = plant_family(model, options.place_files);
  PeriodicDataOptions reading;
  reading.line_factor = options.line_factor;
  reading.model_accuracy = options.model_accuracy;
  reading.threads = options.threads;
  reading.keep_going = options.keep_going;
  PeriodicData data = read_periodic_data(campaign, *family, reading);
  auto problem = std::make_unique<Problem>(std::move(family), std::move(data), reading, options);
  problem->clear_transients();
  return problem;
}

}  // namespace graybox
