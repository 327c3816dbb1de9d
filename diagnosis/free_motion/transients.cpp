#include "diagnosis/free_motion/transients.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "diagnosis/free_motion/bins_between_lines.hpp"
#include "diagnosis/free_motion/free_feedback.hpp"
#include "diagnosis/free_motion/free_forces.hpp"
#include "diagnosis/free_motion/free_records.hpp"
#include "diagnosis/harmonic_balance/anderson_mixing.hpp"
#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/responses/covariance_pool.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

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

// The free motion of all records by weighted least squares, with the noise that weighs it, and what
// it leaves of the lines.
class FreeMotionRemoval {
 public:
  explicit FreeMotionRemoval(const FreeMotionFrame& frame)
      : frame_(frame), free_(collect_free_records(frame)), forces_(frame, free_.plants) {}

  void run() {
    for (int round = 0; round < kRounds; ++round) {
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
      for (std::size_t i = 0; i < free_.plants.size(); ++i) {
        if (!frame_.clock.stops()) weigh(free_.plants[i]);
      }
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
      for (std::size_t i = 0; i < free_.records.size(); ++i) {
        if (frame_.clock.stops()) continue;
        if (round > 0) forces_.add_forces(free_.records[i]);
        separate(free_.records[i]);
        if (round > 0) leave_out_laws_if_worse(free_.records[i]);
      }
      stop_if_requested();
      whiten();
    }
    settle();
    for (FreeRecord& free : free_.records) take_out(free);
    find_common_errors();
    keep_between_lines();
    take_out_feedback(frame_, free_);
  }

 private:
  // Real and imaginary rows of what a departure does at a bin, weighted; its columns in units of
  // what a departure may be.
  void weighted_motion(const FreePlant& plant, Index bin, Eigen::Ref<MatrixXd> rows) const {
    const Index outputs = rows.rows() / 2;
    const MatrixXcd weighted =
        frame_.weight(plant, bin) * (plant.motion[at(bin)] * plant.departure_size.asDiagonal());
    rows.topRows(outputs) = weighted.real();
    rows.bottomRows(outputs) = weighted.imag();
  }

  // The information about the free motion of a record between the lines, and what its error does to
  // each bin. The identity shrinks it to what it may be where the data do not see it.
  void weigh(FreePlant& plant) const {
    const Index outputs = plant.motion.back().rows(), states = plant.motion.back().cols();
    MatrixXd information = MatrixXd::Identity(states, states), rows(2 * outputs, states);
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (plant.is_line(bin)) continue;
      weighted_motion(plant, bin, rows);
      information.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
    }
    plant.information.compute(information);  // of the lower triangle
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (plant.is_line(bin)) continue;
      weighted_motion(plant, bin, rows);
      plant.leverage(bin) = plant.information.matrixL().solve(rows.transpose()).squaredNorm() /
                            (2.0 * static_cast<double>(outputs));
    }
  }

  // The free motion by weighted least squares between the lines.
  void separate(FreeRecord& free) const {
    const FreePlant& plant = free_.plants[free.plant];
    VectorXd scores = VectorXd::Zero(plant.departure_size.size());
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (plant.is_line(bin)) continue;
      const MatrixXcd& whitening = frame_.weight(plant, bin);
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

  void whiten() {
    std::vector<double> frequencies(frame_.data.frequencies.begin() + frame_.data.first_line,
                                    frame_.data.frequencies.end());
    for (std::size_t group = 0; group < frame_.data.whitening.size(); ++group) {
      const std::vector<LineScatter> scatter = scatter_of(group);
      const Index outputs = static_cast<Index>(frame_.data.outputs.size());
      const double wanted = wanted_noise_samples(frame_.options, outputs);
      const auto pooled = pool_covariances(scatter, frequencies, wanted);
      frame_.data.noise_pools[group] = pool_of(scatter, pooled);
      const MatrixXd level = output_level(frame_.data, group);
      for (Index k = frame_.data.first_line; k <= frame_.data.last_line; ++k) {
        const std::size_t i = at(k - frame_.data.first_line);
        const double inflation = inverse_bias(pooled[i].degrees_of_freedom, outputs);
        const auto whitening = whitening_of(inflation * pooled[i].covariance, level.col(k),
                                            frame_.options.model_accuracy);
        if (whitening) frame_.data.whitening[group][at(k)] = *whitening;
      }
    }
  }

  // Near a resonance a small change of these forces is a large one of the motion, and a few rounds
  // are not enough.
  void settle() {
    if (std::ranges::all_of(free_.records, [](const FreeRecord& f) { return f.own.size() == 0; }))
      return;
    find_common_errors();
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
    for (std::size_t i = 0; i < free_.records.size(); ++i) {
      if (!frame_.clock.stops()) settle(free_.records[i]);
    }
    stop_if_requested();
    whiten();
  }

  // Laws that are far from straight may not be brought to agree with the free motion: then they
  // count by their mean slopes.
  void settle(FreeRecord& free) const {
    if (free.own.size() == 0) return;
    bring_to_agree(free);
    if (!frame_.has_curved_laws) return;
    FreeRecord other = without_laws(free);
    bring_to_agree(other);
    if (!(left_between_lines(free) <= left_between_lines(other))) free = std::move(other);
  }

  // For this round; the next begins with them again.
  void leave_out_laws_if_worse(FreeRecord& free) const {
    if (!frame_.has_curved_laws || free.own.size() == 0) return;
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
    forces_.add_forces(other);
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
      forces_.add_forces(free);
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
    const FreePlant& plant = free_.plants[free.plant];
    double sum = 0.0;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (!plant.is_line(bin))
        sum += (frame_.weight(plant, bin) * free.rest.col(bin)).squaredNorm();
    }
    return sum;
  }

  void separate_with(FreeRecord& free, MatrixXcd own) const {
    free.own = std::move(own);
    forces_.see_own_motion(free);
    separate(free);
  }

  // Whitened and decorrelated.
  [[nodiscard]] VectorXcd lines_of(const FreeRecord& free, const MatrixXcd& bins) const {
    const FreePlant& plant = free_.plants[free.plant];
    MatrixXcd lines = MatrixXcd::Zero(bins.rows(), frame_.data.last_line + 1);
    for (Index k = frame_.data.first_line; k <= frame_.data.last_line; ++k) {
      const Index bin = k * plant.periods;
      lines.col(k) = frame_.weight(plant, bin) * bins.col(bin);
    }
    VectorXcd column = lines.reshaped();
    free.record->decorrelate(column);
    return column;
  }

  // Of each line from the first that counts.
  [[nodiscard]] std::vector<LineScatter> scatter_of(std::size_t group) const {
    const Index outputs = static_cast<Index>(frame_.data.outputs.size());
    std::vector<LineScatter> scatter(at(frame_.data.line_count()),
                                     {MatrixXcd::Zero(outputs, outputs), 0.0, {}});
    for (const FreeRecord& free : free_.records) {
      if (free.record->group != group) continue;
      const FreePlant& plant = free_.plants[free.plant];
      for (Index bin = 1; bin <= plant.bins; ++bin) {
        if (!counts_between_lines(frame_.data, bin, plant.periods)) continue;
        LineScatter& sum = scatter[at(nearest_line(bin, plant.periods) - frame_.data.first_line)];
        sum.scatter += free.rest.col(bin) * free.rest.col(bin).adjoint();
        sum.degrees_of_freedom += std::max(0.0, 1.0 - plant.leverage(bin));
      }
    }
    return scatter;
  }

  void find_common_errors() {
    std::vector<std::shared_ptr<const CommonError>> errors(free_.plants.size());
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
    for (std::size_t i = 0; i < free_.plants.size(); ++i) {
      if (frame_.clock.stops()) continue;
      weigh(free_.plants[i]);
      errors[i] = std::make_shared<CommonError>(
          common_error(motion_at_lines(free_.plants[i]), free_.plants[i].information));
    }
    stop_if_requested();
    for (FreeRecord& free : free_.records) free.record->common_error = errors[free.plant];
  }

  // What a departure, in units of what it may be, does to the whitened lines.
  [[nodiscard]] MatrixXcd motion_at_lines(const FreePlant& plant) const {
    const Index outputs = plant.motion.back().rows();
    MatrixXcd motion =
        MatrixXcd::Zero(outputs * (frame_.data.last_line + 1), plant.departure_size.size());
    for (Index k = frame_.data.first_line; k <= frame_.data.last_line; ++k) {
      const Index bin = k * plant.periods;
      motion.middleRows(k * outputs, outputs) =
          frame_.weight(plant, bin) * (plant.motion[at(bin)] * plant.departure_size.asDiagonal());
    }
    return motion;
  }

  void take_out(const FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= frame_.data.last_line; ++k) {
      const Index bin = k * record.periods;
      record.input.col(k) = record.input_bins.col(bin);
      record.output.col(k) =
          record.output_bins.col(bin) - (free.excess.col(bin) - free.rest.col(bin));
    }
  }

  // Neither periodic nor free: noise, and what changes with time.
  void keep_between_lines() {
    std::vector<std::shared_ptr<const LinearPlant>> plants;
    for (const FreePlant& plant : free_.plants) {
      LinearPlant kept = plant.plant;
      kept.derivatives.clear();
      plants.push_back(std::make_shared<const LinearPlant>(std::move(kept)));
    }
    for (FreeRecord& free : free_.records) {
      free.record->free_plant = plants[free.plant];
      free.record->between_lines = free.rest;
      free.record->free_power = free_power_of(free);
    }
  }

  [[nodiscard]] double free_power_of(const FreeRecord& free) const {
    const FreePlant& plant = free_.plants[free.plant];
    double power = 0.0;
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      if (!counts_between_lines(frame_.data, bin, plant.periods)) continue;
      power +=
          (frame_.weight(plant, bin) * (free.excess.col(bin) - free.rest.col(bin))).squaredNorm();
    }
    return power;
  }

  const FreeMotionFrame& frame_;
  FreeRecords free_;
  FreeMotionForces forces_;
};

}  // namespace

void clear_transients(const PlantFamily& family, const ModelState& model,
                      const PeriodicDataOptions& options, PeriodicData& data) {
  if (data.estimation.front().output_bins.size() == 0) return;
  const FreeMotionFrame frame(family, model, options, data);
  FreeMotionRemoval(frame).run();
}

}  // namespace graybox
