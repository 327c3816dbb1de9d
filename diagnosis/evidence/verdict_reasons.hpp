// Why a verdict is what it is. The tests stand in one list, in the order in which they decide, and
// the verdict is computed from it by one rule: the first test that failed says what the verdict is,
// and where none failed it is `explained`. A test that could not be asked neither passes nor fails,
// and says why.
//
//   diagnosis.reasons = verdict_reasons(diagnosis, options);
//   diagnosis.verdict = verdict_of(diagnosis.reasons);
#pragma once

#include <span>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/search_options.hpp"

namespace graybox {

// What is left after the last fit: no more than noise, where that is known; else predicted as well
// as fitted, and without structure. Diagnosis::verified: none of them failed.
[[nodiscard]] std::vector<VerdictReason> rest_reasons(const Diagnosis& diagnosis,
                                                      const SearchOptions& options);

[[nodiscard]] std::vector<VerdictReason> verdict_reasons(const Diagnosis& diagnosis,
                                                         const SearchOptions& options);

[[nodiscard]] Verdict verdict_of(std::span<const VerdictReason> reasons);

// Whether recordings kept out speak against a law: it raises their error, and that is large then,
// or half as large again. A law that raises a small error a little may be right.
[[nodiscard]] bool is_not_confirmed(const FoundEffect& effect);

// A model that needs other sizes of its own for the recordings kept out lacks something, whatever
// laws were tried. Passed where the error that they would take is a few percent of the signal.
[[nodiscard]] VerdictReason sizes_hold_reason(const Diagnosis& diagnosis);

// How the texts of these tests begin.
inline constexpr const char* kSizesTest = "sizes that recordings kept out ask to be others";
inline constexpr const char* kLateTest = "being late";
inline constexpr const char* kForceTest = "force left at";  // and the place: % of those that act
inline constexpr const char* kKeptOutTest = "recordings that were kept out of the fit";

// Whether recordings kept out are predicted: where the noise is known, to the noise; else some were
// kept out, and no test of their error failed.
[[nodiscard]] bool predicts_kept_out(const Diagnosis& diagnosis);

// Where the noise is not known, what was found is not sure before recordings that were kept out of
// the fit have tested it.
[[nodiscard]] VerdictReason nothing_kept_out(Verdict otherwise = Verdict::kAmbiguous);

[[nodiscard]] inline bool has_failed(const VerdictReason& reason) {
  return !reason.passed && reason.not_tested.empty();
}

}  // namespace graybox
