#include "bench/challenge/case_system.hpp"

#include <array>
#include <cmath>

#include "bench/challenge/lumped_case.hpp"
#include "bench/challenge/robot_case.hpp"

namespace graybox::bench {

std::string_view to_string(Family family) {
  constexpr std::array<std::string_view, kFamilies> kNames{
      "robot",           "three_axis",   "one_mass",        "two_mass",       "oscillator",
      "chain",           "axis_encoder", "axis_tachometer", "drive_encoders", "drive_motor_encoder",
      "drive_tachometer"};
  return kNames[static_cast<std::size_t>(family)];
}

std::optional<Family> family_named(std::string_view name) {
  for (int k = 0; k < kFamilies; ++k) {
    if (to_string(static_cast<Family>(k)) == name) return static_cast<Family>(k);
  }
  return {};
}

std::string_view set_of(Family family) {
  return static_cast<int>(family) < kPeriodicFamilies ? kPeriodicSet : kAnyMotionSet;
}

std::uint64_t derived_seed(std::uint64_t seed, std::initializer_list<std::uint64_t> place) {
  for (const std::uint64_t index : place) {
    seed = Random(seed + 0x632be59bd9b4e019ULL * (index + 1)).next();
  }
  return seed;
}

void CaseSystem::perturb(std::size_t parameters, Random& random) {
  constexpr double kLargest = 0.2;
  for (std::size_t p = 0; p < parameters; ++p) {
    factors_.push_back(1.0 + random.uniform(-kLargest, kLargest));
  }
}

std::unique_ptr<CaseSystem> draw_system(Family family, std::uint64_t seed) {
  return family == Family::kRobot || family == Family::kThreeAxis ? draw_robot_case(family, seed)
                                                                  : draw_lumped_case(family, seed);
}

}  // namespace graybox::bench
