#include "graybox/diagnosis/periodic_mismatch/periodic_mismatch.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "graybox/diagnosis/periodic_mismatch/cleared_fit.hpp"
#include "graybox/diagnosis/periodic_mismatch/compared_responses.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_fit.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_shapes.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"
#include "graybox/diagnosis/periodic_mismatch/real_products.hpp"
#include "graybox/diagnosis/periodic_mismatch/residual_spectra.hpp"
#include "graybox/diagnosis/periodic_mismatch/response_start.hpp"
#include "graybox/diagnosis/periodic_mismatch/rival_experiments.hpp"
#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"
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

// One law at one place, with the shapes that are tried.
struct Candidate {
  std::size_t hypothesis = 0;
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;
  std::vector<LawShape> shapes;
  std::size_t first_column = 0;  // of its basis functions among all
  std::size_t block = 0;         // of candidates that share a motion
};

// Products of the parameters' columns under the motion that one block of candidates goes with.
struct BlockSums {
  MatrixXd information;  // parameters x parameters
  VectorXd scores;       // with the residuals
};

// Products of all candidates' columns, summed over recordings.
struct CandidateSums {
  MatrixXd scores;                       // columns x (1 + draws)
  MatrixXd nuisance;                     // columns x parameters, as fitted
  MatrixXd moved_nuisance;               // columns x parameters under the block's motion
  std::vector<MatrixXd> information;     // of each shape
  MatrixXd own_information, own_scores;  // of the parameters, as fitted
  std::vector<BlockSums> blocks;

  void add(const CandidateSums& other) {
    scores += other.scores;
    nuisance += other.nuisance;
    moved_nuisance += other.moved_nuisance;
    own_information += other.own_information;
    own_scores += other.own_scores;
    for (std::size_t s = 0; s < information.size(); ++s) information[s] += other.information[s];
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      blocks[b].information += other.blocks[b].information;
      blocks[b].scores += other.blocks[b].scores;
    }
  }
};

// Information^+ scores, parameters scaled alike.
MatrixXd solved(const MatrixXd& information, const MatrixXd& scores) {
  const VectorXd unit = information.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  const MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  return unit.asDiagonal() *
         scaled.completeOrthogonalDecomposition().solve(unit.asDiagonal() * scores);
}

// The virtual force and the motion at a place, in one recording.
struct PlaceMotion {
  VectorXcd deflection;   // or the signal
  VectorXcd force;        // virtual; empty at signals
  MatrixXcd coordinates;  // with it
  bool is_moved = false;  // coordinates are not those of the model
};

class PlaceObserver {
 public:
  // `follows_data`: else the motion is the model's throughout.
  PlaceObserver(SteadyStateSolver& solver, const ModelState& model, const PeriodicData& data,
                bool follows_data)
      : solver_(solver), model_(model), data_(data), follows_data_(follows_data) {}

  // `answer`: whitened, of a force at the place (not used at signals).
  [[nodiscard]] PlaceMotion observe(const MeasuredRecord& record, const Location& place,
                                    const MatrixXcd& answer) const {
    PlaceMotion motion;
    const Index lines = data_.last_line;
    const SteadyState& state = solver_.state();
    const LinearPlant& plant = model_.positions[record.position].plant;
    motion.coordinates = state.coordinates;
    if (place.kind == LocationKind::kActuator) {
      motion.deflection = record.input.row(place.channel).transpose();
      const VectorXcd held = virtual_force(state.residual, answer).cwiseProduct(holds());
      move(plant.input.col(place.channel), held, motion);
      return motion;
    }
    if (place.kind == LocationKind::kSensor) {
      motion.deflection = measured(record, place.channel);
      return motion;
    }
    motion.force = virtual_force(state.residual, answer);
    move(place.output, motion.force, motion);
    motion.deflection = state.coordinates.transpose() * place.input.cast<Complex>();
    const auto& receptances =
        state.changed.empty() ? model_.positions[record.position].receptance : state.changed;
    for (Index k = data_.first_line; k <= lines; ++k) {
      motion.deflection(k) -= motion.force(k) * between(receptances[at(k)], place);
    }
    take_measured(record, plant, place, motion.deflection);
    motion.deflection(0) += solver_.static_scale() * place.input.dot(plant.rest);
    return motion;
  }

 private:
  void move(const VectorXd& b, const VectorXcd& force, PlaceMotion& motion) const {
    motion.is_moved = !force.isZero(0.0);
    if (motion.is_moved) motion.coordinates = solver_.moved_coordinates(b, force);
  }

  [[nodiscard]] VectorXcd holds() const {
    VectorXcd factors = VectorXcd::Ones(data_.last_line + 1);
    for (Index k = 1; k <= data_.last_line; ++k) {
      factors(k) = hold_factor(data_.frequencies[at(k)], data_.sample_time);
    }
    return factors;
  }

  // b_in^T X b_out
  static Complex between(const MatrixXcd& receptance, const Location& place) {
    Complex sum = 0.0;
    for (Index i = 0; i < place.input.size(); ++i) {
      if (place.input(i) == 0.0) continue;
      for (Index j = 0; j < place.output.size(); ++j) {
        if (place.output(j) != 0.0) sum += place.input(i) * receptance(i, j) * place.output(j);
      }
    }
    return sum;
  }

  // None where it is no larger than its noise is once in e^12 lines: a deflection with the noise of
  // the residuals in it would be correlated with them, and any law would seem to explain them.
  [[nodiscard]] VectorXcd virtual_force(const MatrixXcd& residual, const MatrixXcd& answer) const {
    VectorXcd force = VectorXcd::Zero(data_.last_line + 1);
    if (!follows_data_) return force;
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      const double gain = answer.col(k).squaredNorm();
      if (!(gain > 0.0)) continue;
      const Complex estimate = -answer.col(k).dot(residual.col(k)) / gain;
      const double power = std::norm(estimate), noise = 2.0 / gain;
      if (power > kSignificant * noise) force(k) = estimate;
    }
    return force;
  }

  // A channel as recorded where it differs from the model by more than noise, else as the model has it,
  // for the same reason.
  [[nodiscard]] VectorXcd measured(const MeasuredRecord& record, Index channel) const {
    const SteadyState& state = solver_.state();
    VectorXcd signal = state.output.row(channel).transpose();
    if (!follows_data_) return signal;
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      if (state.residual.col(k).squaredNorm() >
          2.0 * (kSignificant + static_cast<double>(state.residual.rows()))) {
        signal(k) = record.output(channel, k);
      }
    }
    return signal;
  }

  // z from a sensor's own signal, where one measures this deflection or its rate.
  void take_measured(const MeasuredRecord& record, const LinearPlant& plant, const Location& place,
                     VectorXcd& deflection) const {
    for (Index c = 0; c < plant.velocity_output.rows(); ++c) {
      for (const bool is_rate : {true, false}) {
        const VectorXd row =
            (is_rate ? plant.velocity_output : plant.position_output).row(c).transpose();
        const VectorXd other =
            (is_rate ? plant.position_output : plant.velocity_output).row(c).transpose();
        const double ratio = row.dot(place.input) / place.input.squaredNorm();
        if (ratio == 0.0 || !other.isZero(0.0) || !row.isApprox(ratio * place.input, 1e-12)) {
          continue;
        }
        const VectorXcd signal = measured(record, c);
        for (Index k = data_.first_line; k <= data_.last_line; ++k) {
          const Complex rate = is_rate ? Complex(0.0, data_.frequencies[at(k)]) : Complex(1.0);
          deflection(k) = signal(k) / (ratio * rate);
        }
        return;
      }
    }
  }

  static constexpr double kSignificant = 12.0;  // power over noise

  SteadyStateSolver& solver_;
  const ModelState& model_;
  const PeriodicData& data_;
  bool follows_data_;
};

// Draws of what pure noise leaves over the lines of one recording, whitened by a covariance that is an
// estimate itself: where that came out too small in a draw, the noise is too large, in neighbouring lines
// and in all records of a group alike.
class NoiseDraws {
 public:
  NoiseDraws(const PeriodicData& data, std::size_t group, int draws, std::uint64_t seed,
             std::uint64_t record)
      : outputs_(static_cast<Index>(data.outputs.size())), lines_(data.last_line + 1) {
    if (draws == 0) return;
    Random random(seed + 0x9e3779b97f4a7c15ULL * (record + 1));
    noise_ = MatrixXcd::Zero(outputs_ * lines_, draws);
    for (Index d = 0; d < draws; ++d) {
      for (Index i = outputs_ * data.first_line; i < noise_.rows(); ++i) {
        const double real = random.normal();
        noise_(i, d) = Complex(real, random.normal());
      }
    }
    if (!data.noise_pools.empty()) scale(data, data.noise_pools[group], seed ^ (group + 1));
  }

  [[nodiscard]] Index draws() const { return noise_.cols(); }
  // Each draw through an answer (n_y x lines), answer^H noise at each line: lines x draws.
  [[nodiscard]] MatrixXcd seen_by(const MatrixXcd& answer) const {
    MatrixXcd seen(lines_, draws());
    for (Index k = 0; k < lines_; ++k) {
      seen.row(k).noalias() = answer.col(k).adjoint() * noise_.middleRows(k * outputs_, outputs_);
    }
    return seen;
  }
  // Re columns^H seen, of columns over lines.
  static MatrixXd products(const MatrixXcd& columns, const MatrixXcd& seen) {
    return as_real(columns).transpose() * as_real(seen);
  }
  // The same of whitened columns over outputs and lines.
  [[nodiscard]] MatrixXd products(const MatrixXcd& whitened) const {
    return as_real(whitened).transpose() * as_real(noise_);
  }
  void decorrelate(const MeasuredRecord& record) { record.decorrelate(noise_); }

 private:
  // By (nu - 2) / chi^2_nu in variance, which has the mean one: nu = 2 (q - n_y + 1). Chi-square by the cube
  // of a normal number (Wilson and Hilferty 1931).
  void scale(const PeriodicData& data, const NoisePool& pool, std::uint64_t seed) {
    const double freedom = 2.0 * (pool.samples - static_cast<double>(outputs_) + 1.0);
    if (!(freedom > 4.0)) return;
    Random random(seed);
    const auto width = std::max<Index>(1, static_cast<Index>(pool.lines));
    const double spread = 2.0 / (9.0 * freedom);
    for (Index d = 0; d < noise_.cols(); ++d) {
      for (Index k = data.first_line; k < lines_; k += width) {
        const double root = 1.0 - spread + std::sqrt(spread) * random.normal();
        const double chi_square = freedom * std::max(root * root * root, 1e-3);
        const Index count = std::min(width, lines_ - k) * outputs_;
        noise_.col(d).segment(k * outputs_, count) *= std::sqrt((freedom - 2.0) / chi_square);
      }
    }
  }

  Index outputs_, lines_;
  MatrixXcd noise_;  // (outputs of each line) x draws
};

class Problem : public MismatchProblem {
 public:
  Problem(std::unique_ptr<PlantFamily> family, PeriodicData data,
          const PeriodicMismatchOptions& options)
      : family_(std::move(family)), data_(std::move(data)), options_(options) {
    list_base_laws();
    list_hypotheses();
    start_.resize(static_cast<Index>(family_->parameters().size()));
    for (Index p = 0; p < start_.size(); ++p) start_(p) = family_->parameters()[at(p)].start;
    faults_ = find_channel_faults(compared_responses(*family_, data_, start_));
  }

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override { return hypotheses_; }
  [[nodiscard]] double sample_count() const override { return data_.numbers_in(data_.estimation); }
  [[nodiscard]] bool noise_is_known() const override { return true; }

  [[nodiscard]] std::vector<ChannelFault> channel_faults() const override { return faults_; }

  // Fits the model as it is to recordings freed of their transients by polynomials, then frees them with
  // the fitted model, until the fit no longer moves. What is between the lines is a hundredth of what is on
  // them or less, and so is what the wrong model's response does to it: a tenth of the noise at most up to
  // the misfit below. Beyond, polynomials do less harm.
  void clear_transients(const PeriodicDataOptions& options) {
    constexpr double kAtRest = 0.1;    // standard errors
    constexpr double kMisfit = 100.0;  // chi-square per degree of freedom
    if (data_.estimation.front().output_bins.size() == 0 || !faults_.empty()) return;
    const PeriodicFit first = first_fit(base_laws_);
    if (!first.converged || report(first, {}).estimation.chi_square_per_dof() > kMisfit) return;
    cleared_start_ =
        fit_and_clear_transients(*family_, first, options, how_to_fit(), kAtRest, data_)
            .fit.parameters;
  }

  [[nodiscard]] PeriodicFitOptions how_to_fit() const {
    PeriodicFitOptions how;
    how.iteration_limit = options_.iteration_limit;
    how.threads = options_.threads;
    how.keep_going = options_.keep_going;
    return how;
  }

  // From the model's own values and those that the measured responses suggest.
  [[nodiscard]] PeriodicFit first_fit(const std::vector<ActingLaw>& acting) const {
    std::vector<VectorXd> starts{start_};
    if (const auto other = response_start(*family_, data_, options_.threads)) {
      starts.push_back(*other);
    }
    return fit_periodic_gradually(*family_, data_, starts, acting, how_to_fit());
  }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> laws,
                                const ExtendedFit* nearby) const override {
    VectorXd start = start_;
    std::vector<ActingLaw> acting = base_laws_;
    const bool is_first =
        nearby == nullptr || nearby->model_parameters.size() != model_parameter_count();
    if (!is_first) take_model_parameters(*nearby, start, acting);
    for (const LawStart& law : laws) {
      acting.push_back({places_[law.hypothesis], entries_[law.hypothesis], law.parameters, {}});
    }
    if (is_first && !cleared_start_) return report(first_fit(acting), laws);
    std::vector<VectorXd> starts{is_first ? *cleared_start_ : start};
    if (!is_first && !laws.empty() && !laws.back().model_parameters.empty()) {
      const std::vector<double>& other = laws.back().model_parameters;
      starts.emplace_back(Eigen::Map<const VectorXd>(other.data(), start_.size()));
    }
    PeriodicFit best = fit_periodic(*family_, data_, starts, acting, how_to_fit());
    if (!laws.empty()) {
      for (const std::vector<double>& other : laws.back().others) {
        acting.back().parameters = other;
        PeriodicFit fit = fit_periodic(*family_, data_, starts, acting, how_to_fit());
        if (!fit.converged) continue;
        if (!best.converged || fit.chi_square < best.chi_square) best = std::move(fit);
      }
    }
    return report(best, laws);
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
  // chi^2 = r^T r - b^T (C^-1 + J^T J)^-1 b, b = J^T r.
  [[nodiscard]] std::optional<Assessment> validate_within_errors(
      const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    const ModelState model = state_of(fit);
    Assessment result = assess(model, data_.validation, 0);
    const BlockSums fitted = linearised(model, data_.estimation);
    const BlockSums held_out = linearised(model, data_.validation);
    const double explained = held_out.scores.dot(
        solved(fitted.information + held_out.information, held_out.scores).col(0));
    result.chi_square -= explained * result.degrees_of_freedom / data_.numbers_in(data_.validation);
    return result;
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
  static constexpr int kChunks = 8;  // of recordings, whose sums are added in order

  void list_base_laws() {
    const std::vector<Element>& elements = family_->elements();
    base_places_.resize(elements.size());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      base_places_[e].location = elements[e].location;
      base_places_[e].shifts_rest = family_->shifts_rest(elements[e].location);
      const bool is_signal = elements[e].location.kind != LocationKind::kElement;
      base_laws_.push_back(
          {&base_places_[e], find_law(elements[e].law_name, is_signal), elements[e].parameters});
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
    hypotheses_.push_back({place.location.name, place.yaml, entry.name, special_cases_of(entry)});
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

  // Scaled so that the chi-square test holds although the noise is an estimate itself: chi^2/dof then
  // is Fisher's F with the noise's degrees of freedom, which is about a chi-square over its degrees
  // of freedom with 1/dof = 1/dof_data + 1/dof_noise.
  [[nodiscard]] Assessment judged(double chi_square, double degrees_of_freedom) const {
    Assessment result;
    result.chi_square = chi_square;
    result.degrees_of_freedom = degrees_of_freedom;
    if (data_.noise_degrees_of_freedom > 0.0) {
      result.degrees_of_freedom =
          1.0 / (1.0 / degrees_of_freedom + 1.0 / data_.noise_degrees_of_freedom);
      result.chi_square *= result.degrees_of_freedom / degrees_of_freedom;
    }
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
    Assessment result = judged(sum, data_.numbers_in(records) - static_cast<double>(parameters));
    const double share = errors.cwiseQuotient(signals).mean();
    result.nrmse = 100.0 * std::sqrt(share);
    result.variance_accounted_for = 100.0 * (1.0 - share);
    return result;
  }

  // J^T J and J^T r of all parameters over some recordings.
  [[nodiscard]] BlockSums linearised(const ModelState& model,
                                     const std::vector<MeasuredRecord>& records) const {
    std::vector<BlockSums> sums(records.size());
    for_each_record(records, [&](SteadyStateSolver& solver, const MeasuredRecord& record,
                                 std::size_t i, std::size_t) {
      VectorXcd residual = solver.solve(model, record, nullptr).residual.reshaped();
      MatrixXcd jacobian;
      solver.differentiate(model, record, true, jacobian);
      record.decorrelate(residual);
      record.decorrelate(jacobian);
      sums[i] = {as_real(jacobian).transpose() * as_real(jacobian),
                 as_real(jacobian).transpose() * as_real(residual)};
    });
    BlockSums total = sums.front();
    for (std::size_t i = 1; i < sums.size(); ++i) {
      total.information += sums[i].information;
      total.scores += sums[i].scores;
    }
    return total;
  }

  [[nodiscard]] ExtendedFit report(const PeriodicFit& fitted,
                                   std::span<const LawStart> laws) const {
    ExtendedFit result;
    result.usable = fitted.converged;
    result.trouble = fitted.trouble;
    if (fitted.parameters.size() == 0) return result;
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
        const LawParameter& parameter = law.entry->parameters[p];
        LawParameterEstimate estimate{parameter.name,
                                      unit_at(parameter.unit, law.place->location.units),
                                      law.parameters[p], errors(k)};
        if (is_base) estimate.name = base_names_[l] + "." + parameter.name;
        (is_base ? result.model_parameters : result.laws.back().parameters).push_back(estimate);
      }
    }
    result.deviance = fitted.chi_square;
    result.laws_information = information_of_laws(fitted, result.model_parameters.size());
    result.parameter_count = static_cast<std::size_t>(fitted.information.rows());
    for (const ActingLaw& law : base_laws_) {
      result.parameter_count -= static_cast<std::size_t>(std::ranges::count(law.fixed, true));
    }
    result.estimation = assess(
        evaluate_model(*family_, data_, fitted.parameters, fitted.laws, false, options_.threads),
        data_.estimation, result.parameter_count);
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
    const MatrixXd whole = values.asDiagonal() * information * values.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(whole, Eigen::EigenvaluesOnly);
    return eigen.eigenvalues().array().max(0.0).log1p().sum();
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
  void add_record(SteadyStateSolver& solver, const ModelState& model, const MeasuredRecord& record,
                  const std::vector<Candidate>& list,
                  const std::vector<std::vector<PlantChange>>& body_changes, bool follows_data,
                  NoiseDraws draws, CandidateSums& sums) const;
  [[nodiscard]] std::vector<std::vector<PlantChange>> body_changes(
      const ModelState& model, const std::vector<Candidate>& list) const;
  void place_answer(SteadyStateSolver& solver, const ModelState& model,
                    const MeasuredRecord& record, const Location& place, MatrixXcd& answer) const;
  static std::vector<std::vector<double>> other_starts(
      std::vector<std::pair<double, std::vector<double>>> starts);
  static void add_block(const MatrixXcd& jacobian, const Eigen::Ref<const VectorXcd>& residual,
                        BlockSums& sums);
  void differentiate_moved(SteadyStateSolver& solver, const ModelState& model,
                           const MeasuredRecord& record, const MatrixXcd& coordinates,
                           MatrixXcd& jacobian) const;
  [[nodiscard]] std::vector<double> parameters_with(const ModelState& model, const BlockSums& own,
                                                    const MatrixXd& nuisance,
                                                    const VectorXd& amplitudes) const;

  std::unique_ptr<PlantFamily> family_;
  PeriodicData data_;
  PeriodicMismatchOptions options_;
  VectorXd start_;
  std::vector<ChannelFault> faults_;
  std::optional<VectorXd> cleared_start_;  // that the transients were cleared with
  std::vector<CandidatePlace> base_places_;
  std::vector<ActingLaw> base_laws_;
  std::vector<std::string> base_names_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const CandidatePlace*> places_;  // of each hypothesis
  std::vector<const LawEntry*> entries_;
};

void Problem::place_answer(SteadyStateSolver& solver, const ModelState& model,
                           const MeasuredRecord& record, const Location& place,
                           MatrixXcd& answer) const {
  if (place.kind == LocationKind::kElement) {
    solver.answer(model, record, place.output, answer);
  } else if (place.kind == LocationKind::kActuator) {
    solver.answer_of_input(model, record, place.channel, answer);
  } else {
    solver.answer_of_output(record, place.channel, answer);
  }
}

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
      place_answer(solver, model, record, place->location, answer);
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
      const bool is_same =
          list.back().place == candidate.place && is_body(*list.back().place, *list.back().entry) ==
                                                      is_body(*candidate.place, *candidate.entry);
      candidate.block = list.back().block + (is_same ? 0 : 1);
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
                                         (changed.stiffness - plain.stiffness) / small}));
      }
    }
  }
  return changes;
}

void Problem::add_record(SteadyStateSolver& solver, const ModelState& model,
                         const MeasuredRecord& record, const std::vector<Candidate>& list,
                         const std::vector<std::vector<PlantChange>>& bodies, bool follows_data,
                         NoiseDraws draws, CandidateSums& sums) const {
  const Index lines = data_.last_line + 1;
  const auto outputs = static_cast<Index>(data_.outputs.size());
  MatrixXcd jacobian;
  solver.differentiate(model, record, false, jacobian);
  MatrixXcd moved = jacobian, moved_jacobian;
  record.decorrelate(jacobian);
  VectorXcd residual = solver.state().residual.reshaped();
  record.decorrelate(residual);
  sums.own_information += as_real(jacobian).transpose() * as_real(jacobian);
  sums.own_scores.col(0) += (jacobian.adjoint() * residual).real();
  const Index count = draws.draws();
  if (count > 0) sums.own_scores.rightCols(count) += draws.products(jacobian);
  // Once more: columns of candidates are not decorrelated, what they are multiplied with is. Among
  // themselves they lose what they have in common with the directions of the common error.
  MatrixXcd twice = jacobian;
  VectorXcd residual_twice = residual;
  record.decorrelate(twice);
  record.decorrelate(residual_twice);
  draws.decorrelate(record);
  const Index parameters = jacobian.cols();
  if (record.common_error) {
    const MatrixXcd common = record.common_error->inverse_directions();
    twice.conservativeResize(Eigen::NoChange, parameters + common.cols());
    twice.rightCols(common.cols()) = common;
  }
  const Index directions = twice.cols() - parameters;
  const PlaceObserver observer(solver, model, data_, follows_data);
  bool is_moved = false;
  MatrixXcd answer, seen_twice(lines, twice.cols());
  VectorXcd seen_residual(lines);
  MatrixXcd seen_noise;
  MatrixXcd seen_moved(lines, parameters);
  VectorXd gain(lines);
  VectorXcd force;
  PlaceMotion place_motion;
  PeriodicMotion motion;
  std::size_t shape_index = 0, body = 0;
  const Candidate* before = nullptr;
  for (const Candidate& candidate : list) {
    const Location& place = candidate.place->location;
    auto column = static_cast<Index>(candidate.first_column);
    const bool is_new = before == nullptr || candidate.block != before->block;
    before = &candidate;
    if (is_body(*candidate.place, *candidate.entry)) {
      if (is_new) add_block(jacobian, residual, sums.blocks[candidate.block]);
      MatrixXcd change(outputs, lines);
      for (std::size_t s = 0; s < candidate.shapes.size(); ++s, ++column, ++shape_index, ++body) {
        solver.answer_of_plant(bodies[record.position][body], solver.state().coordinates, false,
                               change);
        const Eigen::Map<const VectorXcd> own(change.data(), change.size());
        const Eigen::RowVectorXd products = (own.adjoint() * twice).real();
        sums.information[shape_index](0, 0) +=
            own.squaredNorm() - products.tail(directions).squaredNorm();
        sums.nuisance.row(column) += products.head(parameters);
        sums.moved_nuisance.row(column) += products.head(parameters);
        sums.scores(column, 0) += own.dot(residual_twice).real();
        if (count > 0) sums.scores.row(column).tail(count) += draws.products(own).row(0);
      }
      continue;
    }
    if (is_new) {
      place_answer(solver, model, record, place, answer);
      if (place.kind == LocationKind::kElement) answer = -answer;
      place_motion = observer.observe(
          record, place, place.kind == LocationKind::kElement ? MatrixXcd(-answer) : answer);
      solver.motion_of(place_motion.deflection, motion);
      is_moved = place_motion.is_moved;
      if (is_moved) {
        differentiate_moved(solver, model, record, place_motion.coordinates, moved);
        moved_jacobian = moved;
        record.decorrelate(moved_jacobian);
        add_block(moved_jacobian, residual, sums.blocks[candidate.block]);
        record.decorrelate(moved_jacobian);
      } else {
        add_block(jacobian, residual, sums.blocks[candidate.block]);
      }
      gain = answer.colwise().squaredNorm().transpose();
      if (count > 0) seen_noise = draws.seen_by(answer);
      for (Index k = 0; k < lines; ++k) {
        const auto seen = answer.col(k).adjoint();
        seen_residual(k) = seen * residual_twice.segment(k * outputs, outputs);
        seen_twice.row(k).noalias() = seen * twice.middleRows(k * outputs, outputs);
        if (is_moved) {
          seen_moved.row(k).noalias() = seen * moved_jacobian.middleRows(k * outputs, outputs);
        }
      }
    }
    for (const LawShape& shape : candidate.shapes) {
      const auto size = static_cast<Index>(shape.basis.size());
      MatrixXcd columns(lines, size), weighted;
      for (Index j = 0; j < size; ++j) {
        const PeriodicLaw law(*candidate.entry, shape.basis[at(j)]);
        if (place.kind == LocationKind::kActuator) {
          solver.signal_lines(law, record, model.positions[record.position].plant, place.channel,
                              force);
        } else {
          solver.force_lines(law, place_motion.deflection, motion, force);
        }
        columns.col(j) = force;
      }
      weighted = gain.cwiseSqrt().asDiagonal() * columns;
      const MatrixXd products = as_real(columns).transpose() * as_real(seen_twice);
      const auto common = products.rightCols(directions);
      const auto nuisance = products.leftCols(parameters);
      sums.information[shape_index] +=
          as_real(weighted).transpose() * as_real(weighted) - common * common.transpose();
      sums.nuisance.middleRows(column, size) += nuisance;
      sums.moved_nuisance.middleRows(column, size) +=
          is_moved ? MatrixXd(as_real(columns).transpose() * as_real(seen_moved))
                   : MatrixXd(nuisance);
      sums.scores.col(0).segment(column, size) +=
          as_real(columns).transpose() * as_real(seen_residual);
      if (count > 0) {
        sums.scores.middleRows(column, size).rightCols(count) +=
            NoiseDraws::products(columns, seen_noise);
      }
      column += size;
      ++shape_index;
    }
  }
}

void Problem::add_block(const MatrixXcd& jacobian, const Eigen::Ref<const VectorXcd>& residual,
                        BlockSums& sums) {
  sums.information += as_real(jacobian).transpose() * as_real(jacobian);
  sums.scores += (jacobian.adjoint() * residual).real();
}

// The columns of the plant's parameters under the motion q; those of laws stay.
void Problem::differentiate_moved(SteadyStateSolver& solver, const ModelState& model,
                                  const MeasuredRecord& record, const MatrixXcd& coordinates,
                                  MatrixXcd& jacobian) const {
  const std::size_t own = model.positions[record.position].changes.size();
  for (std::size_t p = 0; p < own; ++p) {
    Eigen::Map<MatrixXcd> column(jacobian.col(static_cast<Index>(p)).data(),
                                 static_cast<Index>(data_.outputs.size()), data_.last_line + 1);
    solver.answer_of_parameter(record, p, coordinates, false, column);
  }
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

// The best few after the best.
std::vector<std::vector<double>> Problem::other_starts(
    std::vector<std::pair<double, std::vector<double>>> starts) {
  constexpr std::size_t kOthers = 7;
  std::ranges::stable_sort(starts, {}, [](const auto& start) { return start.first; });
  std::vector<std::vector<double>> others;
  for (std::size_t i = 1; i < starts.size() && i <= kOthers; ++i) {
    others.push_back(std::move(starts[i].second));
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
    const NoiseDraws draws(data_, record.group, null_draws, seed, i);
    add_record(solver, model, record, list, bodies, follows_data, draws, sums[chunk]);
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
    std::vector<std::pair<double, std::vector<double>>> starts;  // -statistic
    const LawParameter& leading = candidate.entry->parameters.front();
    best.amplitude_unit = unit_at(leading.unit, candidate.place->location.units);
    auto column = static_cast<Index>(candidate.first_column);
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
      if (!start.empty()) starts.emplace_back(-score.statistic, start);
      if (best.start.parameters.empty() ||
          (!start.empty() &&
           score.statistic + by_parameters[candidate.block] > best.score.statistic)) {
        best.amplitude = score.amplitudes(0);
        best.amplitude_deviation = std::sqrt(score.amplitude_covariance(0, 0));
        if (start.empty()) continue;  // the sign that it found is impossible
        best.score = score;
        best.score.statistic += by_parameters[candidate.block];
        best.start.parameters = start;
        best.start.model_parameters = parameters_with(model, total.blocks[candidate.block],
                                                      products.nuisance, score.amplitudes);
      }
    }
    if (has_many_valleys(*candidate.entry)) best.start.others = other_starts(std::move(starts));
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
      place_answer(solver, model, record, place, answer);
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
  std::unique_ptr<PlantFamily> family = plant_family(model);
  PeriodicDataOptions reading;
  reading.line_factor = options.line_factor;
  reading.model_accuracy = options.model_accuracy;
  reading.threads = options.threads;
  reading.keep_going = options.keep_going;
  PeriodicData data = read_periodic_data(campaign, *family, reading);
  auto problem = std::make_unique<Problem>(std::move(family), std::move(data), options);
  problem->clear_transients(reading);
  return problem;
}

}  // namespace graybox
