#include "diagnosis/signals/coasting.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kLeastShare = 0.05;  // of the squared speed
constexpr double kMoves = 0.1;        // of the largest speed
constexpr int kFewest = 10;           // samples

struct Phase {
  double squares = 0.0;
  int samples = 0;  // in which it moved
};

VectorXd speed_of(const CoastingMotion& recording) {
  if (recording.is_velocity || recording.motion.size() < 2) return recording.motion;
  const Index steps = recording.motion.size() - 1;
  VectorXd speed = recording.motion;
  speed.head(steps) = recording.motion.tail(steps) - recording.motion.head(steps);
  speed(steps) = speed(steps - 1);
  return speed;
}

}  // namespace

bool moves_without_drive(const std::vector<CoastingMotion>& recordings) {
  double largest_drive = 0.0, largest_speed = 0.0;
  std::vector<VectorXd> speeds;
  for (const CoastingMotion& each : recordings) {
    speeds.push_back(speed_of(each));
    largest_drive = std::max(largest_drive, each.drive.cwiseAbs().maxCoeff());
    largest_speed = std::max(largest_speed, speeds.back().cwiseAbs().maxCoeff());
  }
  Phase driven, coasting;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    for (Index k = 0; k < speeds[r].size(); ++k) {
      const bool is_driven = std::abs(recordings[r].drive(k)) > kNoDrive * largest_drive;
      Phase& phase = is_driven ? driven : coasting;
      phase.squares += speeds[r](k) * speeds[r](k);
      phase.samples += std::abs(speeds[r](k)) > kMoves * largest_speed ? 1 : 0;
    }
  }
  const double least = kLeastShare * (driven.squares + coasting.squares);
  const auto tells = [&](const Phase& phase) {
    return phase.squares >= least && phase.samples >= kFewest;
  };
  return tells(driven) && tells(coasting);
}

}  // namespace graybox
