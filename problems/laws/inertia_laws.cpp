// What changes the inertia itself: no force law, the mass matrix takes it up.
#include "problems/laws/law_lists.hpp"

namespace graybox {

std::vector<LawEntry> inertia_laws() {
  using enum ParameterRange;
  return {
      {"inertia",
       "inertia, or the error of one: f = J z''",
       LawUse::kInertia,
       {{"inertia", "I", kAny, true}},
       {}},
      {"payload",
       "a point mass fixed to the flange; x, y, z in the frame of the last joint",
       LawUse::kPayload,
       {{"mass", "kg", kPositive, true}, {"x", "m", kAny}, {"y", "m", kAny}, {"z", "m", kAny}},
       {}},
  };
}

}  // namespace graybox
