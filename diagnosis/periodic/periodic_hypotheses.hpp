// The laws of a periodic diagnosis: those that the model states, and those that may be missing, as
// hypotheses of the search. Translates between these and the laws of a periodic fit.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/periodic/periodic_fit.hpp"

namespace graybox {

// Copies share the family and the model's own places, into which laws point.
class PeriodicHypotheses {
 public:
  // `positions`: at how many of them there are recordings. Throws InputError for a law with more
  // than one state.
  PeriodicHypotheses(std::shared_ptr<const PlantFamily> family, std::size_t positions);

  [[nodiscard]] const PlantFamily& family() const { return *family_; }
  [[nodiscard]] const std::vector<ActingLaw>& base_laws() const { return base_laws_; }
  [[nodiscard]] std::span<const Hypothesis> list() const { return hypotheses_; }
  [[nodiscard]] const CandidatePlace* place(std::size_t hypothesis) const {
    return places_[hypothesis];
  }
  [[nodiscard]] const LawEntry* entry(std::size_t hypothesis) const { return entries_[hypothesis]; }

  // Parameters of the plants and of the model's own laws.
  [[nodiscard]] std::size_t model_parameter_count() const;
  [[nodiscard]] std::vector<ActingLaw> with_base_laws(std::span<const LawStart> laws) const;
  // The model's laws and those that a fit has found.
  [[nodiscard]] std::vector<ActingLaw> laws_of(const ExtendedFit& fit) const;
  // Writes the fit's parameters of the model to those of the plants and of the first laws.
  void take_model_parameters(const ExtendedFit& fit, Eigen::VectorXd& parameters,
                             std::vector<ActingLaw>& laws) const;

  // The fit in the search's terms, `laws` those that it began with, without an assessment.
  [[nodiscard]] ExtendedFit report(const PeriodicFit& fitted, std::span<const LawStart> laws) const;

 private:
  void list_base_laws();
  void list_hypotheses(std::size_t positions);
  void add_hypothesis(const CandidatePlace& place, const LawEntry& entry);

  std::shared_ptr<const PlantFamily> family_;
  std::shared_ptr<std::vector<CandidatePlace>> base_places_;
  std::vector<ActingLaw> base_laws_;
  std::vector<std::string> base_names_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const CandidatePlace*> places_;  // of each hypothesis
  std::vector<const LawEntry*> entries_;
};

// Parameters of the model, then of the laws.
[[nodiscard]] Eigen::VectorXd values_of(const ExtendedFit& fit);

}  // namespace graybox
