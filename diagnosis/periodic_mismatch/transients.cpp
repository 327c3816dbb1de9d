#include "graybox/diagnosis/periodic_mismatch/transients.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "graybox/diagnosis/periodic_mismatch/noise_whitening.hpp"
#include "graybox/diagnosis/periodic_mismatch/period_transform.hpp"
#include "graybox/diagnosis/responses/covariance_pool.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr int kRounds = 3;  // of weights and noise

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

// One record at its bins 1 ... B.
struct FreeRecord {
  MeasuredRecord* record = nullptr;
  Index periods = 1, bins = 0;  // B
  LinearPlant plant;            // with the laws' mean slopes
  SampledPlant sampled;
  MatrixXcd periodic;             // q of the steady state, n x (K + 1)
  MatrixXcd excess;               // Y - G U, n_y x (B + 1)
  std::vector<MatrixXcd> motion;  // z C (z I - A)^-1, n_y x 2n each
  VectorXd departure_size;        // 2n, what |d| is expected to be at most
  // Of the last round:
  VectorXd departure;  // d
  MatrixXcd own;       // q by what own forces add with the free motion, n x (B + 1)
  MatrixXcd own_seen;  // the same at the outputs, n_y x (B + 1)
  MatrixXcd rest;      // excess without all that
  VectorXd leverage;   // of each bin, mean over the outputs
};

class Clearing {
 public:
  Clearing(const PlantFamily& family, const ModelState& model, const PeriodicDataOptions& options,
           PeriodicData& data)
      : family_(family), model_(model), options_(options), data_(data) {}

  void run() {
    collect();
    for (int round = 0; round < kRounds; ++round) {
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) {
        if (round > 0) add_own_forces(records_[i]);
        separate(records_[i]);
      }
      whiten();
    }
    for (FreeRecord& free : records_) take_out(free);
  }

 private:
  static bool is_line(const FreeRecord& free, Index bin) { return bin % free.periods == 0; }
  static Index nearest_line(const FreeRecord& free, Index bin) {
    return (bin + (free.periods - 1) / 2) / free.periods;
  }
  [[nodiscard]] const MatrixXcd& weight(const FreeRecord& free, Index bin) const {
    const Index line = std::clamp(nearest_line(free, bin), data_.first_line, data_.last_line);
    return data_.whitening[free.record->group][at(line)];
  }

  void collect() {
    for (auto* list : {&data_.estimation, &data_.validation}) {
      for (MeasuredRecord& record : *list) {
        if (record.output_bins.size() == 0) continue;
        FreeRecord& free = records_.emplace_back();
        free.record = &record;
        free.periods = record.periods;
        free.bins = record.output_bins.cols() - 1;
      }
    }
#pragma omp parallel num_threads(options_.threads)
    {
      SteadyStateSolver solver(family_, data_, {});
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) describe(solver, records_[i]);
    }
  }

  // On the unit circle of z.
  [[nodiscard]] double angle(const FreeRecord& free, Index bin) const {
    const auto samples = static_cast<double>(data_.period) * static_cast<double>(free.periods);
    return 2.0 * std::numbers::pi * static_cast<double>(bin) / samples;
  }
  [[nodiscard]] double frequency(const FreeRecord& free, Index bin) const {
    return angle(free, bin) / data_.sample_time;
  }

  void describe(SteadyStateSolver& solver, FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= data_.last_line; ++k) {
      record.input.col(k) = record.input_bins.col(k * free.periods);
    }
    const SteadyState& state = solver.solve(model_, record, nullptr);
    free.periodic = state.coordinates;
    free.plant = model_.positions[record.position].plant;
    add_mean_slopes(state, free.plant);
    free.sampled = sampled_plant(free.plant, data_.sample_time);
    free.excess = free.own_seen = MatrixXcd::Zero(record.output_bins.rows(), free.bins + 1);
    free.own = MatrixXcd::Zero(free.periodic.rows(), free.bins + 1);
    free.rest = free.excess;
    free.leverage = VectorXd::Zero(free.bins + 1);
    free.departure_size = size_of_departure(free);
    free.motion.resize(at(free.bins) + 1);
    for (Index bin = 1; bin <= free.bins; ++bin) {
      const Complex z = std::polar(1.0, angle(free, bin));
      const MatrixXcd sight = free.sampled.sight(z);
      free.excess.col(bin) =
          record.output_bins.col(bin) - sight * (free.sampled.input * record.input_bins.col(bin));
      free.motion[at(bin)] = z * sight * free.sampled.vectors.adjoint();
    }
  }

  // The rms of the periodic motion: a free motion of that size is no rarity, a larger one is.
  [[nodiscard]] VectorXd size_of_departure(const FreeRecord& free) const {
    const Index n = free.periodic.rows();
    VectorXd power = VectorXd::Zero(2 * n);
    for (Index k = 1; k <= data_.last_line; ++k) {
      const VectorXd line = free.periodic.col(k).cwiseAbs2();
      power.head(n) += line;
      power.tail(n) += data_.frequencies[at(k)] * data_.frequencies[at(k)] * line;
    }
    // From the scale of lines of one period, N^(-1/2), to that of bins, N^(-1/2) / P.
    return std::sqrt(2.0) / static_cast<double>(data_.period) / static_cast<double>(free.periods) *
           power.cwiseSqrt();
  }

  // Springs and dampers that laws are for motions much smaller than those of the record.
  void add_mean_slopes(const SteadyState& state, LinearPlant& plant) const {
    Index column = 0;
    for (const ActingLaw& law : model_.laws) {
      const Location& place = law.place->location;
      if (place.kind != LocationKind::kElement || is_body(*law.place, *law.entry)) continue;
      double stiffness = 0.0, damping = 0.0;
      for (const std::size_t line : data_.excited) {
        const Complex slope = state.slopes(static_cast<Index>(line), column);
        stiffness += slope.real() / static_cast<double>(data_.excited.size());
        damping +=
            slope.imag() / data_.frequencies[line] / static_cast<double>(data_.excited.size());
      }
      plant.stiffness += stiffness * place.output * place.input.transpose();
      plant.damping += damping * place.output * place.input.transpose();
      ++column;
    }
  }

  // Real and imaginary rows of what a departure does at a bin, weighted; its columns in units of what a
  // departure may be.
  void weighted_motion(const FreeRecord& free, Index bin, Eigen::Ref<MatrixXd> rows) const {
    const Index outputs = free.excess.rows();
    const MatrixXcd weighted =
        weight(free, bin) * (free.motion[at(bin)] * free.departure_size.asDiagonal());
    rows.topRows(outputs) = weighted.real();
    rows.bottomRows(outputs) = weighted.imag();
  }

  // The free motion by weighted least squares between the lines, shrunk to what it may be where the data
  // do not see it.
  void separate(FreeRecord& free) const {
    const Index outputs = free.excess.rows(), states = free.motion.back().cols();
    MatrixXd information = MatrixXd::Identity(states, states), rows(2 * outputs, states);
    VectorXd scores = VectorXd::Zero(states), values(2 * outputs);
    for (Index bin = 1; bin <= free.bins; ++bin) {
      if (is_line(free, bin)) continue;
      weighted_motion(free, bin, rows);
      const VectorXcd weighted =
          weight(free, bin) * (free.excess.col(bin) - free.own_seen.col(bin));
      values << weighted.real(), weighted.imag();
      information.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
      scores += rows.transpose() * values;
    }
    const Eigen::LLT<MatrixXd> factor(information);  // of the lower triangle
    free.departure = free.departure_size.cwiseProduct(factor.solve(scores));
    for (Index bin = 1; bin <= free.bins; ++bin) {
      free.rest.col(bin) =
          free.excess.col(bin) - free.own_seen.col(bin) - free.motion[at(bin)] * free.departure;
      weighted_motion(free, bin, rows);
      free.leverage(bin) = factor.matrixL().solve(rows.transpose()).squaredNorm() /
                           (2.0 * static_cast<double>(outputs));
    }
  }

  // What own forces add where the free motion of the last round meets the periodic one.
  void add_own_forces(FreeRecord& free) const {
    const auto own = family_.own_force(free.plant, model_.bodies);
    if (own == nullptr) return;
    const std::size_t samples = data_.period * static_cast<std::size_t>(free.periods);
    PeriodTransform transform(samples, free.bins, fast_grid(3 * at(free.bins)));
    const MatrixXcd periodic = coordinates_at_bins(free);
    MatrixXcd both = periodic + free.own;
    const VectorXcd departure = free.sampled.vectors.adjoint() * free.departure;
    for (Index bin = 1; bin <= free.bins; ++bin) {
      const Complex z = std::polar(1.0, angle(free, bin));
      VectorXcd cause = z * departure;
      if (!is_line(free, bin)) cause += free.sampled.input * free.record->input_bins.col(bin);
      both.col(bin) += free.sampled.state(z, cause).head(both.rows());
    }
    const MatrixXcd force =
        force_of(*own, free, both, transform) - force_of(*own, free, periodic, transform);
    for (Index bin = 1; bin <= free.bins; ++bin) {
      const double w = frequency(free, bin);
      free.own.col(bin) = receptance(free.plant, w) * force.col(bin);
      free.own_seen.col(bin) = free.plant.position_output * free.own.col(bin) +
                               Complex(0.0, w) * (free.plant.velocity_output * free.own.col(bin));
    }
  }

  static MatrixXcd coordinates_at_bins(const FreeRecord& free) {
    MatrixXcd result = MatrixXcd::Zero(free.periodic.rows(), free.bins + 1);
    for (Index k = 0; k < free.periodic.cols(); ++k) {
      result.col(k * free.periods) = free.periodic.col(k);
    }
    return result;
  }

  // Bins of the own force under a motion of these bins.
  MatrixXcd force_of(OwnForce& own, const FreeRecord& free, const MatrixXcd& coordinates,
                     PeriodTransform& transform) const {
    // Bins are scaled as lines of one period, the transform is of all.
    const double scale = std::sqrt(static_cast<double>(free.periods));
    const Index n = coordinates.rows();
    MatrixXd q(n, transform.grid()), velocity = q, acceleration = q, force;
    VectorXd times(transform.grid());
    for (Index i = 0; i < n; ++i) {
      VectorXcd spectrum = scale * coordinates.row(i).transpose();
      for (MatrixXd* target : {&q, &velocity, &acceleration}) {
        transform.to_times(spectrum, times);
        target->row(i) = times.transpose();
        for (Index bin = 0; bin <= free.bins; ++bin) {
          spectrum(bin) *= Complex(0.0, frequency(free, bin));
        }
      }
    }
    own.evaluate(q, velocity, acceleration, force);
    MatrixXcd result(n, free.bins + 1);
    VectorXcd spectrum(free.bins + 1);
    for (Index i = 0; i < n; ++i) {
      times = force.row(i).transpose();
      transform.to_lines(times, spectrum);
      result.row(i) = spectrum.transpose() / scale;
    }
    return result;
  }

  void whiten() {
    data_.noise_degrees_of_freedom = 0.0;
    std::vector<double> frequencies(data_.frequencies.begin() + data_.first_line,
                                    data_.frequencies.end());
    for (std::size_t group = 0; group < data_.whitening.size(); ++group) {
      const std::vector<LineScatter> scatter = scatter_of(group);
      const Index outputs = static_cast<Index>(data_.outputs.size());
      const double wanted = wanted_noise_samples(options_, outputs);
      const auto pooled = pool_covariances(scatter, frequencies, wanted);
      data_.noise_pools[group] = pool_of(pooled);
      const VectorXd leverage = line_leverage(group);
      const MatrixXd level = output_level(data_, group);
      for (Index k = data_.first_line; k <= data_.last_line; ++k) {
        const std::size_t i = at(k - data_.first_line);
        data_.noise_degrees_of_freedom +=
            2.0 * static_cast<double>(outputs) * scatter[i].degrees_of_freedom;
        const double inflation =
            (1.0 + leverage(k)) * inverse_bias(pooled[i].degrees_of_freedom, outputs);
        const auto whitening =
            whitening_of(inflation * pooled[i].covariance, level.col(k), options_.model_accuracy);
        if (whitening) data_.whitening[group][at(k)] = *whitening;
      }
    }
  }

  // Of each line from the first that counts.
  [[nodiscard]] std::vector<LineScatter> scatter_of(std::size_t group) const {
    const Index outputs = static_cast<Index>(data_.outputs.size());
    std::vector<LineScatter> scatter(at(data_.line_count()),
                                     {MatrixXcd::Zero(outputs, outputs), 0.0, {}});
    for (const FreeRecord& free : records_) {
      if (free.record->group != group) continue;
      for (Index bin = 1; bin <= free.bins; ++bin) {
        const Index line = nearest_line(free, bin);
        if (is_line(free, bin) || line < data_.first_line || line > data_.last_line) continue;
        LineScatter& sum = scatter[at(line - data_.first_line)];
        sum.scatter += free.rest.col(bin) * free.rest.col(bin).adjoint();
        sum.degrees_of_freedom += std::max(0.0, 1.0 - free.leverage(bin));
      }
    }
    return scatter;
  }

  // What the error of the free motion adds to the noise of each line, on average of the group.
  [[nodiscard]] VectorXd line_leverage(std::size_t group) const {
    VectorXd sum = VectorXd::Zero(data_.last_line + 1);
    double count = 0.0;
    for (const FreeRecord& free : records_) {
      if (free.record->group != group) continue;
      for (Index k = 1; k <= data_.last_line; ++k) sum(k) += free.leverage(k * free.periods);
      count += 1.0;
    }
    return sum / std::max(count, 1.0);
  }

  void take_out(const FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= data_.last_line; ++k) {
      const Index bin = k * free.periods;
      record.input.col(k) = record.input_bins.col(bin);
      record.output.col(k) =
          record.output_bins.col(bin) - (free.excess.col(bin) - free.rest.col(bin));
    }
  }

  const PlantFamily& family_;
  const ModelState& model_;
  const PeriodicDataOptions& options_;
  PeriodicData& data_;
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
  const Eigen::LLT<MatrixXd> mass(plant.mass);
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
