// Recordings freed of the plant's free motion with a better fit (MismatchProblem::renewed). Also
// what is kept of before (diagnosis_search.hpp, steps 2 and 3).
#pragma once

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// A first fit that stopped far from the recordings could not free them of the plant's free motion.
void renew_without_laws(SearchState& state);

// Frees recordings anew with laws that were found, before more of them are looked for. What they
// leave may be free motion in two cases. The model alone did not come near enough to the recordings
// to free them of the plant's free motion. Or the laws bend that motion. It is not kept where the
// fit becomes no better by that: laws may meet free motion in ways that its modes do not describe.
// It is done once. With many recordings, where that takes as long as all the rest, it is not done
// where what is left is no more than noise.
[[nodiscard]] bool renew_with_laws(SearchState& state);

// Behind the law found, before recordings were freed of more: excluded by that.
[[nodiscard]] bool was_far_behind(SearchState& state, std::size_t hypothesis, std::size_t found,
                                  std::vector<Rival>& excluded);

}  // namespace graybox
