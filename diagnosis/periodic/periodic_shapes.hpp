// The laws that periodic recordings can show at a place, and the shapes they are tried in: those of
// law_shapes.hpp, and of what only such recordings tell: payloads, extra modes, laws of signals.
//
// Frequencies are spread over the band. Laws without an amplitude (a saturation) have themselves
// for a basis, and are expected with amplitude one.
#pragma once

#include <vector>

#include "diagnosis/hypotheses/candidate_place.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {

struct FrequencyBand {
  double lowest = 0.0, highest = 0.0;  // Hz, of the excitation
};

// Whether fits of a law should start from the best few of its shapes.
[[nodiscard]] bool has_many_valleys(const LawEntry& entry);

// Empty where there was no motion that could show the law.
[[nodiscard]] std::vector<LawShape> periodic_shapes(const LawEntry& entry,
                                                    const CandidatePlace& place,
                                                    const MotionScale& scale,
                                                    const FrequencyBand& band);

// The laws of the catalogue that are hypotheses at a place: those that it can take and that do not
// only change a parameter that is estimated anyway. Constant forces are left out, which lines do
// not show, and laws that are a twin of another. `positions`: of the recordings of the fit.
[[nodiscard]] std::vector<const LawEntry*> hypothetical_laws(const CandidatePlace& place,
                                                             std::size_t positions);

// The law that these recordings can't tell from this one. A stop beside a free spring is a play
// beside another spring. Dry friction that differs between the directions is their mean and a
// constant. Over small motions about one position a balancer is a spring (over large ones it is a
// hypothesis besides). Null if there is none.
[[nodiscard]] const LawEntry* twin_of(const LawEntry& entry, const CandidatePlace& place,
                                      std::size_t positions);

}  // namespace graybox
