// What each law found by a diagnosis by prediction error is worth, with its rivals: what it lowers
// the error kept out by, which other laws could take its place, and which were excluded.
//
//   const std::vector<FoundEffect> effects =
//       PredictionEffects(model, data, hypotheses, findings, final).of(laws);
//
// Each comparison refits the model with the law left out or exchanged. z is that of blocks left out
// (left_out_blocks.hpp); a rival stands where z of the law found over it is below 2.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/prediction_error/final_fit.hpp"

namespace graybox {

// A law of the model, with its parameters' errors where `judged` has them.
[[nodiscard]] FittedLaw fitted_law(const ExtendedLumpedModel& model, const PlacedFinding& law,
                                   const JudgedModel* judged);

class PredictionEffects {
 public:
  // References are kept.
  PredictionEffects(const LumpedModel& stated, const PredictionData& data,
                    const PredictionHypotheses& hypotheses, const PredictionFindings& findings,
                    const FinalFit& final)
      : stated_(&stated),
        data_(&data),
        hypotheses_(&hypotheses),
        findings_(&findings),
        final_(&final) {}

  // The laws of the model found, in its order.
  [[nodiscard]] std::vector<FoundEffect> of(std::span<const FittedLaw> laws) const;

 private:
  [[nodiscard]] std::optional<HeldOutEffect> effect_of(const JudgedModel& without) const;
  [[nodiscard]] bool contains(std::size_t richer, std::size_t plainer) const;
  void add_rivals(const AcceptedLaw& accepted, std::size_t law, FoundEffect& effect) const;
  void add_rivals_elsewhere(std::size_t found, const JudgedModel& without,
                            FoundEffect& effect) const;
  void add_if_stands(std::size_t other, const JudgedModel& without, FoundEffect& effect) const;
  void add_richer_friction(std::size_t law, FoundEffect& effect) const;
  [[nodiscard]] bool raises_held_out(const JudgedModel& other) const;
  void unite_delays(FoundEffect& effect) const;
  [[nodiscard]] bool is_found(std::size_t hypothesis) const;

  const LumpedModel* stated_;
  const PredictionData* data_;
  const PredictionHypotheses* hypotheses_;
  const PredictionFindings* findings_;
  const FinalFit* final_;
};

}  // namespace graybox
