// Which laws of a last fit are called "Not confirmed" and not "Found".
//
// A law is doubtful where
//   - recordings kept out speak against it, or are foretold no better with it;
//   - nothing is foretold with it: the error kept out is larger than the signal;
//   - whole recordings kept out are foretold worse with all laws than with none, and badly;
//   - nothing was kept out, and the fit without it is hardly worse;
//   - no size of it is told from zero, or it is larger than all that ever acted;
//   - more acts unexplained than all that is known to act;
//   - it is a ripple of no known phase that others may explain.
// Where the noise is known, the tests of chance decide, and most of these are not asked.
#pragma once

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

[[nodiscard]] bool is_doubtful(const FoundEffect& effect, const Diagnosis& diagnosis);

// A law of which no size is told from zero may be any other.
[[nodiscard]] bool has_no_size(const FittedLaw& law);

// Whether laws are told, none of them is "Found", and no channel is late.
[[nodiscard]] bool has_no_confirmed_law(const Diagnosis& diagnosis);

}  // namespace graybox
