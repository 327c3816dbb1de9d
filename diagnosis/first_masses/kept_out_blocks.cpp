#include "diagnosis/first_masses/kept_out_blocks.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace graybox {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double kNothing = 0.02, kShare = 0.2, kAlike = 1.5, kChirp = 2.5;
// The slower quarter of a ramp through zero has an eighth of the squares of its way, and less
// behind a dead band.
constexpr double kShareOfRamp = 0.05;
constexpr double kEnough = 0.25;  // of what the best split tells
constexpr Index kFewestOfBlock = 40, kMostBlocks = 20, kQuarters = 4;
constexpr Index kFewestOfStroke = 250;    // of a block where the axis turns round once or twice
constexpr double kFewestCrossings = 4.0;  // of a quarter

// What each sample adds to the squares and to the crossings of the mean.
struct Added {
  ArrayXd drive, motion, crossings;
  ArrayXd forwards, backwards;  // of the motion
  int turns = 0;                // how often the motion turns round
  // What tells a mass, viscous and dry friction and a constant apart: a column each.
  Eigen::ArrayX4d told;
  // Positions, in place of `motion`: what hardly moves has little way, however it trembles.
  ArrayXd place;
  bool is_swept = false;   // its frequency rises or falls along the log
  bool shows_mass = true;  // or nothing drives, so that it can't
};

// Cut at the size that all but a few samples keep: one spike would have all the squares.
ArrayXd without_spikes(const ArrayXd& values, Index over) {
  const Index n = values.size(), spikes = std::min(n - 1, 4 * over + n / 500);
  std::vector<double> sizes(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) sizes[static_cast<std::size_t>(k)] = std::abs(values(k));
  std::ranges::nth_element(sizes, sizes.end() - 1 - spikes);
  const double most = *(sizes.end() - 1 - spikes);
  return most > 0.0 ? ArrayXd(values.max(-most).min(most)) : values;
}

// How often a rate changes its sign, smaller ones than a tenth of the largest left out.
int turns_of(const ArrayXd& rates) {
  const double slow = 0.1 * rates.abs().maxCoeff();
  int turns = 0, way = 0;
  for (const double rate : rates) {
    const int here = rate > slow ? 1 : rate < -slow ? -1 : 0;
    if (here != 0 && way != 0 && here != way) ++turns;
    if (here != 0) way = here;
  }
  return turns;
}

bool is_chirp(const ArrayXd& crossings) {
  const Index n = crossings.size();
  double quarter[4];
  for (Index k = 0; k < 4; ++k) quarter[k] = crossings.segment(k * (n / 4), n / 4).sum();
  const bool rises = std::ranges::is_sorted(quarter),
             falls = std::ranges::is_sorted(quarter, std::ranges::greater());
  const double least = std::min(quarter[0], quarter[3]), most = std::max(quarter[0], quarter[3]);
  return (rises || falls) && most >= kFewestCrossings && most > kChirp * std::max(least, 1.0);
}

// The samples at which a signal turns round, by more than a fifth of its range.
std::vector<Index> turning_points(const ArrayXd& signal) {
  constexpr double kClear = 0.2;
  const double clear = kClear * (signal.maxCoeff() - signal.minCoeff());
  std::vector<Index> points;
  Index highest = 0, lowest = 0;
  int way = 0;  // 0: it has not moved yet
  for (Index k = 0; k < signal.size(); ++k) {
    if (signal(k) > signal(highest)) highest = k;
    if (signal(k) < signal(lowest)) lowest = k;
    const bool falls = way >= 0 && signal(k) < signal(highest) - clear,
               rises = way <= 0 && signal(k) > signal(lowest) + clear;
    if (!falls && !rises) continue;
    if (way != 0) points.push_back(falls ? highest : lowest);
    way = falls ? -1 : 1;
    (falls ? lowest : highest) = k;
  }
  return points;
}

// A slow sweep has few periods to count: then each stretch from turn to turn is shorter than the
// one before, or longer, by 1.5 in all, and goes as far.
bool is_slow_sweep(const ArrayXd& signal) {
  constexpr double kFaster = 1.5, kAsFar = 1.3;
  constexpr std::size_t kFewest = 3;  // stretches
  const std::vector<Index> points = turning_points(signal);
  if (points.size() < kFewest + 1) return false;
  std::vector<double> lengths, ways;
  for (std::size_t k = 1; k < points.size(); ++k) {
    lengths.push_back(static_cast<double>(points[k] - points[k - 1]));
    ways.push_back(std::abs(signal(points[k]) - signal(points[k - 1])));
  }
  const auto [least, most] = std::ranges::minmax(ways);
  const auto [shortest, longest] = std::ranges::minmax(lengths);
  if (most > kAsFar * least || longest < kFaster * shortest) return false;
  return std::ranges::is_sorted(lengths) || std::ranges::is_sorted(lengths, std::ranges::greater());
}

// Whether the drive follows the acceleration, by three errors beside friction and a constant. What
// is left follows from its own past by rho, which takes (1 - rho)/(1 + rho) of the squares.
bool shows_mass(const VectorXd& drive, const Eigen::ArrayX4d& told) {
  constexpr double kErrors = 3.0;
  if (!(drive.cwiseAbs().maxCoeff() > 0.0)) return true;
  const Eigen::MatrixXd columns =
      (told.rowwise() / told.square().colwise().mean().sqrt().max(1e-300)).matrix();
  const auto left = [&](const Eigen::MatrixXd& own) {
    Eigen::MatrixXd normal = own.transpose() * own;
    normal.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff();
    return VectorXd(drive - own * normal.ldlt().solve(own.transpose() * drive));
  };
  const VectorXd rest = left(columns);
  const Index n = rest.size();
  const double squares = rest.squaredNorm(), without = left(columns.rightCols(3)).squaredNorm(),
               past = rest.head(n - 1).dot(rest.tail(n - 1)) / std::max(squares, 1e-300),
               rho = std::clamp(past, 0.0, 0.999);
  return (without - squares) * static_cast<double>(n - 4) * (1.0 - rho) >
         kErrors * kErrors * squares * (1.0 + rho);
}

Added added_by(const VectorXd& drive, const VectorXd& motion, bool is_velocity) {
  const Index n = drive.size(), over = std::max<Index>(1, n / 500);
  Added added{without_spikes(drive.array(), 1).square(),
              ArrayXd::Zero(n),
              ArrayXd::Zero(n),
              ArrayXd::Zero(n),
              ArrayXd::Zero(n),
              0,
              Eigen::ArrayX4d::Zero(n, 4),
              is_velocity ? ArrayXd() : ArrayXd(motion.array()),
              is_slow_sweep(motion.array()) || is_slow_sweep(drive.array())};
  ArrayXd rates = motion.array();
  for (Index k = 0; k < n; ++k) {
    const double change = motion(k) - motion(std::max<Index>(0, k - over));
    if (!is_velocity) rates(k) = change;
  }
  rates = without_spikes(rates, over);
  added.turns = turns_of(rates);
  for (Index k = 0; k < n; ++k) {
    added.motion(k) = rates(k) * rates(k);
    (rates(k) > 0.0 ? added.forwards : added.backwards)(k) = added.motion(k);
  }
  const double slow = 0.05 * rates.abs().maxCoeff();
  for (Index k = 0; k < n; ++k) {
    const double change = rates(k) - rates(std::max<Index>(0, k - over));
    added.told.row(k) << change, rates(k), std::tanh(rates(k) / std::max(slow, 1e-300)), 1.0;
  }
  const double mean = drive.mean(), near = 0.1 * (drive.array() - mean).abs().maxCoeff();
  int side = 0;
  for (Index k = 0; k < n; ++k) {
    const int here = drive(k) > mean + near ? 1 : drive(k) < mean - near ? -1 : 0;
    if (here != 0 && side != 0 && here != side) added.crossings(k) = 1.0;
    if (here != 0) side = here;
  }
  added.is_swept = added.is_swept || is_chirp(added.crossings);
  added.shows_mass = shows_mass(drive, added.told);
  return added;
}

// Sums of the blocks that are kept out, and of the others.
struct Shares {
  double kept = 0.0, fitted = 0.0;

  Shares(const ArrayXd& values, Index blocks) {
    const Index n = values.size();
    for (Index b = 0; b < blocks; ++b) {
      const Index first = b * n / blocks, last = (b + 1) * n / blocks;
      (b % 2 == 0 ? fitted : kept) += values.segment(first, last - first).sum();
    }
  }
  // Also where there is nothing to share.
  [[nodiscard]] bool have_each(double share) const {
    return std::min(kept, fitted) >= share * (kept + fitted);
  }
};

// The least share of what the whole log tells that either role has: the smallest eigenvalue of its
// normal matrix over that of all, in what all tell; at most a half.
double told_of_mass(const Added& added, Index blocks) {
  constexpr double kUntold = 1e-3;  // of the largest eigenvalue: the log does not tell it
  const Eigen::MatrixX4d columns =
      (added.told.rowwise() / added.told.square().colwise().mean().sqrt().max(1e-300)).matrix();
  const Index n = columns.rows();
  Eigen::Matrix4d fitted = Eigen::Matrix4d::Zero(), kept = Eigen::Matrix4d::Zero();
  for (Index b = 0; b < blocks; ++b) {
    const Index first = b * n / blocks, last = (b + 1) * n / blocks;
    const auto own = columns.middleRows(first, last - first);
    (b % 2 == 0 ? fitted : kept) += own.transpose() * own;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> whole(fitted + kept);
  const Eigen::Vector4d sizes = whole.eigenvalues();
  const Index untold = (sizes.array() <= kUntold * sizes.maxCoeff()).count();
  const Eigen::MatrixXd white = whole.eigenvectors().rightCols(4 - untold) *
                                sizes.tail(4 - untold).cwiseSqrt().cwiseInverse().asDiagonal();
  const auto least = [&](const Eigen::Matrix4d& role) {
    const Eigen::MatrixXd share = white.transpose() * role * white;
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(share).eigenvalues().minCoeff();
  };
  return std::max(0.0, std::min(least(fitted), least(kept)));
}

// Without a mass there is friction to tell, by the samples of either way: the least share that a
// role has of one of them. A way that is hardly gone counts for nothing.
double told_of_ways(const Added& added, Index blocks) {
  constexpr double kMoves = 0.5;  // of tanh(rate/slow)
  const ArrayXd way = added.told.col(2);
  const auto count = static_cast<double>((way.abs() > kMoves).count());
  double least = 0.5;
  for (const double sign : {1.0, -1.0}) {
    const Shares share((sign * way > kMoves).cast<double>(), blocks);
    const double both = share.kept + share.fitted;
    if (both < kShare * count) continue;
    least = std::min(least, std::min(share.kept, share.fitted) / std::max(both, 1.0));
  }
  return least >= kShare ? least : 0.0;
}

double told_by_each(const Added& added, Index blocks) {
  return added.shows_mass ? told_of_mass(added, blocks) : told_of_ways(added, blocks);
}

// How often a drive goes from one of two levels to the other; none: it has more than two.
std::optional<int> switches_of(const VectorXd& drive) {
  constexpr double kConstant = 0.02;  // of the largest
  constexpr double kLevel = 0.25;     // of the range, about each level
  constexpr double kBetween = 0.02;   // of the samples
  const double low = drive.minCoeff(), range = drive.maxCoeff() - low;
  if (range <= kConstant * drive.cwiseAbs().maxCoeff()) return 0;
  Index between = 0;
  int switches = 0, level = -1;
  for (const double value : drive) {
    const double share = (value - low) / range;
    const int here = share < kLevel ? 0 : share > 1.0 - kLevel ? 1 : -1;
    if (here < 0) ++between;
    if (here >= 0 && level >= 0 && here != level) ++switches;
    if (here >= 0) level = here;
  }
  if (static_cast<double>(between) > kBetween * static_cast<double>(drive.size())) return {};
  return switches;
}

// How often the motion turns round and goes a fifth of its whole way back: the last counts of an
// encoder, and noise of a speed, turn round at rest, too.
std::size_t clear_turns(const Added& added) {
  ArrayXd place = added.told.col(1);  // the rates
  for (Index k = 1; k < place.size(); ++k) place(k) += place(k - 1);
  return turning_points(place).size();
}

// One step, one pulse, or a drive that is switched on before the log begins: what follows is one
// transient, and a part of it foretells no other.
bool is_one_transient(const VectorXd& drive, const Added& added) {
  constexpr int kPulse = 2;  // switches, and turns of the motion
  if (!(drive.cwiseAbs().maxCoeff() > 0.0)) return false;
  if (added.turns > kPulse && clear_turns(added) > kPulse) return false;
  const std::optional<int> switches = switches_of(drive);
  return switches && *switches <= kPulse;
}

bool goes_both_ways(const Added& added) {
  const double forwards = added.forwards.sum(), backwards = added.backwards.sum();
  return std::min(forwards, backwards) >= kShare * (forwards + backwards);
}

bool has_both_ways_in_each(const Added& added, Index blocks, double share) {
  return Shares(added.forwards, blocks).have_each(share) &&
         Shares(added.backwards, blocks).have_each(share);
}

// There in one half and back in the other: friction and a constant force are one thing in each.
bool turns_between_halves(const Added& added) {
  return goes_both_ways(added) && !Shares(added.forwards, 2).have_each(kNothing) &&
         !Shares(added.backwards, 2).have_each(kNothing);
}

// Once or twice in the whole log: a half goes mostly one way, and foretells nothing of the other.
bool turns_seldom(const Added& added) {
  constexpr int kSeldom = 2;
  return added.turns > 0 && added.turns <= kSeldom && goes_both_ways(added);
}

// The way between the first and the last twentieth of the places that are passed.
double way_of(const ArrayXd& place) {
  std::vector<double> sorted(place.begin(), place.end());
  std::ranges::sort(sorted);
  const std::size_t cut = sorted.size() / 20;
  return sorted[sorted.size() - 1 - cut] - sorted[cut];
}

// Which half goes less than a tenth of the whole way: -1 the first, 1 the second, 0 neither.
int still_half(const ArrayXd& place) {
  constexpr double kHardly = 0.1;
  if (place.size() == 0) return 0;
  const Index half = place.size() / 2;
  const double least = kHardly * way_of(place);
  if (way_of(place.head(half)) < least) return -1;
  return way_of(place.tail(place.size() - half)) < least ? 1 : 0;
}

// Whether both roles go their share of the ways of all blocks.
bool have_ways(const ArrayXd& place, Index blocks) {
  if (place.size() == 0) return true;
  const Index n = place.size();
  double ways[2] = {0.0, 0.0};
  for (Index b = 0; b < blocks; ++b) {
    const Index first = b * n / blocks, last = (b + 1) * n / blocks;
    ways[b % 2] += way_of(place.segment(first, last - first));
  }
  return std::min(ways[0], ways[1]) >= kShare * (ways[0] + ways[1]);
}

bool are_alike(const ArrayXd& crossings, Index blocks) {
  const Shares shares(crossings, blocks);
  return std::max(shares.kept, shares.fitted) <= kAlike * std::min(shares.kept, shares.fitted);
}

std::string reason_against_halves(const Added& added) {
  const Shares drive(added.drive, 2), motion(added.motion, 2);
  if (!drive.have_each(kNothing)) {
    return drive.kept < drive.fitted ? "the drive is zero in the second half"
                                     : "the drive is zero in the first half";
  }
  if (!motion.have_each(kNothing)) {
    return motion.kept < motion.fitted ? "nothing moves in the second half"
                                       : "nothing moves in the first half";
  }
  if (turns_between_halves(added)) return "the axis goes one way in each half";
  if (turns_seldom(added)) return "the axis turns round only once or twice";
  if (added.is_swept) return "the drive's frequency changes along the log";
  if (const int still = still_half(added.place); still != 0) {
    return still > 0 ? "nothing moves in the second half" : "nothing moves in the first half";
  }
  if (told_by_each(added, 2) >= kNothing) return "";
  const bool turns = goes_both_ways(added);
  if (turns && !has_both_ways_in_each(added, 2, kNothing))
    return "the axis goes one way in one half";
  if (!added.shows_mass) return "one half hardly goes one of both ways";
  const bool have_starts = Shares(added.told.col(0).square(), 2).have_each(kShare);
  return have_starts ? "one half hardly tells mass and friction apart"
                     : "starts and stops are in one half";
}

// Whether blocks of a chirp hold a period on the average: less of it tells nothing by itself.
bool have_periods(const ArrayXd& crossings, Index blocks) {
  return crossings.sum() >= 2.0 * static_cast<double>(blocks);
}

struct SplitTrial {
  Index blocks = 2;
  double told = 0.0;
};

// What both roles tell of an axis where both have their share of all; below kNothing elsewhere.
double fairly_told(const Added& added, Index blocks, double share = kShare) {
  if (!Shares(added.drive, blocks).have_each(share)) return 0.0;
  if (!Shares(added.motion, blocks).have_each(share)) return 0.0;
  if (!have_ways(added.place, blocks)) return 0.0;
  const bool is_mixed = !turns_between_halves(added) && !turns_seldom(added);
  if (!is_mixed && !has_both_ways_in_each(added, blocks, share)) return 0.0;
  if (added.is_swept && !are_alike(added.crossings, blocks)) return 0.0;
  if (added.is_swept && !have_periods(added.crossings, blocks)) return 0.0;
  return told_by_each(added, blocks);
}

// Numbers of blocks, rising, of which both roles have their share of all.
std::vector<SplitTrial> fair_splits(const Added& added) {
  std::vector<SplitTrial> trials;
  const bool is_stroke = turns_seldom(added) && !turns_between_halves(added);
  const Index fewest = is_stroke ? kFewestOfStroke : kFewestOfBlock;
  for (Index blocks = 4; blocks <= kMostBlocks; blocks += 2) {
    if (added.drive.size() / blocks < fewest) break;
    const double told = fairly_told(added, blocks);
    if (told >= kNothing) trials.push_back({blocks, told});
  }
  return trials;
}

// Whether quarters give both roles something of both ways, where the axis goes one way in each half
// and the log is too short for more blocks: one sweep through zero.
bool has_fair_quarters(const Added& added) {
  return turns_between_halves(added) && added.drive.size() / kQuarters >= kFewestOfBlock &&
         fairly_told(added, kQuarters, kShareOfRamp) >= kNothing;
}

// The fewest blocks that tell a quarter of what the best do; 2 where there are none.
Index fewest_blocks(const std::vector<SplitTrial>& trials) {
  const auto best = std::ranges::max_element(trials, {}, &SplitTrial::told);
  for (const SplitTrial& trial : trials) {
    if (trial.told >= kEnough * best->told) return trial.blocks;
  }
  return 2;
}

// Whether enough of the fit's samples are left behind a filter, also beside what halves leave.
bool leaves_enough(Index samples, Index blocks, Index lost) {
  constexpr double kFewestOfFit = 50.0, kOfHalves = 0.6;
  const auto left = [&](Index count) { return 0.5 * static_cast<double>(samples - count * lost); };
  return samples / blocks >= kFewestOfBlock && left(blocks) >= kFewestOfFit &&
         left(blocks) >= kOfHalves * left(2);
}

// How many axes have their share, and the least that is told of one of them.
struct SharedSplit {
  std::size_t axes = 0;
  SplitTrial trial;
};

SharedSplit shared_split(const std::vector<Added>& axes, Index blocks) {
  SharedSplit split{0, {blocks, 1.0}};
  for (const Added& axis : axes) {
    const double told = fairly_told(axis, blocks);
    if (told < kNothing) continue;
    ++split.axes;
    split.trial.told = std::min(split.trial.told, told);
  }
  return split;
}

}  // namespace

KeptOutBlocks kept_out_blocks(const VectorXd& drive, const VectorXd& motion, bool is_velocity) {
  KeptOutBlocks split;
  if (drive.size() != motion.size() || drive.size() < 2 * kFewestOfBlock) return split;
  const Added added = added_by(drive, motion, is_velocity);
  if (!(added.motion.sum() > 0.0)) return split;
  if (is_one_transient(drive, added)) {
    split.reason = "the drive makes one step or pulse";
    split.is_fair = false;
    return split;
  }
  split.reason = reason_against_halves(added);
  if (split.reason.empty()) return split;
  const std::vector<SplitTrial> trials = fair_splits(added);
  split.is_fair = !trials.empty();
  split.count = fewest_blocks(trials);
  if (trials.empty() && has_fair_quarters(added)) {
    split.is_fair = true;
    split.count = kQuarters;
  }
  return split;
}

KeptOutBlocks kept_out_blocks(const std::vector<DrivenAxis>& axes, Index lost) {
  KeptOutBlocks split;
  std::vector<Added> moving;
  std::size_t alike = 0;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const Index n = axes[k].drive.size();
    if (n != axes[k].position.size() || n < 2 * kFewestOfBlock) continue;
    Added added = added_by(axes[k].drive, axes[k].position, false);
    if (!(added.motion.sum() > 0.0) || !(added.drive.sum() > 0.0)) continue;
    added.is_swept = false;  // no joint is asked for a chirp, nor how often it turns round
    added.turns = 0;
    const std::string reason = reason_against_halves(added);
    // By what blocks are held against.
    if (reason.empty() && fairly_told(added, 2) >= kNothing) ++alike;
    if (!reason.empty() && split.reason.empty()) {
      split.reason = reason;
      split.axis = k;
    }
    moving.push_back(std::move(added));
  }
  if (split.reason.empty()) return split;
  std::size_t most = alike;
  std::vector<SplitTrial> trials;
  for (Index blocks = 4; blocks <= kMostBlocks; blocks += 2) {
    if (!leaves_enough(moving.front().drive.size(), blocks, lost)) break;
    const SharedSplit shared = shared_split(moving, blocks);
    if (shared.axes > most) trials.clear();
    if (shared.axes < most || shared.axes == alike) continue;
    most = shared.axes;
    trials.push_back(shared.trial);
  }
  split.is_fair = !trials.empty();
  split.count = fewest_blocks(trials);
  return split;
}

}  // namespace graybox
