#include "graybox/bench/study/study_sets.hpp"

#include <algorithm>
#include <thread>

#include "graybox/problems/families/families.hpp"
#include "graybox/problems/robot_grid.hpp"
#include "graybox/problems/robot_information.hpp"
#include "graybox/problems/robot_model.hpp"

namespace graybox::bench {
namespace {

constexpr std::size_t kCopies = 10;  // of every matrix of `dup`

InformationSet robot_set(std::size_t candidates) {
  const RobotModel robot = load_robot_model(default_robot_file());
  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return robot_information_set(robot, robot_grid(candidates), {.threads = threads});
}

}  // namespace

const std::vector<std::string>& study_families() {
  static const std::vector<std::string> names{"rob",  "wis", "flat",  "smo",
                                              "smr6", "r1g", "cube3", "dup"};
  return names;
}

InformationSet make_study_set(const std::string& family, std::size_t candidates) {
  if (family == "robot") return robot_set(candidates);
  const auto known = std::ranges::find(families(), family, &Family::name);
  if (known == families().end()) return make_family(family);  // throws, listing all
  if (known->fixed_size) return make_family(family);
  if (family == "dup") {
    const std::size_t most = std::min(candidates, known->default_candidates);
    return make_family(family, std::max(kCopies, most / kCopies * kCopies));
  }
  return make_family(family, candidates);
}

}  // namespace graybox::bench
