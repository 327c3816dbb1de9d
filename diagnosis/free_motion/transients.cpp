#include "diagnosis/free_motion/transients.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>
#include <vector>

#include "diagnosis/harmonic_balance/anderson_mixing.hpp"
#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "diagnosis/responses/covariance_pool.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr int kRounds = 3;  // of weights and noise
// Free motion and what own forces make of it are then brought to agree, record by record: until a
// step changes the decorrelated lines by no more than this (the square of it in chi-square), or so
// many steps.
constexpr double kSettled = 0.1;
constexpr int kSteps = 30;
constexpr int kPlainSteps = 3;  // by substitution, then by Anderson's mixing
constexpr std::size_t kRemembered = 6;
// Rms in standard deviations up to which a residual may be nothing but noise.
constexpr double kNoiseAtMost = 2.0;

// A law that is a force and not linear, about the motion of a record.
struct MeanSlope {
  double stiffness = 0.0, damping = 0.0;

  friend bool operator==(const MeanSlope&, const MeanSlope&) = default;
};

// A law of the model that is a force.
struct ForceLaw {
  const Location* place = nullptr;
  PeriodicLaw law;
  std::optional<LinearForce> linear;

  // With the present motion alone, and not linearly.
  [[nodiscard]] bool is_curved() const { return !linear && !law.has_states(); }
};

// How the plant of some records moves freely, at their bins 1 ... B.
struct FreePlant {
  std::size_t position = 0, group = 0;
  Index periods = 1, bins = 0;    // B
  LinearPlant plant;              // with linear laws and the others' mean slopes,
  std::vector<MeanSlope> slopes;  // which are these, of each law
  SampledPlant sampled;
  std::vector<MatrixXcd> motion;    // z C (z I - A)^-1, n_y x 2n each
  std::vector<MatrixXcd> response;  // G
  VectorXd departure_size;          // 2n, what |d| is expected to be at most
  // Of the last round:
  Eigen::LLT<MatrixXd> information;  // of d, scaled by its size
  VectorXd leverage;                 // of each bin between lines, mean over the outputs
};

struct FreeRecord {
  MeasuredRecord* record = nullptr;
  std::size_t plant = 0;     // of all FreePlants
  MatrixXcd periodic;        // q of the steady state, n x (K + 1), n with masses that swing
  MatrixXcd periodic_force;  // of own forces and laws under it, n x (B + 1); empty: not asked yet
  MatrixXcd excess;          // Y - G U, n_y x (B + 1)
  // Of the last round:
  VectorXd departure;  // d
  MatrixXcd
      own;  // q by what own forces and laws add with the free motion, n x (B + 1); empty: nothing
  MatrixXcd own_seen;         // the same at the outputs, n_y x (B + 1)
  MatrixXcd rest;             // excess without all that
  bool runs_away = false;     // substitution does
  bool without_laws = false;  // beyond their mean slopes
};

class Clearing {
 public:
  Clearing(const PlantFamily& family, const ModelState& model, const PeriodicDataOptions& options,
           PeriodicData& data)
      : family_(family), model_(model), options_(options), data_(data) {
    for (const ActingLaw& law : model.laws) {
      if (!is_force(law)) continue;
      PeriodicLaw periodic(*law.entry, law.parameters);
      std::optional<LinearForce> linear = periodic.linear_force();
      if (law.entry->name == "offset") linear = LinearForce{};  // constant
      laws_.push_back({&law.place->location, std::move(periodic), linear});
    }
    has_curved_laws_ = std::ranges::any_of(laws_, &ForceLaw::is_curved);
  }

  void run() {
    collect();
    for (int round = 0; round < kRounds; ++round) {
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
      for (std::size_t i = 0; i < plants_.size(); ++i) {
        if (!clock_.stops()) weigh(plants_[i]);
      }
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) {
        if (clock_.stops()) continue;
        if (round > 0) add_forces(records_[i]);
        separate(records_[i]);
        if (round > 0) leave_out_laws_if_worse(records_[i]);
      }
      stop_if_requested();
      whiten();
    }
    settle();
    for (FreeRecord& free : records_) take_out(free);
    find_common_errors();
    keep_between_lines();
    take_out_feedback();
  }

 private:
  static bool is_force(const ActingLaw& law) {
    return law.place->location.kind == LocationKind::kElement && !is_body(*law.place, *law.entry);
  }
  static bool is_line(const FreePlant& plant, Index bin) { return bin % plant.periods == 0; }
  [[nodiscard]] const MatrixXcd& weight(const FreePlant& plant, Index bin) const {
    const Index line =
        std::clamp(nearest_line(bin, plant.periods), data_.first_line, data_.last_line);
    return data_.whitening[plant.group][at(line)];
  }

  void collect() {
    for (auto* list : {&data_.estimation, &data_.validation}) {
      for (MeasuredRecord& record : *list) {
        if (record.output_bins.size() > 0) records_.emplace_back().record = &record;
      }
    }
    std::vector<std::vector<MeanSlope>> slopes(records_.size());
#pragma omp parallel num_threads(options_.threads)
    {
      SteadyStateSolver solver(family_, data_, {});
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) {
        if (!clock_.stops()) slopes[i] = describe(solver, records_[i]);
      }
    }
    stop_if_requested();
    for (std::size_t i = 0; i < records_.size(); ++i) share_plant(records_[i], slopes[i]);
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t i = 0; i < plants_.size(); ++i) {
      if (!clock_.stops()) describe(plants_[i]);
    }
    stop_if_requested();
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t i = 0; i < records_.size(); ++i) {
      if (!clock_.stops()) find_excess(records_[i]);
    }
    stop_if_requested();
  }

  // On the unit circle of z.
  [[nodiscard]] double angle(const FreePlant& plant, Index bin) const {
    const auto samples = static_cast<double>(data_.period) * static_cast<double>(plant.periods);
    return 2.0 * std::numbers::pi * static_cast<double>(bin) / samples;
  }
  [[nodiscard]] double frequency(const FreePlant& plant, Index bin) const {
    return angle(plant, bin) / data_.sample_time;
  }

  // The periodic motion; returns the laws' slopes for small motions about it.
  std::vector<MeanSlope> describe(SteadyStateSolver& solver, FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= data_.last_line; ++k) {
      record.input.col(k) = record.input_bins.col(k * record.periods);
    }
    const SteadyState& state = solver.solve(model_, record, nullptr);
    free.periodic = with_swinging_masses(state.coordinates);
    return mean_slopes(state);
  }

  // Each a coordinate more.
  [[nodiscard]] MatrixXcd with_swinging_masses(const MatrixXcd& coordinates) const {
    MatrixXcd result = coordinates;
    for (const ForceLaw& law : laws_) {
      if (!law.linear || !law.linear->swings) continue;
      Eigen::RowVectorXcd mass = law.place->input.transpose() * coordinates;
      for (Index k = 1; k < mass.size(); ++k) {
        mass(k) *= law.linear->transmission(data_.frequencies[at(k)]);
      }
      result.conservativeResize(result.rows() + 1, Eigen::NoChange);
      result.bottomRows(1) = mass;
    }
    return result;
  }

  // Records of one position and level have a plant in common unless laws' slopes make them differ.
  void share_plant(FreeRecord& free, const std::vector<MeanSlope>& slopes) {
    const MeasuredRecord& record = *free.record;
    const auto is_same = [&](const FreePlant& other) {
      return other.position == record.position && other.group == record.group &&
             other.periods == record.periods && other.bins == record.output_bins.cols() - 1 &&
             other.slopes == slopes;
    };
    const auto known = std::ranges::find_if(plants_, is_same);
    free.plant = static_cast<std::size_t>(known - plants_.begin());
    if (known == plants_.end()) {
      FreePlant& added = plants_.emplace_back();
      added.position = record.position;
      added.group = record.group;
      added.periods = record.periods;
      added.bins = record.output_bins.cols() - 1;
      added.plant = model_.positions[record.position].plant;
      added.slopes = slopes;
      add_laws(added);
      added.departure_size = VectorXd::Zero(2 * added.plant.mass.rows());
    }
    FreePlant& shared = plants_[free.plant];
    shared.departure_size =
        shared.departure_size.cwiseMax(size_of_departure(shared.periods, free.periodic));
  }

  void describe(FreePlant& plant) const {
    plant.sampled = sampled_plant(plant.plant, data_.sample_time);
    plant.motion.resize(at(plant.bins) + 1);
    plant.response.resize(at(plant.bins) + 1);
    plant.leverage = VectorXd::Zero(plant.bins + 1);
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      const Complex z = std::polar(1.0, angle(plant, bin));
      const MatrixXcd sight = plant.sampled.sight(z);
      plant.response[at(bin)] = sight * plant.sampled.input;
      plant.motion[at(bin)] = z * sight * plant.sampled.vectors.adjoint();
    }
  }

  void find_excess(FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    const MeasuredRecord& record = *free.record;
    free.excess = free.own_seen = MatrixXcd::Zero(record.output_bins.rows(), plant.bins + 1);
    free.rest = free.excess;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      free.excess.col(bin) =
          record.output_bins.col(bin) - plant.response[at(bin)] * record.input_bins.col(bin);
    }
  }

  // The rms of the periodic motion: a free motion of that size is no rarity, a larger one is.
  [[nodiscard]] VectorXd size_of_departure(Index periods, const MatrixXcd& periodic) const {
    const Index n = periodic.rows();
    VectorXd power = VectorXd::Zero(2 * n);
    for (Index k = 1; k <= data_.last_line; ++k) {
      const VectorXd line = periodic.col(k).cwiseAbs2();
      power.head(n) += line;
      power.tail(n) += data_.frequencies[at(k)] * data_.frequencies[at(k)] * line;
    }
    // From the scale of lines of one period, N^(-1/2), to that of bins, N^(-1/2) / P.
    return std::sqrt(2.0) / static_cast<double>(data_.period) / static_cast<double>(periods) *
           power.cwiseSqrt();
  }

  [[nodiscard]] std::vector<MeanSlope> mean_slopes(const SteadyState& state) const {
    std::vector<MeanSlope> slopes(laws_.size());
    const auto lines = static_cast<double>(data_.excited.size());
    for (Index column = 0; column < state.slopes.cols(); ++column) {
      if (laws_[at(column)].linear) continue;
      MeanSlope& mean = slopes[at(column)];
      for (const std::size_t line : data_.excited) {
        const Complex slope = state.slopes(static_cast<Index>(line), column);
        mean.stiffness += slope.real() / lines;
        mean.damping += slope.imag() / data_.frequencies[line] / lines;
      }
    }
    return slopes;
  }

  // Linear laws as they are; of others the springs and dampers that they are for motions much
  // smaller than those of the record.
  void add_laws(FreePlant& free) const {
    for (std::size_t l = 0; l < laws_.size(); ++l) {
      const ForceLaw& law = laws_[l];
      const MeanSlope& mean = free.slopes[l];
      add(law, law.linear.value_or(LinearForce{0.0, mean.damping, mean.stiffness}), free.plant);
    }
  }

  // With a mass r that swings: k (z - r) at the place, and k (r - z) there.
  static void add(const ForceLaw& law, const LinearForce& force, LinearPlant& plant) {
    VectorXd output = VectorXd::Zero(plant.mass.rows()), input = output;
    output.head(law.place->output.size()) = law.place->output;
    input.head(law.place->input.size()) = law.place->input;
    if (force.swings) {
      add_coordinate(plant);
      plant.mass(plant.mass.rows() - 1, plant.mass.rows() - 1) = force.inertia;
      output.conservativeResizeLike(-VectorXd::Unit(plant.mass.rows(), plant.mass.rows() - 1));
      input.conservativeResizeLike(-VectorXd::Unit(plant.mass.rows(), plant.mass.rows() - 1));
    } else {
      plant.mass += force.inertia * output * input.transpose();
    }
    plant.damping += force.damping * output * input.transpose();
    plant.stiffness += force.stiffness * output * input.transpose();
  }

  static void add_coordinate(LinearPlant& plant) {
    const Index n = plant.mass.rows() + 1;
    for (MatrixXd* matrix : {&plant.mass, &plant.damping, &plant.stiffness}) {
      matrix->conservativeResizeLike(MatrixXd::Zero(n, n));
    }
    plant.input.conservativeResizeLike(MatrixXd::Zero(n, plant.input.cols()));
    for (MatrixXd* matrix : {&plant.position_output, &plant.velocity_output}) {
      matrix->conservativeResizeLike(MatrixXd::Zero(matrix->rows(), n));
    }
  }

  // Real and imaginary rows of what a departure does at a bin, weighted; its columns in units of
  // what a departure may be.
  void weighted_motion(const FreePlant& plant, Index bin, Eigen::Ref<MatrixXd> rows) const {
    const Index outputs = rows.rows() / 2;
    const MatrixXcd weighted =
        weight(plant, bin) * (plant.motion[at(bin)] * plant.departure_size.asDiagonal());
    rows.topRows(outputs) = weighted.real();
    rows.bottomRows(outputs) = weighted.imag();
  }

  // The information about the free motion of a record between the lines, and what its error does to
  // each bin. The identity shrinks it to what it may be where the data do not see it.
  void weigh(FreePlant& plant) const {
    const Index outputs = plant.motion.back().rows(), states = plant.motion.back().cols();
    MatrixXd information = MatrixXd::Identity(states, states), rows(2 * outputs, states);
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (is_line(plant, bin)) continue;
      weighted_motion(plant, bin, rows);
      information.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
    }
    plant.information.compute(information);  // of the lower triangle
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (is_line(plant, bin)) continue;
      weighted_motion(plant, bin, rows);
      plant.leverage(bin) = plant.information.matrixL().solve(rows.transpose()).squaredNorm() /
                            (2.0 * static_cast<double>(outputs));
    }
  }

  // The free motion by weighted least squares between the lines.
  void separate(FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    VectorXd scores = VectorXd::Zero(plant.departure_size.size());
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (is_line(plant, bin)) continue;
      const MatrixXcd& whitening = weight(plant, bin);
      const VectorXcd weighted =
          whitening.adjoint() * (whitening * (free.excess.col(bin) - free.own_seen.col(bin)));
      scores += (plant.motion[at(bin)].adjoint() * weighted).real();
    }
    scores = plant.departure_size.cwiseProduct(scores);
    free.departure = plant.departure_size.cwiseProduct(plant.information.solve(scores));
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      free.rest.col(bin) =
          free.excess.col(bin) - free.own_seen.col(bin) - plant.motion[at(bin)] * free.departure;
    }
  }

  // What own forces, and laws beyond their mean slopes, add where the free motion of the last round
  // meets the periodic one.
  void add_forces(FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    const auto own = family_.own_force(model_.positions[plant.position].plant, model_.bodies);
    const bool with_laws = has_curved_laws_ && !free.without_laws;
    if (own == nullptr && !with_laws) return;
    const std::size_t samples = data_.period * static_cast<std::size_t>(plant.periods);
    // Own forces are of second order; laws may have corners.
    const std::size_t points = with_laws ? 8 : 3;
    PeriodTransform transform(samples, plant.bins, fast_grid(points * at(plant.bins)));
    const MatrixXcd periodic = coordinates_at_bins(free);
    MatrixXcd both = periodic;
    if (free.own.size() > 0) both += free.own;
    const VectorXcd departure = plant.sampled.vectors.adjoint() * free.departure;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      const Complex z = std::polar(1.0, angle(plant, bin));
      VectorXcd cause = z * departure;
      if (!is_line(plant, bin)) cause += plant.sampled.input * free.record->input_bins.col(bin);
      both.col(bin) += plant.sampled.state(z, cause).head(both.rows());
    }
    if (free.periodic_force.size() == 0) {
      free.periodic_force = force_of(own.get(), with_laws, plant, periodic, transform);
    }
    const MatrixXcd force =
        force_of(own.get(), with_laws, plant, both, transform) - free.periodic_force;
    free.own = MatrixXcd::Zero(both.rows(), plant.bins + 1);
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      const double w = frequency(plant, bin);
      free.own.col(bin) = receptance(plant.plant, w) * force.col(bin);
    }
    if (!free.own.allFinite()) free.own.setZero();  // a motion far beyond the model
    see_own_motion(free);
  }

  void see_own_motion(FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      const Complex rate(0.0, frequency(plant, bin));
      free.own_seen.col(bin) = plant.plant.position_output * free.own.col(bin) +
                               rate * (plant.plant.velocity_output * free.own.col(bin));
    }
  }

  [[nodiscard]] MatrixXcd coordinates_at_bins(const FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    MatrixXcd result = MatrixXcd::Zero(free.periodic.rows(), plant.bins + 1);
    for (Index k = 0; k < free.periodic.cols(); ++k) {
      result.col(k * plant.periods) = free.periodic.col(k);
    }
    return result;
  }

  // Bins of the own force, if there is one, and the curved laws' under a motion of these bins; none
  // on masses that laws let swing.
  MatrixXcd force_of(OwnForce* own, bool with_laws, const FreePlant& plant,
                     const MatrixXcd& coordinates, PeriodTransform& transform) const {
    // Bins are scaled as lines of one period, the transform is of all.
    const double scale = std::sqrt(static_cast<double>(plant.periods));
    const Index n = model_.positions[plant.position].plant.mass.rows();
    MatrixXd q(n, transform.grid()), velocity = q, acceleration = q,
                                     force = MatrixXd::Zero(n, transform.grid());
    VectorXd times(transform.grid());
    for (Index i = 0; i < n; ++i) {
      VectorXcd spectrum = scale * coordinates.row(i).transpose();
      for (MatrixXd* target : {&q, &velocity, &acceleration}) {
        transform.to_times(spectrum, times);
        target->row(i) = times.transpose();
        for (Index bin = 0; bin <= plant.bins; ++bin) {
          spectrum(bin) *= Complex(0.0, frequency(plant, bin));
        }
      }
    }
    if (own != nullptr) own->evaluate(q, velocity, acceleration, force);
    if (with_laws) {
      for (std::size_t l = 0; l < laws_.size(); ++l) {
        if (laws_[l].is_curved()) {
          add_curvature(laws_[l], plant.slopes[l], plant.plant.rest, q, velocity, force);
        }
      }
    }
    MatrixXcd result = MatrixXcd::Zero(coordinates.rows(), plant.bins + 1);
    VectorXcd spectrum(plant.bins + 1);
    for (Index i = 0; i < n; ++i) {
      times = force.row(i).transpose();
      transform.to_lines(times, spectrum);
      result.row(i) = spectrum.transpose() / scale;
    }
    return result;
  }

  // The force of a law without that of its mean slopes.
  static void add_curvature(const ForceLaw& law, const MeanSlope& slope, const VectorXd& rest,
                            const MatrixXd& q, const MatrixXd& velocity, MatrixXd& force) {
    const Location& place = *law.place;
    PeriodicMotion motion;
    motion.deflection = q.transpose() * place.input;
    motion.rate = velocity.transpose() * place.input;
    const VectorXd straight = slope.stiffness * motion.deflection + slope.damping * motion.rate;
    motion.deflection.array() += place.input.dot(rest);
    VectorXd of_law;
    law.law.force(motion, of_law);
    force.noalias() -= place.output * (of_law - straight).transpose();
  }

  void whiten() {
    std::vector<double> frequencies(data_.frequencies.begin() + data_.first_line,
                                    data_.frequencies.end());
    for (std::size_t group = 0; group < data_.whitening.size(); ++group) {
      const std::vector<LineScatter> scatter = scatter_of(group);
      const Index outputs = static_cast<Index>(data_.outputs.size());
      const double wanted = wanted_noise_samples(options_, outputs);
      const auto pooled = pool_covariances(scatter, frequencies, wanted);
      data_.noise_pools[group] = pool_of(scatter, pooled);
      const MatrixXd level = output_level(data_, group);
      for (Index k = data_.first_line; k <= data_.last_line; ++k) {
        const std::size_t i = at(k - data_.first_line);
        const double inflation = inverse_bias(pooled[i].degrees_of_freedom, outputs);
        const auto whitening =
            whitening_of(inflation * pooled[i].covariance, level.col(k), options_.model_accuracy);
        if (whitening) data_.whitening[group][at(k)] = *whitening;
      }
    }
  }

  // Near a resonance a small change of these forces is a large one of the motion, and a few rounds
  // are not enough.
  void settle() {
    if (std::ranges::all_of(records_, [](const FreeRecord& f) { return f.own.size() == 0; }))
      return;
    find_common_errors();
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t i = 0; i < records_.size(); ++i) {
      if (!clock_.stops()) settle(records_[i]);
    }
    stop_if_requested();
    whiten();
  }

  // Laws that are far from straight may not be brought to agree with the free motion: then they
  // count by their mean slopes.
  void settle(FreeRecord& free) const {
    if (free.own.size() == 0) return;
    bring_to_agree(free);
    if (!has_curved_laws_) return;
    FreeRecord other = without_laws(free);
    bring_to_agree(other);
    if (!(left_between_lines(free) <= left_between_lines(other))) free = std::move(other);
  }

  // For this round; the next begins with them again.
  void leave_out_laws_if_worse(FreeRecord& free) const {
    if (!has_curved_laws_ || free.own.size() == 0) return;
    FreeRecord other = without_laws(free);
    if (left_between_lines(free) <= left_between_lines(other)) return;
    free = std::move(other);
    free.without_laws = false;
    free.periodic_force.resize(0, 0);
    free.runs_away = true;
  }

  // With the own forces alone, after one substitution.
  [[nodiscard]] FreeRecord without_laws(const FreeRecord& free) const {
    FreeRecord other = free;
    other.without_laws = true;
    other.periodic_force.resize(0, 0);
    separate_with(other, MatrixXcd::Zero(free.own.rows(), free.own.cols()));
    add_forces(other);
    separate(other);
    return other;
  }

  void bring_to_agree(FreeRecord& free) const {
    separate(free);  // with the weights of the last round
    AndersonMixing steps(kRemembered);
    MatrixXcd best = free.own;
    double least = std::numeric_limits<double>::infinity();
    for (int step = 0; step < kSteps; ++step) {
      const MatrixXcd before = free.rest;
      add_forces(free);
      separate(free);
      const VectorXcd change = lines_of(free, free.rest - before);
      const double size = change.norm();
      if (size < kSettled) return;
      if (!std::isfinite(size)) break;
      if (size < least) best = free.own;
      least = std::min(least, size);
      steps.add(free.own, change);
      if (step >= kPlainSteps || free.runs_away) separate_with(free, steps.mixed());
    }
    separate_with(free, best);
  }

  // Chi-square.
  [[nodiscard]] double left_between_lines(const FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    double sum = 0.0;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (!is_line(plant, bin)) sum += (weight(plant, bin) * free.rest.col(bin)).squaredNorm();
    }
    return sum;
  }

  void separate_with(FreeRecord& free, MatrixXcd own) const {
    free.own = std::move(own);
    see_own_motion(free);
    separate(free);
  }

  // Whitened and decorrelated.
  [[nodiscard]] VectorXcd lines_of(const FreeRecord& free, const MatrixXcd& bins) const {
    const FreePlant& plant = plants_[free.plant];
    MatrixXcd lines = MatrixXcd::Zero(bins.rows(), data_.last_line + 1);
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      const Index bin = k * plant.periods;
      lines.col(k) = weight(plant, bin) * bins.col(bin);
    }
    VectorXcd column = lines.reshaped();
    free.record->decorrelate(column);
    return column;
  }

  // Of each line from the first that counts.
  [[nodiscard]] std::vector<LineScatter> scatter_of(std::size_t group) const {
    const Index outputs = static_cast<Index>(data_.outputs.size());
    std::vector<LineScatter> scatter(at(data_.line_count()),
                                     {MatrixXcd::Zero(outputs, outputs), 0.0, {}});
    for (const FreeRecord& free : records_) {
      if (free.record->group != group) continue;
      const FreePlant& plant = plants_[free.plant];
      for (Index bin = 1; bin <= plant.bins; ++bin) {
        if (!counts_between_lines(data_, bin, plant.periods)) continue;
        LineScatter& sum = scatter[at(nearest_line(bin, plant.periods) - data_.first_line)];
        sum.scatter += free.rest.col(bin) * free.rest.col(bin).adjoint();
        sum.degrees_of_freedom += std::max(0.0, 1.0 - plant.leverage(bin));
      }
    }
    return scatter;
  }

  void find_common_errors() {
    std::vector<std::shared_ptr<const CommonError>> errors(plants_.size());
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t i = 0; i < plants_.size(); ++i) {
      if (clock_.stops()) continue;
      weigh(plants_[i]);
      errors[i] = std::make_shared<CommonError>(
          common_error(motion_at_lines(plants_[i]), plants_[i].information));
    }
    stop_if_requested();
    for (FreeRecord& free : records_) free.record->common_error = errors[free.plant];
  }

  // What a departure, in units of what it may be, does to the whitened lines.
  [[nodiscard]] MatrixXcd motion_at_lines(const FreePlant& plant) const {
    const Index outputs = plant.motion.back().rows();
    MatrixXcd motion =
        MatrixXcd::Zero(outputs * (data_.last_line + 1), plant.departure_size.size());
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      const Index bin = k * plant.periods;
      motion.middleRows(k * outputs, outputs) =
          weight(plant, bin) * (plant.motion[at(bin)] * plant.departure_size.asDiagonal());
    }
    return motion;
  }

  void take_out(const FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= data_.last_line; ++k) {
      const Index bin = k * record.periods;
      record.input.col(k) = record.input_bins.col(bin);
      record.output.col(k) =
          record.output_bins.col(bin) - (free.excess.col(bin) - free.rest.col(bin));
    }
  }

  // Neither periodic nor free: noise, and what changes with time.
  void keep_between_lines() {
    std::vector<std::shared_ptr<const LinearPlant>> plants;
    for (const FreePlant& plant : plants_) {
      LinearPlant kept = plant.plant;
      kept.derivatives.clear();
      plants.push_back(std::make_shared<const LinearPlant>(std::move(kept)));
    }
    for (FreeRecord& free : records_) {
      free.record->free_plant = plants[free.plant];
      free.record->between_lines = free.rest;
      free.record->free_power = free_power_of(free);
    }
  }

  [[nodiscard]] double free_power_of(const FreeRecord& free) const {
    const FreePlant& plant = plants_[free.plant];
    double power = 0.0;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (!counts_between_lines(data_, bin, plant.periods)) continue;
      power += (weight(plant, bin) * (free.excess.col(bin) - free.rest.col(bin))).squaredNorm();
    }
    return power;
  }

  void take_out_feedback() {
    if (!knows_controller()) return;
#pragma omp parallel num_threads(options_.threads)
    {
      SteadyStateSolver solver(family_, data_, {});
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) {
        if (!clock_.stops()) take_out_feedback(solver, records_[i]);
      }
    }
    stop_if_requested();
  }

  [[nodiscard]] bool knows_controller() const {
    const Index inputs = family_.inverse_controller(data_.frequencies[1]).rows();
    return inputs == family_.input_count() && inputs == family_.output_count();
  }

  // What the controller made of the outputs' noise and free motion, -(G + F^-1)^-1 of them. Of what
  // is more than noise may be, only so much.
  [[nodiscard]] VectorXcd feedback_of(const FreePlant& plant, Index bin, const VectorXcd& noise,
                                      const VectorXcd& free_motion) const {
    const double size =
        (weight(plant, bin) * noise).norm() / std::sqrt(2.0 * static_cast<double>(noise.size()));
    const double share = std::min(1.0, kNoiseAtMost / std::max(size, 1e-300));
    const MatrixXcd loop =
        plant.response[at(bin)] + family_.inverse_controller(frequency(plant, bin));
    return -loop.partialPivLu().solve(share * noise + free_motion);
  }

  // The residual stays what it is, also where the model is not linear.
  void take_out_feedback(SteadyStateSolver& solver, const FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    const FreePlant& plant = plants_[free.plant];
    const MatrixXcd noise = record.output - solver.solve(model_, record, nullptr).output;
    for (Index k = data_.first_line; k <= data_.last_line; ++k) {
      const Index bin = k * plant.periods;
      record.input.col(k) -=
          feedback_of(plant, bin, noise.col(k), free.excess.col(bin) - free.rest.col(bin));
    }
    renew_input_period(record);
    record.output = solver.solve(model_, record, nullptr).output + noise;
  }

  // Whatever earlier rounds did to it.
  void renew_input_period(MeasuredRecord& record) const {
    const Index last = std::min(data_.last_line, (static_cast<Index>(data_.period) - 2) / 2);
    PeriodTransform transform(data_.period, last, data_.period);
    VectorXd times(record.input_period.cols());
    VectorXcd lines(last + 1);
    for (Index c = 0; c < record.input.rows(); ++c) {
      times = record.input_period.row(c).transpose();
      transform.to_lines(times, lines);
      lines = record.input.row(c).head(last + 1).transpose() - lines;
      lines(0) = 0.0;
      transform.to_times(lines, times);
      record.input_period.row(c) += times.transpose();
    }
  }

  const PlantFamily& family_;
  const ModelState& model_;
  const PeriodicDataOptions& options_;
  PeriodicData& data_;
  StopClock clock_;
  std::vector<ForceLaw> laws_;
  bool has_curved_laws_ = false;
  std::vector<FreePlant> plants_;
  std::vector<FreeRecord> records_;
};

}  // namespace

MatrixXcd SampledPlant::sight(Complex z) const {
  MatrixXcd matrix = -triangle;
  matrix.diagonal().array() += z;
  return matrix.triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(output);
}

MatrixXcd SampledPlant::response(Complex z) const { return sight(z) * input; }

VectorXcd SampledPlant::state(Complex z, const VectorXcd& g) const {
  MatrixXcd matrix = -triangle;
  matrix.diagonal().array() += z;
  return vectors * matrix.triangularView<Eigen::Upper>().solve(g);
}

SampledPlant sampled_plant(const LinearPlant& plant, double sample_time) {
  const Index n = plant.mass.rows(), inputs = plant.input.cols();
  const Eigen::PartialPivLU<MatrixXd> mass(plant.mass);  // laws between places leave it unsymmetric
  MatrixXd block = MatrixXd::Zero(2 * n + inputs, 2 * n + inputs);
  block.block(0, n, n, n).setIdentity();
  block.block(n, 0, n, n) = -mass.solve(plant.stiffness);
  block.block(n, n, n, n) = -mass.solve(plant.damping);
  block.block(n, 2 * n, n, inputs) = mass.solve(plant.input);
  const MatrixXd exponential = (block * sample_time).exp();
  const Eigen::ComplexSchur<MatrixXd> schur(exponential.topLeftCorner(2 * n, 2 * n));
  SampledPlant result;
  result.vectors = schur.matrixU();
  result.triangle = schur.matrixT();
  result.input = schur.matrixU().adjoint() * exponential.topRightCorner(2 * n, inputs);
  MatrixXd output(plant.position_output.rows(), 2 * n);
  output << plant.position_output, plant.velocity_output;
  result.output = output * schur.matrixU();
  return result;
}

void clear_transients(const PlantFamily& family, const ModelState& model,
                      const PeriodicDataOptions& options, PeriodicData& data) {
  if (data.estimation.front().output_bins.size() == 0) return;
  Clearing(family, model, options, data).run();
}

}  // namespace graybox
