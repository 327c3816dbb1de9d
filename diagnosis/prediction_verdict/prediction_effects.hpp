// What each law found by a diagnosis by prediction error is worth. It tells by how much the law
// lowers the error kept out. It names laws that could take its place, and laws that are excluded.
//
//   const std::vector<FoundEffect> effects = PredictionEffects(outcome).of(laws);
//
// Each comparison refits the model with the law left out or exchanged. Its z is that of blocks left
// out (left_out_blocks.hpp). A rival stands where z of the law found over it is below 2.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/prediction_verdict/prediction_outcome.hpp"

namespace graybox {

// A law of the model, with its parameters' errors where `judged` has them.
[[nodiscard]] FittedLaw fitted_law(const ExtendedLumpedModel& model, const PlacedFinding& law,
                                   const JudgedModel* judged);

class PredictionEffects {
 public:
  explicit PredictionEffects(const PredictionOutcome& outcome) : from_(outcome) {}

  // The laws of the model found, in its order.
  [[nodiscard]] std::vector<FoundEffect> of(std::span<const FittedLaw> laws) const;

 private:
  [[nodiscard]] std::optional<HeldOutEffect> effect_of(const JudgedModel& without) const;
  [[nodiscard]] std::optional<HeldOutEffect> effect_between(
      const std::optional<HeldOutError>& poorer, const std::optional<HeldOutError>& richer) const;
  [[nodiscard]] bool contains(std::size_t richer, std::size_t plainer) const;
  void add_rivals(const AcceptedLaw& accepted, std::size_t law, FoundEffect& effect) const;
  void add_rivals_elsewhere(std::size_t found, const JudgedModel& without,
                            FoundEffect& effect) const;
  void add_if_stands(std::size_t other, const JudgedModel& without, FoundEffect& effect) const;
  void add_exchanged(const JudgedModel& exchanged, FoundEffect& effect) const;
  void add_weight(std::size_t law, FoundEffect& effect) const;
  void add_bent_drive_or_drag(const JudgedModel& without, FoundEffect& effect) const;
  void add_richer_friction(std::size_t law, FoundEffect& effect) const;
  [[nodiscard]] bool raises_held_out(const JudgedModel& other) const;
  void unite_delays(FoundEffect& effect) const;
  void unite_forces_one_way(std::size_t law, FoundEffect& effect) const;
  [[nodiscard]] bool is_found(std::size_t hypothesis) const;

  PredictionOutcome from_;
};

}  // namespace graybox
