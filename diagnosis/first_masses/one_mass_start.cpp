#include "diagnosis/first_masses/one_mass_start.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "diagnosis/first_masses/free_response.hpp"
#include "diagnosis/signal_faults/lost_samples.hpp"
#include "diagnosis/signal_faults/spike.hpp"
#include "diagnosis/signals/drive_work.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostSamples = 20000, kFewestSamples = 20;
constexpr int kGroups = 10;           // of the jackknife
constexpr double kSureEnough = 0.2;   // of the inertia, to take a richer list of forces
constexpr double kToldEnough = 0.33;  // of the inertia
constexpr double kProved = 5.0;       // errors, for a sign that nothing else explains
constexpr double kHalf = 0.5;         // of the squares that are left without the drive
constexpr double kLonger = 2.0;       // errors, for longer segments
constexpr double kFastest = 0.9;      // pole times sample time
constexpr double kRidge = 1e-12;

// ---- the log ------------------------------------------------------------------------------------

VectorXd averaged(const VectorXd& signal, Index over) {
  VectorXd result(signal.size() / over);
  for (Index k = 0; k < result.size(); ++k) result(k) = signal.segment(k * over, over).mean();
  return result;
}

VectorXd without_spikes(VectorXd signal, bool is_velocity) {
  for (const Spike& spike : find_spikes(signal)) {
    const Index k = spike.sample;
    signal(k) = signal(k > 0 ? k - 1 : k);
  }
  const auto start = find_stale_start(signal);
  if (start && !(is_velocity && may_have_set_off(signal, *start))) {
    signal.head(start->samples).setConstant(signal(start->samples));
  }
  return signal;
}

OneMassLog shortened(const OneMassLog& log, Index over) {
  OneMassLog result = log;
  result.motion = without_spikes(log.motion, log.is_velocity);
  if (over < 2) return result;
  result.force = averaged(log.force, over);
  result.motion = averaged(result.motion, over);
  result.sample_time = static_cast<double>(over) * log.sample_time;
  return result;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// What a signal can tell apart: its step where it is a counter's, else twice its noise.
double resolution_of(const VectorXd& signal) {
  std::vector<double> steps, bends;
  Index still = 0;
  for (Index k = 1; k < signal.size(); ++k) {
    const double step = std::abs(signal(k) - signal(k - 1));
    if (step > 0.0) steps.push_back(step);
    if (!(step > 0.0)) ++still;
    if (k > 1) bends.push_back(std::abs(signal(k) - 2.0 * signal(k - 1) + signal(k - 2)));
  }
  constexpr double kOften = 0.3, kOfMedian = 1.4826;
  const double noise = 2.0 * kOfMedian * median_of(bends) / std::sqrt(6.0);
  const bool is_counter = static_cast<double>(still) > kOften * static_cast<double>(signal.size());
  return is_counter ? std::max(noise, median_of(steps)) : noise;
}

// Which way the mass moves, -1 to 1: over as many samples as the resolution asks for.
VectorXd direction_of(const OneMassLog& log) {
  const Index n = log.motion.size();
  const double resolution = resolution_of(log.motion);
  constexpr double kClear = 5.0, kStill = 0.01;
  VectorXd rate = log.motion;
  double least = 2.0 * resolution;
  if (!log.is_velocity) {
    Index half = 1;
    for (; half < n / 100; half *= 2) {
      const VectorXd moved = log.motion.tail(n - 2 * half) - log.motion.head(n - 2 * half);
      if (moved.norm() > kClear * resolution * std::sqrt(static_cast<double>(n))) break;
    }
    for (Index k = 0; k < n; ++k) {
      rate(k) = log.motion(std::min(n - 1, k + half)) - log.motion(std::max<Index>(0, k - half));
    }
    least = resolution;
  }
  const double still = std::max({kStill * rate.cwiseAbs().maxCoeff(), least, 1e-300});
  return (rate / still).cwiseMax(-1.0).cwiseMin(1.0);
}

// What all logs of one mass have in common.
struct CommonMotion {
  bool swings = false;  // through more than a large angle, so that a weight turns
  double mean = 0.0;    // of the place

  explicit CommonMotion(const std::vector<OneMassLog>& logs) {
    constexpr double kLargeAngle = 1.0;  // rad
    double sum = 0.0, count = 0.0;
    for (const OneMassLog& log : logs) {
      const double span = log.motion.maxCoeff() - log.motion.minCoeff();
      swings = swings || (!log.is_velocity && log.is_rotary && span > kLargeAngle);
      sum += log.motion.sum();
      count += static_cast<double>(log.motion.size());
    }
    mean = sum / count;
  }
};

// The forces: drive, constant, dry friction, weight or spring. Those of a list come first.
MatrixXd forces_of(const OneMassLog& log, const CommonMotion& common) {
  const Index n = log.motion.size();
  const bool has_place = !log.is_velocity, swings = common.swings;
  MatrixXd forces(n, 3 + (swings ? 2 : has_place ? 1 : 0));
  forces.col(0) = log.force;
  forces.col(1).setOnes();
  forces.col(2) = direction_of(log);
  if (swings) {
    forces.col(3) = log.motion.array().sin();
    forces.col(4) = log.motion.array().cos();
  } else if (has_place) {
    forces.col(3) = log.motion.array() - common.mean;
  }
  return forces;
}

// Drive, constant and dry friction with a spring, and with a weight where the mass turns. A speed
// is summed up to the place, from wherever it began.
std::vector<MatrixXd> forces_beside(const OneMassLog& log) {
  const Index n = log.motion.size();
  VectorXd place = log.motion;
  if (log.is_velocity) {
    for (Index k = 0; k < n; ++k) {
      place(k) = (k > 0 ? place(k - 1) : 0.0) + log.sample_time * log.motion(k);
    }
  }
  MatrixXd forces(n, 4);
  forces.col(0) = log.force;
  forces.col(1).setOnes();
  forces.col(2) = direction_of(log);
  forces.col(3) = place.array() - place.mean();
  std::vector<MatrixXd> lists{forces};
  if (log.is_rotary) {
    forces.conservativeResize(n, 5);
    forces.col(3) = place.array().sin();
    forces.col(4) = place.array().cos();
    lists.push_back(forces);
  }
  return lists;
}

// ---- least squares over segments ----------------------------------------------------------------

// Products of all columns and the motion with each other, by groups of segments, for each pole.
struct GroupProducts {
  double pole;
  std::vector<MatrixXd> groups;
  [[nodiscard]] MatrixXd but(int left_out) const {
    MatrixXd sum = MatrixXd::Zero(groups.front().rows(), groups.front().cols());
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (static_cast<int>(g) != left_out) sum += groups[g];
    }
    return sum;
  }
};

struct SegmentSolution {
  double pole = 0.0;
  VectorXd values;                                               // of the forces
  double left = std::numeric_limits<double>::infinity();         // squares
  double without_drive = 0.0, without_place = 0.0, total = 0.0;  // squares, too
};

// Least squares of the motion on the first `count` columns.
std::pair<VectorXd, double> solved(const MatrixXd& products, Index count, Index first = 0) {
  const Index last = products.rows() - 1, n = count - first;
  const double total = products(last, last);
  if (n == 0) return {VectorXd(), total};
  VectorXd scale =
      products.diagonal().segment(first, n).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  MatrixXd normal = scale.asDiagonal() * products.block(first, first, n, n) * scale.asDiagonal();
  normal.diagonal().array() += kRidge;
  const VectorXd right = scale.cwiseProduct(products.col(last).segment(first, n));
  const VectorXd values = normal.ldlt().solve(right);
  return {scale.cwiseProduct(values), std::max(0.0, total - values.dot(right))};
}

SegmentSolution best_of(const std::vector<GroupProducts>& poles, Index count, int left_out) {
  SegmentSolution best;
  for (const GroupProducts& each : poles) {
    const MatrixXd products = each.but(left_out);
    const auto [values, left] = solved(products, count);
    if (!values.allFinite() || !(left < best.left)) continue;
    best = {each.pole,
            values,
            left,
            solved(products, count, 1).second,
            solved(products, std::min<Index>(count, 3)).second,
            products(products.rows() - 1, products.cols() - 1)};
  }
  return best;
}

struct MassCandidate {
  SegmentSolution solution;
  double error = std::numeric_limits<double>::infinity();  // of 1/J over its size
  Index forces = 0, length = 0;
};

MassCandidate judged(const std::vector<GroupProducts>& poles, Index count, Index length) {
  MassCandidate result;
  result.solution = best_of(poles, count, -1);
  result.forces = count;
  result.length = length;
  const auto groups = static_cast<int>(poles.front().groups.size());
  if (groups < 3 || result.solution.values.size() == 0) return result;
  VectorXd each(groups);
  for (int g = 0; g < groups; ++g) {
    const SegmentSolution other = best_of(poles, count, g);
    if (other.values.size() == 0) return result;
    each(g) = other.values(0);
  }
  const double variance = (each.array() - each.mean()).square().sum() * (groups - 1) / groups;
  const double size = std::abs(result.solution.values(0));
  if (size > 0.0) result.error = std::sqrt(variance) / size;
  return result;
}

std::vector<double> poles_for(Index length, double step) {
  constexpr int kPoles = 40;
  const double lowest = 0.1 / (static_cast<double>(length) * step), highest = 1.0 / step;
  std::vector<double> poles{0.0};
  for (int k = 0; k < kPoles; ++k) {
    poles.push_back(lowest * std::pow(highest / lowest, static_cast<double>(k) / (kPoles - 1)));
  }
  return poles;
}

// What the drive makes of the motion, 1/J, beside all forces of a list.
struct InverseMass {
  double value = 0.0, error = std::numeric_limits<double>::infinity();
};

VectorXd delayed(const VectorXd& signal, Index by) {
  VectorXd result = VectorXd::Constant(signal.size(), signal(0));
  result.tail(signal.size() - by) = signal.head(signal.size() - by);
  return result;
}

// One log, or several of the same mass: forces act alike in all, and each segment has a start of
// its own. Segments do not go beyond a log; a log that is shorter than they is one segment.
class OneMassSearch {
 public:
  // `forces`: of each log.
  OneMassSearch(const std::vector<OneMassLog>& logs, std::vector<MatrixXd> forces)
      : logs_(logs), forces_(std::move(forces)) {
    for (const OneMassLog& log : logs_) {
      samples_ += log.motion.size();
      longest_ = std::max(longest_, log.motion.size());
    }
  }

  OneMassStart run() {
    MassCandidate chosen = chosen_candidate();
    if (!(chosen.error < kToldEnough)) chosen = single_transient(chosen);
    if (chosen.error < kToldEnough) chosen.solution = with_delay(chosen);
    return start_of(chosen);
  }

 private:
  [[nodiscard]] Index force_count() const { return forces_.front().cols(); }
  [[nodiscard]] bool is_velocity() const { return logs_.front().is_velocity; }
  [[nodiscard]] double sample_time() const { return logs_.front().sample_time; }

  // What forces make of the motion at a pole, and the motion, without starts: of each segment.
  [[nodiscard]] std::vector<MatrixXd> segments_at(double pole, Index length, Index delay) const {
    std::vector<MatrixXd> segments;
    for (std::size_t k = 0; k < logs_.size(); ++k) {
      const MatrixXd& forces = forces_[k];
      const Index n = forces.rows(), own = std::min(length, n);
      const FreeResponse response(pole, sample_time(), is_velocity(), own);
      MatrixXd columns(n, forces.cols() + 1);
      for (Index f = 0; f < forces.cols(); ++f) columns.col(f) = response.of(forces.col(f));
      if (delay > 0) columns.col(0) = response.of(delayed(forces.col(0), std::min(delay, n)));
      columns.rightCols(1) = logs_[k].motion;
      for (Index first = 0; first + own <= n; first += own) {
        segments.push_back(response.without_start(columns.middleRows(first, own)));
      }
    }
    return segments;
  }

  [[nodiscard]] std::vector<GroupProducts> products_for(Index length, Index delay = 0) const {
    std::vector<GroupProducts> all;
    for (const double pole : poles_for(length, sample_time())) {
      const std::vector<MatrixXd> segments = segments_at(pole, length, delay);
      const std::size_t groups = std::min<std::size_t>(kGroups, segments.size());
      const Index columns = force_count() + 1;
      GroupProducts each{pole, std::vector<MatrixXd>(groups, MatrixXd::Zero(columns, columns))};
      for (std::size_t s = 0; s < segments.size(); ++s) {
        each.groups[s * groups / segments.size()] += segments[s].transpose() * segments[s];
      }
      all.push_back(std::move(each));
    }
    return all;
  }

  [[nodiscard]] MassCandidate chosen_candidate() const {
    std::vector<MassCandidate> all;
    Index before = 0;
    for (Index parts = 6; parts <= 600; parts *= 3) {
      const Index length = std::min(longest_, samples_ / parts);
      if (length < kFewestSamples) break;
      if (length == before) continue;
      before = length;
      const std::vector<GroupProducts> products = products_for(length);
      for (Index count = 2; count <= force_count(); ++count) {
        if (count == 4 && force_count() == 5) continue;  // sine and cosine together
        all.push_back(judged(products, count, length));
      }
    }
    MassCandidate best;
    for (Index count = force_count(); count >= 2; --count) {
      const MassCandidate here = longest_of(all, count);
      if (here.error < kSureEnough) return here;
      if (here.error < best.error) best = here;
    }
    return best;
  }

  [[nodiscard]] static MassCandidate longest_of(const std::vector<MassCandidate>& all,
                                                Index count) {
    MassCandidate best;
    for (const MassCandidate& each : all) {
      if (each.forces == count && each.error < best.error) best = each;
    }
    for (const MassCandidate& each : all) {
      if (each.forces != count || each.error > kLonger * best.error) continue;
      if (each.length > best.length) best = each;
    }
    return best;
  }

  // A single step can't be left out: the whole log, with the fewest forces that are enough.
  [[nodiscard]] MassCandidate single_transient(const MassCandidate& other) const {
    constexpr double kByDrive = 0.25, kMuchBetter = 0.5;  // of the squares
    const double enough = is_velocity() ? 0.05 : 0.01;
    const std::vector<GroupProducts> products = products_for(longest_);
    MassCandidate whole;
    whole.length = longest_;
    for (Index count = 1; count <= force_count(); ++count) {
      if (count == 4 && force_count() == 5) continue;
      const SegmentSolution here = best_of(products, count, -1);
      if (!(here.left < kMuchBetter * whole.solution.left)) continue;
      whole.solution = here;
      whole.forces = count;
    }
    const SegmentSolution& best = whole.solution;
    const bool is_slow = best.pole * sample_time() < kFastest;
    if (!is_slow || best.left > enough * best.total || best.left > kByDrive * best.without_drive) {
      return other;
    }
    whole.error = kSureEnough;
    return whole;
  }

  // The drive acts some samples later, as long as that fits clearly better.
  [[nodiscard]] SegmentSolution with_delay(const MassCandidate& chosen) const {
    constexpr double kBetter = 0.97;
    SegmentSolution best = chosen.solution;
    for (Index delay = 1; delay <= chosen.length / 4; delay += std::max<Index>(1, delay / 3)) {
      const SegmentSolution later = best_of(products_for(chosen.length, delay), chosen.forces, -1);
      if (!(later.left < kBetter * best.left) || later.values(0) * best.values(0) < 0.0) break;
      best = later;
    }
    return best;
  }

  [[nodiscard]] double usual_damping() const {
    double moves = 0.0, rates = 0.0, drives = 0.0;
    for (const OneMassLog& log : logs_) {
      const Index n = log.motion.size();
      VectorXd rate = log.motion;
      if (!log.is_velocity) {
        const Index over = std::max<Index>(1, n / 200);
        rate = (log.motion.tail(n - over) - log.motion.head(n - over)) /
               (static_cast<double>(over) * log.sample_time);
      }
      moves += rate.squaredNorm();
      rates += static_cast<double>(rate.size());
      drives += log.force.squaredNorm();
    }
    const bool is_told = moves > 0.0 && drives > 0.0;
    return is_told ? std::sqrt(drives / static_cast<double>(samples_) / (moves / rates)) : 1.0;
  }

  // Where nothing is told: damping that takes the motion's power, and an inertia that settles in a
  // few samples, so that a fit begins in the units of the log.
  [[nodiscard]] OneMassStart scaled(OneMassStart start) const {
    constexpr double kSettles = 10.0;  // samples
    start.damping = usual_damping();
    start.inertia = kSettles * sample_time() * start.damping;
    return start;
  }

  [[nodiscard]] OneMassStart start_of(const MassCandidate& chosen) const {
    OneMassStart start;
    const SegmentSolution& solution = chosen.solution;
    if (solution.values.size() == 0 || solution.values(0) == 0.0) return start;
    const double inertia = 1.0 / solution.values(0);
    constexpr double kLeast = 0.01;
    const double least = kLeast * usual_damping();
    start.spread = chosen.error;
    start.has_value = std::isfinite(inertia) && (inertia > 0.0 || chosen.error < kToldEnough);
    if (!start.has_value) return scaled(start);
    start.inertia = std::abs(inertia);
    start.damping = std::max(least, solution.pole * start.inertia);
    if (!(chosen.error < kToldEnough)) return start;
    // As fast as the search goes, a pole is that of the samples, and the mass with it.
    if (inertia > 0.0 && !(solution.pole * sample_time() < kFastest)) return start;
    start.told = OneMassTold::kInertia;
    if (inertia > 0.0) {
      take_weight(chosen, start);
      return start;
    }
    const bool follows = solution.left < kHalf * solution.without_drive;
    const bool is_reversed = follows && stays_negative(chosen) && !drive_pushes();
    start.told = is_reversed ? OneMassTold::kReversed : OneMassTold::kNothing;
    if (is_reversed) prove_reversed(chosen, start);
    return start;
  }

  // Whether the drive acts with the motion for most of the time, as no reversed one does.
  [[nodiscard]] bool drive_pushes() const {
    constexpr double kSometimes = 0.25;
    DriveWorkBothWays ways;
    for (const OneMassLog& log : logs_) ways += drive_work(log.force, log.motion, log.is_velocity);
    const auto moving = static_cast<double>(ways.forwards.moving + ways.backwards.moving);
    const auto against = static_cast<double>(ways.forwards.against + ways.backwards.against);
    return ways.forwards.work + ways.backwards.work > 0.0 && against < kSometimes * moving;
  }

  // Whether the mass is negative beside all forces of the list, too, by three standard errors of
  // that fit. An axis that goes on at one speed, or yields like a spring, does not tell.
  [[nodiscard]] bool stays_negative(const MassCandidate& chosen) const {
    const InverseMass mass = beside_all(chosen.length, chosen.solution.pole);
    return mass.value < -mass.error / kToldEnough;
  }

  // Neither a spring nor a weight beside the drive makes the mass positive, whichever part of the
  // log is left out, and friction takes energy from what is left of the turned drive.
  void prove_reversed(const MassCandidate& chosen, OneMassStart& start) const {
    double least = std::numeric_limits<double>::infinity();
    for (const std::vector<MatrixXd>& forces : lists_beside()) {
      const OneMassSearch other(logs_, forces);
      const std::vector<GroupProducts> products = other.products_for(chosen.length);
      const SegmentSolution found = best_of(products, other.force_count(), -1);
      if (found.values.size() == 0 || !are_all_negative(products, other.force_count())) return;
      const InverseMass mass = other.beside_all(chosen.length, found.pole);
      const bool is_slow = found.pole * sample_time() < kFastest;
      const bool follows = found.left < kHalf * found.without_drive;
      const bool is_damped = (found.pole > 0.0) || (found.values(2) < 0.0);
      if (!is_slow || !follows || !is_damped || !(mass.value < -kProved * mass.error)) return;
      if (-mass.value > least * mass.error) continue;
      least = -mass.value / mass.error;
      start.proved = -1.0 / mass.value;
      start.proved_error = mass.error / (mass.value * mass.value);
    }
    start.is_proved = true;
  }

  // The lists of forces_beside(), of all logs.
  [[nodiscard]] std::vector<std::vector<MatrixXd>> lists_beside() const {
    std::vector<std::vector<MatrixXd>> lists;
    for (const OneMassLog& log : logs_) {
      const std::vector<MatrixXd> own = forces_beside(log);
      lists.resize(own.size());
      for (std::size_t k = 0; k < own.size(); ++k) lists[k].push_back(own[k]);
    }
    return lists;
  }

  [[nodiscard]] static bool are_all_negative(const std::vector<GroupProducts>& products,
                                             Index count) {
    const auto groups = static_cast<int>(products.front().groups.size());
    if (groups < 3) return false;
    for (int g = 0; g < groups; ++g) {
      const SegmentSolution other = best_of(products, count, g);
      if (other.values.size() == 0 || !(other.values(0) < 0.0)) return false;
    }
    return true;
  }

  // Least squares at one pole. What is left follows from its own past r(k) = rho r(k-1) + e(k),
  // which makes the error larger by (1 + rho)/(1 - rho) in the squares.
  [[nodiscard]] InverseMass beside_all(Index length, double pole) const {
    const Index forces = force_count();
    const std::vector<MatrixXd> segments = segments_at(pole, length, 0);
    Index rows = 0;
    for (const MatrixXd& segment : segments) rows += segment.rows();
    MatrixXd rest(rows, forces + 1);
    Index first = 0;
    for (const MatrixXd& segment : segments) {
      rest.middleRows(first, segment.rows()) = segment;
      first += segment.rows();
    }
    const MatrixXd products = rest.transpose() * rest;
    const auto [values, left] = solved(products, forces);
    const VectorXd residual = rest.col(forces) - rest.leftCols(forces) * values;
    const double past = residual.head(rows - 1).dot(residual.tail(rows - 1)) /
                        std::max(residual.squaredNorm(), 1e-300);
    const double rho = std::clamp(past, 0.0, 0.999);
    const VectorXd scale = products.diagonal().head(forces).cwiseMax(1e-300).cwiseSqrt();
    MatrixXd normal = scale.cwiseInverse().asDiagonal() * products.topLeftCorner(forces, forces) *
                      scale.cwiseInverse().asDiagonal();
    normal.diagonal().array() += kRidge;
    const double inverse =
        normal.ldlt().solve(VectorXd::Unit(forces, 0))(0) / (scale(0) * scale(0));
    const double noise = left / static_cast<double>(std::max<Index>(1, rows - forces));
    const double error = std::sqrt(std::max(0.0, inverse) * noise * (1.0 + rho) / (1.0 - rho));
    return {values(0), error};
  }

  static void take_weight(const MassCandidate& chosen, OneMassStart& start) {
    constexpr double kNeeded = 0.5;  // of the squares
    if (chosen.forces != 5 || chosen.solution.left > kNeeded * chosen.solution.without_place)
      return;
    start.sine = -chosen.solution.values(3) * start.inertia;
    start.cosine = -chosen.solution.values(4) * start.inertia;
  }

  const std::vector<OneMassLog>& logs_;
  std::vector<MatrixXd> forces_;
  Index samples_ = 0, longest_ = 0;
};

bool is_usable(const OneMassLog& log) {
  return log.motion.size() >= kFewestSamples && log.force.allFinite() && log.motion.allFinite() &&
         log.sample_time > 0.0 && log.force.size() == log.motion.size();
}

// Sums that are taken in one order come out alike whatever the order of the files is.
bool comes_first(const OneMassLog& one, const OneMassLog& other) {
  const auto key = [](const OneMassLog& log) {
    return std::tuple(log.motion.size(), log.force.squaredNorm(), log.motion.squaredNorm());
  };
  return key(one) < key(other);
}

}  // namespace

OneMassStart start_one_mass(const std::vector<OneMassLog>& logs) {
  std::vector<OneMassLog> used;
  Index samples = 0;
  bool is_driven = false;
  for (const OneMassLog& log : logs) {
    if (!is_usable(log)) continue;
    used.push_back(log);
    samples += log.motion.size();
    is_driven = is_driven || log.force.squaredNorm() > 0.0;
  }
  if (!is_driven) return {};
  std::ranges::sort(used, comes_first);
  const Index over = (samples + kMostSamples - 1) / kMostSamples;
  for (OneMassLog& log : used) log = shortened(log, over);
  std::erase_if(used, [](const OneMassLog& log) { return !is_usable(log); });
  if (used.empty()) return {};
  const CommonMotion common(used);
  std::vector<MatrixXd> forces;
  for (const OneMassLog& log : used) forces.push_back(forces_of(log, common));
  return OneMassSearch(used, std::move(forces)).run();
}

OneMassStart start_one_mass(const OneMassLog& log) {
  return start_one_mass(std::vector<OneMassLog>{log});
}

}  // namespace graybox
