#include "diagnosis/free_motion/free_records.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "diagnosis/free_motion/bins_between_lines.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_free_force(const ActingLaw& law) {
  return law.place->location.kind == LocationKind::kElement && !is_body(*law.place, *law.entry);
}

// Fills in plants and records. Results do not depend on the threads.
class FreeRecordCollector {
 public:
  explicit FreeRecordCollector(const FreeMotionFrame& frame) : frame_(frame) {}

  FreeRecords collect() {
    for (auto* list : {&frame_.data.estimation, &frame_.data.validation}) {
      for (MeasuredRecord& record : *list) {
        if (record.output_bins.size() > 0) records_.emplace_back().record = &record;
      }
    }
    std::vector<std::vector<MeanSlope>> slopes(records_.size());
#pragma omp parallel num_threads(frame_.options.threads)
    {
      SteadyStateSolver solver(frame_.family, frame_.data, {});
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records_.size(); ++i) {
        if (!frame_.clock.stops()) slopes[i] = describe(solver, records_[i]);
      }
    }
    stop_if_requested();
    for (std::size_t i = 0; i < records_.size(); ++i) share_plant(records_[i], slopes[i]);
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
    for (std::size_t i = 0; i < plants_.size(); ++i) {
      if (!frame_.clock.stops()) describe(plants_[i]);
    }
    stop_if_requested();
#pragma omp parallel for num_threads(frame_.options.threads) schedule(dynamic)
    for (std::size_t i = 0; i < records_.size(); ++i) {
      if (!frame_.clock.stops()) find_excess(records_[i]);
    }
    stop_if_requested();
    return {std::move(plants_), std::move(records_)};
  }

 private:
  // The periodic motion; returns the laws' slopes for small motions about it.
  std::vector<MeanSlope> describe(SteadyStateSolver& solver, FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    for (Index k = 1; k <= frame_.data.last_line; ++k) {
      record.input.col(k) = record.input_bins.col(k * record.periods);
    }
    const SteadyState& state = solver.solve(frame_.model, record, nullptr);
    free.periodic = with_swinging_masses(state.coordinates);
    return mean_slopes(state);
  }

  // Each a coordinate more.
  [[nodiscard]] MatrixXcd with_swinging_masses(const MatrixXcd& coordinates) const {
    MatrixXcd result = coordinates;
    for (const FreeForceLaw& law : frame_.laws) {
      if (!law.linear || !law.linear->swings) continue;
      Eigen::RowVectorXcd mass = law.place->input.transpose() * coordinates;
      for (Index k = 1; k < mass.size(); ++k) {
        mass(k) *= law.linear->transmission(frame_.data.frequencies[at(k)]);
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
      added.plant = frame_.model.positions[record.position].plant;
      added.slopes = slopes;
      add_laws(added);
      added.departure_size = VectorXd::Zero(2 * added.plant.mass.rows());
    }
    FreePlant& shared = plants_[free.plant];
    shared.departure_size =
        shared.departure_size.cwiseMax(size_of_departure(shared.periods, free.periodic));
  }

  void describe(FreePlant& plant) const {
    plant.sampled = sampled_plant(plant.plant, frame_.data.sample_time);
    plant.motion.resize(at(plant.bins) + 1);
    plant.response.resize(at(plant.bins) + 1);
    plant.leverage = VectorXd::Zero(plant.bins + 1);
    for (Index bin = 1; bin <= plant.bins; ++bin) {
      const Complex z = std::polar(1.0, frame_.angle(plant, bin));
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
    for (Index k = 1; k <= frame_.data.last_line; ++k) {
      const VectorXd line = periodic.col(k).cwiseAbs2();
      power.head(n) += line;
      power.tail(n) += frame_.data.frequencies[at(k)] * frame_.data.frequencies[at(k)] * line;
    }
    // From the scale of lines of one period, N^(-1/2), to that of bins, N^(-1/2) / P.
    return std::sqrt(2.0) / static_cast<double>(frame_.data.period) / static_cast<double>(periods) *
           power.cwiseSqrt();
  }

  [[nodiscard]] std::vector<MeanSlope> mean_slopes(const SteadyState& state) const {
    std::vector<MeanSlope> slopes(frame_.laws.size());
    const auto lines = static_cast<double>(frame_.data.excited.size());
    for (Index column = 0; column < state.slopes.cols(); ++column) {
      if (frame_.laws[at(column)].linear) continue;
      MeanSlope& mean = slopes[at(column)];
      for (const std::size_t line : frame_.data.excited) {
        const Complex slope = state.slopes(static_cast<Index>(line), column);
        mean.stiffness += slope.real() / lines;
        mean.damping += slope.imag() / frame_.data.frequencies[line] / lines;
      }
    }
    return slopes;
  }

  // Linear laws as they are; of others the springs and dampers that they are for motions much
  // smaller than those of the record.
  void add_laws(FreePlant& free) const {
    for (std::size_t l = 0; l < frame_.laws.size(); ++l) {
      const FreeForceLaw& law = frame_.laws[l];
      const MeanSlope& mean = free.slopes[l];
      add(law, law.linear.value_or(LinearForce{0.0, mean.damping, mean.stiffness}), free.plant);
    }
  }

  // With a mass r that swings: k (z - r) at the place, and k (r - z) there.
  static void add(const FreeForceLaw& law, const LinearForce& force, LinearPlant& plant) {
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

  const FreeMotionFrame& frame_;
  std::vector<FreePlant> plants_;
  std::vector<FreeRecord> records_;
};

}  // namespace

FreeMotionFrame::FreeMotionFrame(const PlantFamily& plants, const ModelState& state,
                                 const PeriodicDataOptions& reading, PeriodicData& recordings)
    : family(plants), model(state), options(reading), data(recordings) {
  for (const ActingLaw& law : model.laws) {
    if (!is_free_force(law)) continue;
    PeriodicLaw periodic(*law.entry, law.parameters);
    std::optional<LinearForce> linear = periodic.linear_force();
    if (law.entry->name == "offset") linear = LinearForce{};  // constant
    laws.push_back({&law.place->location, std::move(periodic), linear});
  }
  has_curved_laws = std::ranges::any_of(laws, &FreeForceLaw::is_curved);
}

const MatrixXcd& FreeMotionFrame::weight(const FreePlant& plant, Index bin) const {
  const Index line = std::clamp(nearest_line(bin, plant.periods), data.first_line, data.last_line);
  return data.whitening[plant.group][at(line)];
}

double FreeMotionFrame::angle(const FreePlant& plant, Index bin) const {
  const auto samples = static_cast<double>(data.period) * static_cast<double>(plant.periods);
  return 2.0 * std::numbers::pi * static_cast<double>(bin) / samples;
}

double FreeMotionFrame::frequency(const FreePlant& plant, Index bin) const {
  return angle(plant, bin) / data.sample_time;
}

FreeRecords collect_free_records(const FreeMotionFrame& frame) {
  return FreeRecordCollector(frame).collect();
}

}  // namespace graybox
