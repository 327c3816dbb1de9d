#include "diagnosis/free_motion/time_variation.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "diagnosis/free_motion/bins_between_lines.hpp"
#include "diagnosis/free_motion/sampled_plant.hpp"
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

// Records with one plant and one noise, which share what a force at a place does to each bin.
struct RecordGroup {
  const LinearPlant* plant = nullptr;
  std::size_t noise = 0;  // MeasuredRecord::group
  std::vector<const MeasuredRecord*> records;
};

// Of one record at one place.
struct Variation {
  double statistic = 0.0, degrees_of_freedom = 0.0;
  double mean_square = 0.0;                      // of s, with what noise adds
  double noise = 0.0;                            // that
  VectorXcd harmonics;                           // c_m, m = 1 ... P - 1
  double motion_power = 0.0, force_power = 0.0;  // of w, and of the largest force that acts there
  double duration = 0.0;                         // P T
};

class VariationTest {
 public:
  VariationTest(const PlantFamily& family, const PeriodicData& data, const ModelState& model,
                int threads)
      : family_(family), data_(data), model_(model), threads_(threads) {
    list_coefficients();
    list_groups();
  }

  std::vector<VariationScore> run() {
    if (groups_.empty()) return {};
    std::vector<std::vector<Variation>> found;  // of each record, by coefficient
    for (const RecordGroup& group : groups_) {
      const std::vector<MatrixXcd> answers = answers_of(group);
      const std::size_t first = found.size();
      found.resize(first + group.records.size());
      const StopClock clock;
#pragma omp parallel num_threads(threads_)
      {
        SteadyStateSolver solver(family_, data_, {});
#pragma omp for schedule(dynamic)
        for (std::size_t i = 0; i < group.records.size(); ++i) {
          if (clock.stops()) continue;
          found[first + i] = test(solver, *group.records[i], answers);
        }
      }
      stop_if_requested();
    }
    for (std::size_t c = 0; c < scores_.size(); ++c) sum_up(found, c);
    double free_power = 0.0;
    for (const RecordGroup& group : groups_) {
      for (const MeasuredRecord* record : group.records) free_power += record->free_power;
    }
    for (VariationScore& score : scores_) score.free_power = free_power;
    return std::move(scores_);
  }

 private:
  void list_coefficients() {
    for (const CandidatePlace& place : family_.places()) {
      const Location& location = place.location;
      if (place.is_compound || place.is_coupling || location.is_flange || location.driver >= 0) {
        continue;
      }
      if (location.kind != LocationKind::kElement) {
        add(place, Coefficient::kGain);
      } else if (location.input.size() > 0) {
        add(place, Coefficient::kStiffness);
        add(place, Coefficient::kDamping);
      }
    }
  }

  void add(const CandidatePlace& place, Coefficient coefficient) {
    VariationScore& score = scores_.emplace_back();
    score.place = &place;
    score.coefficient = coefficient;
  }

  void list_groups() {
    for (const auto* list : {&data_.estimation, &data_.validation}) {
      for (const MeasuredRecord& record : *list) {
        if (!record.free_plant) continue;
        const auto known = std::ranges::find_if(groups_, [&](const RecordGroup& group) {
          return group.plant == record.free_plant.get() && group.noise == record.group &&
                 group.records.front()->periods == record.periods;
        });
        RecordGroup& group = known == groups_.end() ? groups_.emplace_back() : *known;
        group.plant = record.free_plant.get();
        group.noise = record.group;
        group.records.push_back(&record);
      }
    }
  }

  // What a unit of s w of each coefficient does to the whitened outputs at each bin, n_y x (B + 1).
  [[nodiscard]] std::vector<MatrixXcd> answers_of(const RecordGroup& group) const {
    const MeasuredRecord& record = *group.records.front();
    const Index bins = record.between_lines.cols() - 1;
    const LinearPlant& plant = *group.plant;
    const SampledPlant sampled = sampled_plant(plant, data_.sample_time);
    std::vector<MatrixXcd> answers(scores_.size(),
                                   MatrixXcd::Zero(record.between_lines.rows(), bins + 1));
#pragma omp parallel for num_threads(threads_) schedule(dynamic, 16)
    for (Index bin = 1; bin <= bins; ++bin) {
      if (!counts_between_lines(data_, bin, record.periods)) continue;
      const double w = 2.0 * std::numbers::pi * static_cast<double>(bin) /
                       (static_cast<double>(data_.period) * static_cast<double>(record.periods) *
                        data_.sample_time);
      const MatrixXcd& whitening =
          data_.whitening[group.noise][at(nearest_line(bin, record.periods))];
      const MatrixXcd sight = whitening *
                              (plant.position_output + Complex(0.0, w) * plant.velocity_output) *
                              receptance(plant, w);
      const MatrixXcd response =
          whitening * sampled.response(std::polar(1.0, w * data_.sample_time));
      for (std::size_t c = 0; c < scores_.size(); ++c) {
        const Location& place = scores_[c].place->location;
        auto answer = answers[c].col(bin);
        if (place.kind == LocationKind::kActuator) {
          answer = response.col(place.channel);
        } else if (place.kind == LocationKind::kSensor) {
          answer = whitening.col(place.channel);
        } else {
          answer.noalias() = -sight.leftCols(place.output.size()) * place.output;
        }
      }
    }
    return answers;
  }

  // w at its lines.
  [[nodiscard]] VectorXcd motion_of(const VariationScore& score, const SteadyState& state,
                                    const MeasuredRecord& record) const {
    const Location& place = score.place->location;
    if (place.kind == LocationKind::kActuator) return record.input.row(place.channel).transpose();
    if (place.kind == LocationKind::kSensor) return state.output.row(place.channel).transpose();
    VectorXcd motion = state.coordinates.transpose() * place.input.cast<Complex>();
    if (score.coefficient == Coefficient::kDamping) {
      for (Index k = 0; k < motion.size(); ++k) motion(k) *= Complex(0.0, data_.frequencies[at(k)]);
    }
    return motion;
  }

  [[nodiscard]] std::vector<Variation> test(SteadyStateSolver& solver, const MeasuredRecord& record,
                                            const std::vector<MatrixXcd>& answers) const {
    const SteadyState& state = solver.solve(model_, record, nullptr);
    MatrixXcd left = record.between_lines;
    for (Index bin = 1; bin < left.cols(); ++bin) {
      if (!counts_between_lines(data_, bin, record.periods)) continue;
      left.col(bin) = data_.whitening[record.group][at(nearest_line(bin, record.periods))] *
                      left.col(bin).eval();
    }
    std::vector<Variation> result;
    for (std::size_t c = 0; c < scores_.size(); ++c) {
      const VectorXcd motion = motion_of(scores_[c], state, record);
      result.push_back(score(record, answers[c], motion, left));
      result.back().motion_power = motion.squaredNorm();
      result.back().force_power = scores_[c].coefficient == Coefficient::kGain
                                      ? motion.squaredNorm()
                                      : force_power(*scores_[c].place, state, record);
    }
    return result;
  }

  // The power of the forces along the place: springs, dampers or inertias, whichever is largest.
  [[nodiscard]] double force_power(const CandidatePlace& place, const SteadyState& state,
                                   const MeasuredRecord& record) const {
    const LinearPlant& plant = model_.positions[record.position].plant;
    const VectorXd& b = place.location.input;
    const double size = b.squaredNorm();
    const Eigen::RowVectorXcd spring = (b.transpose() * plant.stiffness) * state.coordinates,
                              damper = (b.transpose() * plant.damping) * state.coordinates,
                              inertia = (b.transpose() * plant.mass) * state.coordinates;
    double of_spring = 0.0, of_damper = 0.0, of_inertia = 0.0;
    for (Index k = 1; k < spring.size(); ++k) {
      const double square = data_.frequencies[at(k)] * data_.frequencies[at(k)];
      of_spring += std::norm(spring(k));
      of_damper += square * std::norm(damper(k));
      of_inertia += square * square * std::norm(inertia(k));
    }
    return std::max({of_spring, of_damper, of_inertia}) / (size * size);
  }

  // Unknowns: Re c_m, Im c_m of m = 1 ... P - 1. A bin with the remainder r by P has the upper side
  // of the line below, m = r, and the lower one of the line above, m = P - r.
  [[nodiscard]] Variation score(const MeasuredRecord& record, const MatrixXcd& answer,
                                const VectorXcd& motion, const MatrixXcd& left) const {
    const Index periods = record.periods, unknowns = 2 * (periods - 1);
    MatrixXd information = MatrixXd::Zero(unknowns, unknowns);
    VectorXd scores = VectorXd::Zero(unknowns);
    MatrixXcd columns(answer.rows(), 4);
    for (Index bin = 1; bin < answer.cols(); ++bin) {
      if (!counts_between_lines(data_, bin, record.periods)) continue;
      const Index below = bin / periods, upper = bin % periods, lower = periods - upper;
      // The place's mean is not among the lines.
      const Complex up = below > 0 ? 0.5 * motion(below) : Complex(0.0);
      const Complex down = below + 1 < motion.size() ? 0.5 * motion(below + 1) : Complex(0.0);
      columns.col(0) = up * answer.col(bin);
      columns.col(1) = Complex(0.0, 1.0) * columns.col(0);
      columns.col(2) = down * answer.col(bin);
      columns.col(3) = Complex(0.0, -1.0) * columns.col(2);
      const Eigen::Matrix4d products = (columns.adjoint() * columns).real();
      const Eigen::Vector4d seen = (columns.adjoint() * left.col(bin)).real();
      const std::array<Index, 4> place{2 * (upper - 1), 2 * (upper - 1) + 1, 2 * (lower - 1),
                                       2 * (lower - 1) + 1};
      for (Index i = 0; i < 4; ++i) {
        scores(place[at(i)]) += seen(i);
        for (Index j = 0; j < 4; ++j) information(place[at(i)], place[at(j)]) += products(i, j);
      }
    }
    return solved(information, scores, record);
  }

  [[nodiscard]] Variation solved(const MatrixXd& information, const VectorXd& scores,
                                 const MeasuredRecord& record) const {
    Variation result;
    const Index pairs = scores.size() / 2;
    result.harmonics = VectorXcd::Zero(pairs);
    result.duration =
        static_cast<double>(data_.period) * static_cast<double>(record.periods) * data_.sample_time;
    const double scale = information.diagonal().maxCoeff();
    if (!(scale > 0.0) || !information.allFinite() || !scores.allFinite()) return result;
    const Eigen::CompleteOrthogonalDecomposition<MatrixXd> inverse(information / scale);
    const VectorXd values = inverse.solve(scores) / scale;
    result.statistic = scores.dot(values);
    result.degrees_of_freedom = static_cast<double>(inverse.rank());
    for (Index m = 0; m < pairs; ++m) result.harmonics(m) = {values(2 * m), values(2 * m + 1)};
    result.mean_square = 0.5 * values.squaredNorm();
    result.noise = 0.5 * inverse.pseudoInverse().trace() / scale;
    return result;
  }

  void sum_up(const std::vector<std::vector<Variation>>& found, std::size_t c) {
    VariationScore& score = scores_[c];
    double mean_square = 0.0, weights = 0.0, motion = 0.0, force = 0.0;
    const Variation* telling = &found.front()[c];
    for (const std::vector<Variation>& record : found) {
      const Variation& variation = record[c];
      motion += variation.motion_power;
      force += variation.force_power;
      score.statistic += variation.statistic;
      score.degrees_of_freedom += variation.degrees_of_freedom;
      if (variation.noise > 0.0) {
        const double weight = 1.0 / (variation.noise * variation.noise);
        mean_square += weight * (variation.mean_square - variation.noise);
        weights += weight;
      }
      if (variation.statistic > telling->statistic) telling = &variation;
    }
    if (weights > 0.0) score.deviation = std::sqrt(std::max(0.0, mean_square / weights));
    if (force > 0.0) score.force_share = score.deviation * std::sqrt(motion / force);
    describe(*telling, score);
  }

  static void describe(const Variation& variation, VariationScore& score) {
    constexpr int kSteps = 200;
    const VectorXcd& harmonics = variation.harmonics;
    Index largest = 0;
    harmonics.cwiseAbs2().maxCoeff(&largest);
    score.duration = variation.duration;
    score.frequency = static_cast<double>(largest + 1) / variation.duration;
    for (int step = 0; step <= kSteps; ++step) {
      double value = 0.0;
      for (Index m = 0; m < harmonics.size(); ++m) {
        const double angle = 2.0 * std::numbers::pi * static_cast<double>((m + 1) * step) / kSteps;
        value += (harmonics(m) * std::polar(1.0, angle)).real();
      }
      score.course.push_back(value);
    }
  }

  const PlantFamily& family_;
  const PeriodicData& data_;
  const ModelState& model_;
  int threads_;
  std::vector<VariationScore> scores_;
  std::vector<RecordGroup> groups_;
};

}  // namespace

std::vector<VariationScore> variation_scores(const PlantFamily& family, const PeriodicData& data,
                                             const ModelState& model, int threads) {
  return VariationTest(family, data, model, threads).run();
}

}  // namespace graybox
