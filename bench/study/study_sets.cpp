#include "bench/study/study_sets.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "bench/study/plan.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/families/families.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "problems/robot_information/robot_information.hpp"

namespace graybox::bench {
namespace {

constexpr double kUnitDecades = 12.0;
constexpr std::size_t kCopies = 10;  // of every matrix of `dup`

InformationSet robot_set(std::size_t candidates) {
  const RobotModel robot = load_robot_model(default_robot_file());
  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return robot_information_set(robot, robot_grid(candidates), {.threads = threads});
}

}  // namespace

const std::vector<std::string>& study_families() {
  static const std::vector<std::string> names{"rob",      "wis",     "flat",        "smo",
                                              "smr6",     "r1g",     "cube3",       "dup",
                                              "legendre", "splines", "exponentials"};
  return names;
}

bool is_study_set(const std::string& family, std::size_t candidates) {
  const std::vector<std::string>& names = study_families();
  const bool known = family == "robot" || family == "robot_units" ||
                     std::ranges::find(names, family) != names.end();
  return known && candidates <= kFullSize;
}

InformationSet make_study_set(const std::string& family, std::size_t candidates) {
  if (const auto end = family.find_last_not_of("0123456789");
      end != std::string::npos && end + 1 < family.size() && family[end] == '_') {
    return make_family(family.substr(0, end), candidates, std::stoul(family.substr(end + 1)),
                       kStudySetSeed);
  }
  if (family == "robot") return robot_set(candidates);
  if (family == "robot_units") return in_units(robot_set(candidates), kUnitDecades);
  const auto known = std::ranges::find(families(), family, &Family::name);
  if (known == families().end()) return make_family(family);  // throws, listing all
  if (known->fixed_size) return make_family(family, 0, 0, kStudySetSeed);
  if (family == "dup") {
    const std::size_t most = std::min(candidates, known->default_candidates);
    return make_family(family, std::max(kCopies, most / kCopies * kCopies), 0, kStudySetSeed);
  }
  return make_family(family, candidates, 0, kStudySetSeed);
}

InformationSet in_units(const InformationSet& set, double decades) {
  const std::size_t d = set.dimension(), p = set.packed_size();
  std::vector<double> unit(d);
  for (std::size_t j = 0; j < d; ++j) {
    const double share = static_cast<double>(j) / static_cast<double>(d - 1);
    unit[j] = std::pow(10.0, decades * (share - 0.5));
  }
  AlignedArray information(set.candidate_count() * p);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    for (std::size_t a = 0; a < d; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const std::size_t k = packed_index(a, b);
        information[i * p + k] = unit[a] * unit[b] * set.information(i)[k];
      }
    }
  }
  return InformationSet(d, std::move(information));
}

}  // namespace graybox::bench
