// What is not found although it lowers the error of the fit. This holds for laws that raise the
// error of recordings kept out. It holds for laws that lower its square by less than 3 % where the
// noise is not known (a law that few machines have, kRareRank: by less than 10 %). It holds for
// laws that lower that square by less than 3 % beyond what a special case of them does in their
// place, which takes it then. It holds for laws whose size is not determined and which lower that
// square by less than 30 %. And it holds for laws where the error is as large as the signal.
// Recordings kept out are asked for each law with the others refitted without it
// (law_pruning.hpp). Where none were kept out nothing is rejected for what it predicts.
//
// Where the noise is known a law misleads only if the error is larger beyond what the errors of the
// fitted parameters do (HeldOutPrediction::cost): recordings kept out that do not excite a law say
// nothing of it.
#pragma once

#include <cstdint>
#include <optional>

#include "diagnosis/evidence/search_state.hpp"

namespace graybox {

// Where the noise is not known and channels are told apart: in those on which the law acts, and
// those whose error it changes by more than a tenth through what they share.
[[nodiscard]] std::optional<HeldOutEffect> held_out_effect(const SearchState& state,
                                                           std::size_t hypothesis,
                                                           const ExtendedFit& without,
                                                           const ExtendedFit& with);

enum class Rejection : std::int8_t {
  kNone,
  kLittle,  // laws that add next to nothing
  // Others: with them out of the way the right ones may be found. Where the noise is not known also
  // those of a place where the error is as large as the signal.
  kSome,
  kAll,  // where laws act the error is as large as the signal
};

// Takes laws out of the model, worst first, into Diagnosis::rejected.
[[nodiscard]] Rejection reject_laws(SearchState& state);

// For each law found, beside it.
void note_held_out_effects(SearchState& state);

}  // namespace graybox
