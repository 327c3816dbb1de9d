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

class Problem : public MismatchProblem, public PhysicalEvidence {
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

  // Fits the model as it is to recordings freed of their transients by polynomials, then frees them
  // with the fitted model, until the fit no longer moves. What is between the lines is a hundredth
  // of what is on them or less, and so is what the wrong model's response does to it: a tenth of
  // the noise at most up to the misfit below. Beyond, polynomials do less harm.
  void clear_transients() {
    if (data_.estimation.front().output_bins.size() == 0 || !faults_.empty()) return;
    first_ = first_fit(base_laws_);
    if (!first_->converged || !can_clear_with(report(data_, *first_, {}))) return;
    if (is_doubtful(*first_)) look_across_the_least_determined(*first_);
    clear_with(*first_);
  }

  // Where clear_transients() could not; and where the fit leaves more than noise, and has laws
  // found that make of the free motion what the model without them could not take out.
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
                                  int null_draws, std::uint64_t seed) const override {
    std::vector<HypotheticalLaw> laws;
    for (const std::size_t hypothesis : asked) {
      laws.push_back({hypothesis, places_[hypothesis], entries_[hypothesis]});
    }
    return score_candidates(*family_, data_, state_of(fit), laws,
                            {.follows_data = is_clearly_wrong(fit),
                             .null_draws = null_draws,
                             .seed = seed,
                             .deviance = fit.deviance,
                             .threads = options_.threads});
  }

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& fit) const override {
    return mismatch_map(*family_, data_, state_of(fit), options_.threads);
  }

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    return assess_records(*family_, data_, state_of(fit), data_.validation, 0, options_.threads);
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
    predictions_.push_back(
        {laws, values,
         graybox::predict_held_out(*family_, data_, state_of(fit), values, options_.threads)});
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
      return find_time_variation(*family_, data, model, base_laws_.size(), gain, left,
                                 options_.threads);
    };
    constexpr double kPlain = 0.05;
    std::optional<TimeVariation> found = find_in(data_);
    if (!found || found->p_value > kPlain || fit.laws.empty() || !can_clear_with(fit)) return found;
    PeriodicData again = data_;
    graybox::clear_transients(*family_, model, reading_, again);
    return find_in(again);
  }

  [[nodiscard]] PhysicalContext physical_context(const ExtendedFit& fit) const override {
    PhysicalContext context;
    for (const ModelParameter& parameter : family_->parameters()) {
      context.starts.push_back(parameter.positive ? parameter.start
                                                  : std::numeric_limits<double>::quiet_NaN());
    }
    const ModelState model = state_of(fit);
    const LinearPlant& plant = model.positions.front().plant;
    const std::vector<ForcePicture> pictures =
        law_pictures(*family_, data_, model, base_laws_.size());
    for (std::size_t l = 0; l < fit.laws.size(); ++l) {
      const Location& place = places_[fit.laws[l].hypothesis]->location;
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
        law_pictures(*family_, data_, state_of(fit), base_laws_.size());
    for (std::size_t l = 0; l < pictures.size(); ++l) {
      pictures[l].hypothesis = fit.laws[l].hypothesis;
    }
    return pictures;
  }

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    return residual_spectra(*family_, data_, state_of(fit));
  }

  [[nodiscard]] std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& a, const ExtendedFit& b) const override {
    return rival_experiments(*family_, data_, state_of(a), state_of(b), options_.threads);
  }

 private:
  // Far worse on recordings kept out than on its own: it may be in a valley that its recordings
  // hardly tell from the right one, with a parameter far off. Whatever the errors of its parameters
  // do there: in such valleys they are large.
  [[nodiscard]] bool is_doubtful(const PeriodicFit& fit) const {
    constexpr double kDoubt = 3.0;
    if (data_.validation.empty()) return false;
    const ExtendedFit reported = report(data_, fit, {});
    return validate(reported)->chi_square_per_dof() >
           kDoubt * std::max(1.0, reported.estimation.chi_square_per_dof());
  }

  // Begins again with other values, from half to twice what the model says, of the parameter with
  // the largest relative error (those of combinations that the data do not see have none). Whether
  // one is better its own recordings decide.
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

  // From the parameters of the fit nearby and those that the ranking found for the law, the best of
  // them.
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
    if (!laws.empty()) begin_elsewhere(data, how, starts, acting, laws, best);
    ExtendedFit result = report(data, best, laws);
    // A model alone that is far off has its parameters far off, and its valleys need not be those
    // of the law.
    const bool is_near = result.usable && can_clear_with(result);
    if (laws.empty() || !first_ || can_clear_with(nearby) || is_near) return result;
    std::vector<VectorXd> early{start_};
    if (first_->start.size() > 0 && first_->start != start_) early.push_back(first_->start);
    const PeriodicFit afresh = can_free(data, acting.back())
                                   ? fit_from_freed(data, how, early, acting)
                                   : fit_periodic_if_near(*family_, data, early, acting, how);
    const bool is_better =
        afresh.converged && (!best.converged || afresh.chi_square < best.chi_square);
    return is_better ? report(data, afresh, laws) : result;
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
      PeriodicFit fit = fit_periodic(*family_, data, from, acting, rest);
      if (is_better_valley(data, fit, best)) best = std::move(fit);
    };
    if (has_refinements(*acting.back().entry)) {
      const PeriodicFit plain =
          fit_periodic(*family_, data, starts, with_refinements_held(acting), how);
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
      const ModelState model =
          evaluate_model(*family_, data, each.parameters, each.laws, true, options_.threads);
      return graybox::predict_held_out(*family_, data, model, graybox::values_of(each),
                                       options_.threads)
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

  void clear_with(const PeriodicFit& fit) {
    constexpr double kAtRest = 0.1;  // standard errors
    cleared_start_ = fit_and_clear_transients(*family_, fit, reading_, how_to_fit(), kAtRest, data_)
                         .fit.parameters;
  }

  void list_base_laws() {
    const std::vector<Element>& elements = family_->elements();
    base_places_ = std::make_shared<std::vector<CandidatePlace>>(elements.size());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      CandidatePlace& place = (*base_places_)[e];
      place.location = elements[e].location;
      place.shifts_rest = family_->shifts_rest(elements[e].location);
      const bool is_signal = elements[e].location.kind != LocationKind::kElement;
      const LawEntry* entry = find_law(elements[e].law_name, is_signal);
      require_one_state(*entry);
      base_laws_.push_back({&place, entry, elements[e].parameters, elements[e].fixed});
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
    require_one_state(entry);
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
      laws.push_back({places_[law.hypothesis], entries_[law.hypothesis], law.values(), {}});
    }
    return evaluate_model(*family_, data_, parameters, std::move(laws), true, options_.threads);
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

  [[nodiscard]] ExtendedFit report(const PeriodicData& data, const PeriodicFit& fitted,
                                   std::span<const LawStart> laws) const {
    ExtendedFit result;
    result.usable = fitted.converged;
    result.trouble = fitted.trouble;
    if (fitted.parameters.size() == 0) return result;
    result.parameter_count = static_cast<std::size_t>(fitted.information.rows());
    const VectorXd errors = standard_errors(fitted);
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
    result.estimation = assess_records(
        *family_, data_,
        evaluate_model(*family_, data_, fitted.parameters, fitted.laws, false, options_.threads),
        data.estimation, result.parameter_count, options_.threads);
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
      information -=
          cross.transpose() * solve_information(fitted.information.topLeftCorner(own, own), cross);
    }
    return log_determinant_with_prior(information, values);
  }

  // Far beyond any level of detection, so that a motion that holds noise of the residuals is taken
  // only where tests of single hypotheses no longer decide whether anything is missing.
  static bool is_clearly_wrong(const ExtendedFit& fit) {
    constexpr double kLevel = 1e-6;
    return chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom) < kLevel;
  }

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
  auto problem = std::make_unique<Problem>(std::move(family), std::move(data), reading, options);
  problem->clear_transients();
  return problem;
}

}  // namespace graybox
