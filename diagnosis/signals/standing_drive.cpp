#include "diagnosis/signals/standing_drive.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// The end of the samples from `first` on that stay within `band`.
Index end_of_stay(const Eigen::Ref<const VectorXd>& position, Index first, double band) {
  double lowest = position(first), highest = lowest;
  Index end = first;
  for (; end < position.size(); ++end) {
    lowest = std::min(lowest, position(end));
    highest = std::max(highest, position(end));
    if (highest - lowest > band) break;
  }
  return end;
}

}  // namespace

std::vector<Stay> stays(const Eigen::Ref<const VectorXd>& time,
                        const Eigen::Ref<const VectorXd>& position, double band,
                        double least_duration) {
  std::vector<Stay> found;
  for (Index t = 0; t < position.size();) {
    const Index end = end_of_stay(position, t, band);
    const bool is_long = time(end - 1) - time(t) >= least_duration;
    if (is_long) found.push_back({t, end - t});
    t = is_long ? end : t + 1;
  }
  return found;
}

StandingDrive standing_drive(const Eigen::Ref<const VectorXd>& time,
                             const Eigen::Ref<const VectorXd>& drive,
                             const std::vector<Stay>& stays) {
  StandingDrive most;
  for (const Stay& stay : stays) {
    const Index end = stay.first + stay.count;
    StandingDrive own;
    Index last = stay.first;
    for (Index t = stay.first; t < end; ++t) {
      while (last < end && time(last) - time(t) < kSustained) ++last;
      if (last == end) break;
      const auto given = drive.segment(t, last + 1 - t);
      own.highest = std::max(own.highest, given.minCoeff());
      own.lowest = std::min(own.lowest, given.maxCoeff());
    }
    most = larger(most, own);
  }
  return most;
}

StandingDrive larger(const StandingDrive& one, const StandingDrive& other) {
  return other.held() > one.held() ? other : one;
}

double slowest_lasting_speed(const Eigen::Ref<const VectorXd>& velocity, Index samples) {
  constexpr double kTimes = 2.0;
  double slowest = 0.0;
  for (Index t = samples; t + samples < velocity.size(); ++t) {
    const double speed = std::abs(velocity(t));
    if (!(speed > 0.0) || (slowest > 0.0 && speed >= slowest)) continue;
    const VectorXd around = velocity.segment(t - samples, 2 * samples + 1) / velocity(t);
    if (around.minCoeff() >= 1.0 / kTimes && around.maxCoeff() <= kTimes) slowest = speed;
  }
  return slowest;
}

}  // namespace graybox
