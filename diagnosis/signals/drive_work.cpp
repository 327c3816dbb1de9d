#include "diagnosis/signals/drive_work.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kMoves = 0.2;      // of the rms of all displacements
constexpr double kClear = 3.0;      // rms of a displacement over that of its noise
constexpr double kEachWay = 0.1;    // of the samples that move
constexpr double kMostly = 0.75;    // of the samples that move
constexpr Index kFewestParts = 20;  // of a log, by displacements

double rms_of_finite(const VectorXd& signal) {
  double sum = 0.0;
  Index count = 0;
  for (const double value : signal) {
    if (!std::isfinite(value)) continue;
    sum += value * value;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

VectorXd displacement(const VectorXd& position, Index over) {
  const Index n = position.size() - over;
  return position.tail(n) - position.head(n);
}

// White noise of a position, from its second differences.
double noise_of(const VectorXd& position) {
  const VectorXd steps = displacement(position, 1);
  const VectorXd bends = displacement(steps, 1);
  std::vector<double> sizes;
  for (const double bend : bends) {
    if (std::isfinite(bend)) sizes.push_back(std::abs(bend));
  }
  if (sizes.empty()) return 0.0;
  const auto most = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() * 7 / 10);
  std::ranges::nth_element(sizes, most);
  return *most / std::sqrt(6.0);  // seven in ten lie within one standard deviation
}

// Samples over which a position moves clearly.
Index clear_span(const VectorXd& position) {
  const double noise = std::sqrt(2.0) * noise_of(position);
  Index over = 1;
  for (; kFewestParts * 2 * over < position.size(); over *= 2) {
    if (rms_of_finite(displacement(position, over)) > kClear * noise) break;
  }
  return over;
}

DriveWork work_one_way(const VectorXd& force, const VectorXd& moved, double sign) {
  const double still = kMoves * rms_of_finite(moved);
  DriveWork result;
  for (Index k = 0; k < moved.size(); ++k) {
    const double work = force(k) * moved(k);
    if (!(sign * moved(k) > still) || !std::isfinite(work)) continue;
    ++result.moving;
    if (work < 0.0) ++result.against;
    result.work += work;
  }
  return result;
}

}  // namespace

DriveWork& DriveWork::operator+=(const DriveWork& other) {
  moving += other.moving;
  against += other.against;
  work += other.work;
  return *this;
}

DriveWorkBothWays& DriveWorkBothWays::operator+=(const DriveWorkBothWays& other) {
  forwards += other.forwards;
  backwards += other.backwards;
  return *this;
}

DriveWorkBothWays drive_work(const VectorXd& force, const VectorXd& motion, bool is_velocity) {
  constexpr Index kFewest = 10;
  const Index n = motion.size();
  if (n < kFewest || force.size() != n) return {};
  VectorXd moved = motion, acting = force;
  if (!is_velocity) {
    const Index over = clear_span(motion);
    moved = displacement(motion, over);
    acting = VectorXd::Zero(moved.size());
    for (Index back = 0; back < over; ++back) acting += force.segment(back, moved.size());
    acting /= static_cast<double>(over);
  }
  return {work_one_way(acting, moved, 1.0), work_one_way(acting, moved, -1.0)};
}

bool takes_energy(const DriveWork& way) {
  return static_cast<double>(way.against) > kMostly * static_cast<double>(way.moving) &&
         way.work < 0.0;
}

bool takes_energy(const DriveWorkBothWays& drive) {
  DriveWork all = drive.forwards;
  all += drive.backwards;
  return takes_energy(all);
}

bool takes_energy_both_ways(const DriveWorkBothWays& drive) {
  const Index all = drive.forwards.moving + drive.backwards.moving;
  const auto is_enough = [all](const DriveWork& way) {
    return static_cast<double>(way.moving) > kEachWay * static_cast<double>(all);
  };
  return is_enough(drive.forwards) && takes_energy(drive.forwards) && is_enough(drive.backwards) &&
         takes_energy(drive.backwards);
}

}  // namespace graybox
