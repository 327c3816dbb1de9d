#include "diagnosis/prediction_error/latent_structure.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/prediction_error/ripple_trials.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kKnots = 16;
constexpr int kOrders = 24;
constexpr int kMemories = 8;  // of 2, 4, 8, ... samples

// A piecewise linear curve through knots at quantiles: hats.
MatrixXd hats(const VectorXd& values) {
  std::vector<double> sorted(values.data(), values.data() + values.size());
  std::ranges::sort(sorted);
  std::vector<double> knots;
  for (Index k = 0; k < kKnots; ++k) {
    const auto at = static_cast<std::size_t>(static_cast<double>(k) / (kKnots - 1) *
                                             static_cast<double>(sorted.size() - 1));
    if (knots.empty() || sorted[at] > knots.back()) knots.push_back(sorted[at]);
  }
  const auto count = static_cast<Index>(knots.size());
  MatrixXd columns = MatrixXd::Zero(values.size(), count);
  if (count < 2) return columns;
  for (Index i = 0; i < values.size(); ++i) {
    const auto above =
        std::clamp<Index>(std::ranges::upper_bound(knots, values(i)) - knots.begin(), 1, count - 1);
    const double low = knots[static_cast<std::size_t>(above - 1)];
    const double width = knots[static_cast<std::size_t>(above)] - low;
    const double share = std::clamp((values(i) - low) / width, 0.0, 1.0);
    columns(i, above - 1) = 1.0 - share;
    columns(i, above) = share;
  }
  return columns;
}

MatrixXd beside_each_other(const MatrixXd& left, const MatrixXd& right) {
  MatrixXd all(left.rows(), left.cols() + right.cols());
  all << left, right;
  return all;
}

MatrixXd of_position(const VectorXd& q) {
  MatrixXd orders(q.size(), 2 * kOrders);
  const double range = std::max(q.maxCoeff() - q.minCoeff(), 1e-300);
  for (int order = 1; order <= kOrders; ++order) {
    const VectorXd angle = 2.0 * std::numbers::pi * order / range * q;
    orders.col(2 * order - 2) = angle.array().cos();
    orders.col(2 * order - 1) = angle.array().sin();
  }
  return beside_each_other(hats(q), orders);
}

MatrixXd of_wave(const VectorXd& q, double period) {
  const Eigen::ArrayXd angle = 2.0 * std::numbers::pi / period * q.array();
  MatrixXd columns(q.size(), 2);
  columns << angle.cos(), angle.sin();
  return columns;
}

std::string_view position_unit(const LumpedModel& model) {
  const bool rotates = std::ranges::any_of(
      model.parameters, [](const LumpedParameter& each) { return each.unit == "kg m^2"; });
  return rotates ? "rad" : "m";
}

bool measures_position(const LumpedModel& model) {
  return std::ranges::any_of(model.outputs, [](const LumpedOutput& output) {
    return output.quantity == LumpedOutput::Quantity::kPosition;
  });
}

MatrixXd of_speed(const VectorXd& v) {
  return beside_each_other(hats(v), v.array().sign().matrix());
}

// Runs one after the other: what was before a run is not known.
MatrixXd of_drive(const MatrixXd& inputs, const std::vector<Index>& starts) {
  MatrixXd columns(inputs.rows(), inputs.cols() * (kMemories + 1));
  for (Index c = 0; c < inputs.cols(); ++c) {
    const Index first = c * (kMemories + 1);
    columns.col(first) = inputs.col(c);
    for (int memory = 1; memory <= kMemories; ++memory) {
      const double kept = std::exp(-std::exp2(-memory));
      double mean = 0.0;
      for (Index k = 0; k < inputs.rows(); ++k) {
        if (std::ranges::binary_search(starts, k)) mean = inputs(k, c);
        mean = kept * mean + (1.0 - kept) * inputs(k, c);
        columns(k, first + memory) = mean;
      }
    }
  }
  return columns;
}

MatrixXd of_load(const MatrixXd& inputs, const VectorXd& v) {
  const MatrixXd sizes = inputs.cwiseAbs();
  return beside_each_other(sizes, v.array().sign().matrix().asDiagonal() * sizes);
}

MatrixXd of_reversals(const VectorXd& q, const std::vector<Index>& starts) {
  constexpr std::array kShares{0.02, 0.1, 0.3};
  MatrixXd columns(q.size(), static_cast<Index>(kShares.size()));
  const double range = q.maxCoeff() - q.minCoeff();
  for (std::size_t w = 0; w < kShares.size(); ++w) {
    const double half = 0.5 * kShares[w] * range;
    double play = q(0);
    for (Index k = 0; k < q.size(); ++k) {
      if (std::ranges::binary_search(starts, k)) play = q(k);
      play = std::clamp(play, q(k) - half, q(k) + half);
      columns(k, static_cast<Index>(w)) = q(k) - play;
    }
  }
  return columns;
}

MatrixXd of_recording(const PredictionTask& task, const PredictionData& data, Index samples) {
  std::vector<std::string> names;
  for (const PredictionRun& run : task.runs) {
    const std::string& name = data.recording(run.recording).name;
    if (std::ranges::count(names, name) == 0) names.push_back(name);
  }
  MatrixXd columns = MatrixXd::Zero(samples, static_cast<Index>(names.size()));
  Index first = 0;
  for (const PredictionRun& run : task.runs) {
    const auto own = std::ranges::find(names, data.recording(run.recording).name) - names.begin();
    columns.col(own).segment(first, run.samples).setOnes();
    first += run.samples;
  }
  return columns;
}

class Asked {
 public:
  Asked(const VectorXd& force, std::vector<Index> rows, BlockEdges edges)
      : moving_(std::move(rows)), force_(force(moving_)), edges_(std::move(edges)) {
    force_.array() -= force_.mean();
    rows_ = static_cast<double>(force_.size()) / static_cast<double>(edges_.size() - 1);
    alone_ = squares({});
  }

  void ask(std::string on, std::string words, const MatrixXd& columns) {
    const VectorXd left = squares(columns(moving_, Eigen::all));
    LatentStructure structure{std::move(on), std::move(words), 0.0, 0.0};
    structure.share = 1.0 - left.sum() / std::max(alone_.sum(), 1e-300);
    structure.z = left_out_z(alone_, left, rows_);
    found_.push_back(std::move(structure));
  }

  [[nodiscard]] std::vector<LatentStructure> take() {
    std::ranges::stable_sort(found_, std::greater{}, &LatentStructure::share);
    return std::move(found_);
  }

 private:
  // Columns of one size, about their means, with a constant.
  [[nodiscard]] VectorXd squares(const MatrixXd& columns) const {
    MatrixXd all(force_.size(), columns.cols() + 1);
    all.col(0).setOnes();
    for (Index c = 0; c < columns.cols(); ++c) {
      const VectorXd about = columns.col(c).array() - columns.col(c).mean();
      const double size = about.norm();
      all.col(c + 1) = size > 0.0 ? VectorXd(about / size) : VectorXd(VectorXd::Zero(about.size()));
    }
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(all);
    const MatrixXd basis = qr.householderQ() * MatrixXd::Identity(all.rows(), qr.rank());
    const VectorXd rest = force_ - basis * (basis.transpose() * force_);
    const auto blocks = static_cast<Index>(edges_.size()) - 1;
    VectorXd result(blocks);
    for (Index b = 0; b < blocks; ++b) {
      const Index from = edges_[static_cast<std::size_t>(b)];
      const Index count = edges_[static_cast<std::size_t>(b) + 1] - from;
      const auto block = basis.middleRows(from, count);
      MatrixXd others = -(block.transpose() * block);
      others.diagonal().array() += 1.0 + kRidge;
      VectorXd left = rest.segment(from, count);
      left += block * others.ldlt().solve(block.transpose() * left);
      result(b) = left.squaredNorm();
    }
    return result;
  }

  static constexpr double kRidge = 0.01;  // for curves that only this block shows
  std::vector<Index> moving_;
  VectorXd force_;
  BlockEdges edges_;
  double rows_ = 1.0;
  VectorXd alone_;
  std::vector<LatentStructure> found_;
};

}  // namespace

std::vector<LatentStructure> latent_structures(const PredictionData& data, ExperimentRole role,
                                               const LumpedModel& model, const LatentForce& force) {
  const PredictionTask task = data.windows(1, role);
  constexpr std::size_t kFewest = 100;  // samples that move
  std::vector<Index> starts;
  MatrixXd inputs(force.force.size(), static_cast<Index>(model.inputs.size()));
  Index first = 0;
  for (const PredictionRun& run : task.runs) {
    starts.push_back(first);
    inputs.middleRows(first, run.samples) =
        data.recording(run.recording).inputs.topRows(run.samples);
    first += run.samples;
  }
  std::vector<Index> driven;
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    if (model.inputs[i].kind == LumpedInput::Kind::kForce) driven.push_back(static_cast<Index>(i));
  }
  const MatrixXd drive = inputs(Eigen::all, driven);
  std::vector<Index> moving = moving_samples(force), units;
  if (moving.size() < kFewest) return {};
  const auto count = static_cast<Index>(moving.size());
  for (Index k = 0; k < count; ++k) units.push_back(k);
  Asked asked(force.force, std::move(moving), block_edges(units, count));
  const Index coordinates = force.motion.cols() / 2, own = force.disturbance.coordinate;
  const auto name = [&](Index i) { return model.mass_names[static_cast<std::size_t>(i)]; };
  const bool has_position = measures_position(model);
  const auto ask_motion = [&](const VectorXd& q, const VectorXd& v, const std::string& place) {
    asked.ask("speed", "the speed of " + place, of_speed(v));
    // What goes on and on is nowhere that it was before, and its position is the time.
    if (lesser_way(v) < kOneWay && !has_position) return;
    asked.ask("position", "the position of " + place, of_position(q));
    asked.ask("reversals", "the reversals of " + place, of_reversals(q, starts));
  };
  ask_motion(force.motion.col(own), force.motion.col(coordinates + own), name(own));
  for (const RippleTrial& trial : ripple_trials(force)) {
    asked.ask("position",
              fmt::format("the position of {}, again every {:.3g} {}", name(own), trial.period,
                          position_unit(model)),
              of_wave(force.motion.col(own), trial.period));
  }
  for (Index other = 0; other < coordinates; ++other) {
    if (other == own || model.stiffness(own, other) == 0.0) continue;
    ask_motion(force.motion.col(own) - force.motion.col(other),
               force.motion.col(coordinates + own) - force.motion.col(coordinates + other),
               fmt::format("{}-{}", name(own), name(other)));
  }
  if (drive.cols() > 0) {
    asked.ask("drive", "the force that acts, and its past", of_drive(drive, starts));
    asked.ask("load", "the size of the force that acts",
              of_load(drive, force.motion.col(coordinates + own)));
  }
  const MatrixXd recordings = of_recording(task, data, force.force.size());
  if (recordings.cols() > 1) asked.ask(kOfRecording, "the recording", recordings);
  return asked.take();
}

}  // namespace graybox
