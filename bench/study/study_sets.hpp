// The sets that the study and the benchmarks run on, by family name: "robot" and the families of
// problems/families. The same name and size give the same set everywhere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "bench/study/plan.hpp"
#include "problems/information/information_set.hpp"

namespace graybox::bench {

// The seed of every set made here but draws: of the families, and of the robot's nested subsets.
// Draw k has this seed plus k.
inline constexpr std::uint64_t kStudySetSeed = 1;
[[nodiscard]] std::uint64_t study_set_seed(const std::string& name);

// rob, wis, flat, smo, smr6, r1g, cube3, dup and, of the smooth curves, legendre, splines and
// exponentials: what the study runs besides the robot.
// Draws are made of the robot and of those families that have a seed, the ladder of d of wis and
// r1g.
[[nodiscard]] const StudyFamilies& study_families();

// "robot" gives nested random subsets of the paper's 7920 positions, and beyond them positions of a
// finer grid. A family of fixed size gives that size, and `dup` the next multiple of its ten copies
// below `candidates`, at most its default; all others exactly `candidates`, nested. Throws
// InputError for an unknown family. "FAMILY_D" is the family with D parameters (legendre_31).
// "FAMILY_draw_K" is an independent draw of it, and "robot_draw_K" has random positions of the
// paper's grid. Draws are not nested.
// "robot_units" is the robot's set with its parameters in units twelve decades apart: the same
// problem to a mathematician, and to the checker.
[[nodiscard]] InformationSet make_study_set(const std::string& name, std::size_t candidates);

// Whether the study runs on such a set: what make_study_set() may make on the word of a file.
[[nodiscard]] bool is_study_set(const std::string& family, std::size_t candidates);

// The same set with parameter j in units of 10^(decades (j/(d-1) - 1/2)): H_jk times both units.
[[nodiscard]] InformationSet in_units(const InformationSet& set, double decades);

}  // namespace graybox::bench
