#include "bench/study/study_sets.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/families/families.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "problems/robot_information/robot_information.hpp"

namespace graybox::bench {
namespace {

constexpr double kUnitDecades = 12.0;
constexpr std::size_t kCopies = 10;  // of every matrix of `dup`

InformationSet robot_set(const PositionTable& positions) {
  const RobotModel robot = load_robot_model(default_robot_file());
  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return robot_information_set(robot, positions, {.threads = threads});
}

// Random positions of the paper's grid, all of them from as many candidates on.
PositionTable drawn_positions(std::size_t candidates, std::uint64_t seed) {
  const std::size_t count = std::min(candidates, kPaperGridSize);
  return paper_grid().subset(nested_subset(kPaperGridSize, count, seed));
}

std::size_t whole_copies(std::size_t candidates) {
  return std::max(kCopies, candidates / kCopies * kCopies);
}

}  // namespace

const StudyFamilies& study_families() {
  static const StudyFamilies all{
      .whole = {"rob", "wis", "flat", "smo", "smr6", "r1g", "cube3", "dup", "legendre", "splines",
                "exponentials"},
      .drawn = {"robot", "rob", "wis", "flat", "smo", "smr6", "r1g", "dup"},
      .dimensions = {"wis", "r1g"}};
  return all;
}

std::uint64_t study_set_seed(const std::string& name) {
  return kStudySetSeed + study_set_name(name).draw;
}

bool is_study_set(const std::string& family, std::size_t candidates) {
  const auto holds = [](const auto& list, const auto& item) {
    return std::ranges::find(list, item) != list.end();
  };
  const StudySetName name = study_set_name(family);
  const StudyFamilies& all = study_families();
  if (name.draw > 0) {
    return holds(all.drawn, name.family) && name.draw <= kMostDraws && candidates <= kDrawSize;
  }
  if (name.dimension > 0) {
    return holds(all.dimensions, name.family) && holds(kDimensions, name.dimension) &&
           candidates <= kDrawSize;
  }
  const bool known = family == "robot" || family == "robot_units" || holds(all.whole, family);
  return known && candidates <= kFullSize;
}

InformationSet make_study_set(const std::string& name, std::size_t candidates) {
  const auto [family, draw, dimension] = study_set_name(name);
  const std::uint64_t seed = study_set_seed(name);
  if (draw > 0 && family == "robot") return robot_set(drawn_positions(candidates, seed));
  if (draw > 0 && family == "dup") return make_family(family, whole_copies(candidates), 0, seed);
  if (draw > 0 || dimension > 0) return make_family(family, candidates, dimension, seed);
  if (family == "robot") return robot_set(robot_grid(candidates));
  if (family == "robot_units") return in_units(robot_set(robot_grid(candidates)), kUnitDecades);
  const auto known = std::ranges::find(families(), family, &Family::name);
  if (known == families().end()) return make_family(family);  // throws, listing all
  if (known->fixed_size) return make_family(family, 0, 0, kStudySetSeed);
  if (family == "dup") {
    const std::size_t most = std::min(candidates, known->default_candidates);
    return make_family(family, whole_copies(most), 0, kStudySetSeed);
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
