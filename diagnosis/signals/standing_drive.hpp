// What a drive gave while the machine stood still. Dry friction held it, so it tells how much
// friction holds, which a model of sliding alone does not know.
//
// A stay is a stretch in which a position keeps within a band. What the drive gave counts where it
// lasted for kSustained within a stay: what comes late has arrived by then. At one place a weight,
// a spring or a magnet may hold a drive, too, but not two that differ: friction holds at least half
// of what lies between the lowest and the highest of one stay.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

namespace graybox {

struct Stay {
  Eigen::Index first = 0, count = 0;  // samples
};

// Stays of at least so many seconds, in the order of time. Cost O(n) for a motion that moves on.
[[nodiscard]] std::vector<Stay> stays(const Eigen::Ref<const Eigen::VectorXd>& time,
                                      const Eigen::Ref<const Eigen::VectorXd>& position,
                                      double band, double least_duration);

struct StandingDrive {
  double lowest = std::numeric_limits<double>::infinity(),
         highest = -std::numeric_limits<double>::infinity();  // that lasted, in one stay

  // What friction holds at least, whatever else holds; 0: nothing is known.
  [[nodiscard]] double held() const { return lowest < highest ? 0.5 * (highest - lowest) : 0.0; }
};

inline constexpr double kSustained = 0.3;  // s

// The drives of the stay in which they differ most.
[[nodiscard]] StandingDrive standing_drive(const Eigen::Ref<const Eigen::VectorXd>& time,
                                           const Eigen::Ref<const Eigen::VectorXd>& drive,
                                           const std::vector<Stay>& stays);

// The one that tells more friction.
[[nodiscard]] StandingDrive larger(const StandingDrive& one, const StandingDrive& other);

// The slowest speed that lasted: for so many samples before and behind it the motion kept its way
// and was neither half as fast nor twice as fast. 0: no speed lasted.
[[nodiscard]] double slowest_lasting_speed(const Eigen::Ref<const Eigen::VectorXd>& velocity,
                                           Eigen::Index samples);

}  // namespace graybox
