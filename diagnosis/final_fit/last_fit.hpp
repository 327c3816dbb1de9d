// The model that a final fit has at hand, and how it fits and judges others beside it. The steps of
// the final fit change this state, one file pair a step.
//
// A model is fitted over the windows of `task`, with a filter that follows `disturbance`, and
// judged by its errors over those of `judged_by`.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <optional>

#include "diagnosis/final_fit/judged_model.hpp"
#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"
#include "diagnosis/prediction_error/unmodelled_force.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

inline constexpr int kLastFitIterations = 25, kManyLastFitIterations = 75;
inline constexpr int kLastFitIterationsOfStates = 10;  // of initial states alone
inline constexpr double kMissedLaw = 2.5;              // z of a law that stays

struct LastFit {
  const PredictionData* data;
  const PredictionHypotheses* hypotheses;
  const PredictionFindings* findings;
  int threads;
  PredictionTask judged_by, task;  // of the errors, and of the fit
  DisturbanceForce disturbance;    // that the filter of the fit follows
  DisturbanceForce remaining;      // that the rungs are asked beside; none: no force remains
  Eigen::VectorXd weights;         // of the outputs
  JudgedModel found, as_given;
  std::map<std::size_t, std::size_t> accepted = {};  // plainer laws: what they were accepted as

  [[nodiscard]] PredictionFitter fitter(const PredictionTask& ahead) const;
  [[nodiscard]] JudgedModel judged(const ExtendedLumpedModel& model, int iterations) const;
  // Fitted by the task of the fit; the weights are set to what a first fit leaves.
  [[nodiscard]] JudgedModel weighed(const ExtendedLumpedModel& model);
  // The model fitted over longer and longer windows, up to those of the fit.
  [[nodiscard]] ExtendedLumpedModel climbed(ExtendedLumpedModel model) const;
  // The best fit of the model with this law, of those starts that replace this part; none: of those
  // that replace nothing.
  [[nodiscard]] JudgedModel best_of_starts(const ExtendedLumpedModel& model, std::size_t hypothesis,
                                           std::optional<std::size_t> replaced) const;
  // `poorer` with a law of another hypothesis, from the best of its starts; unusable without any.
  [[nodiscard]] JudgedModel with_law(const JudgedModel& poorer, std::size_t hypothesis) const;
  // Whether the search saw fewer samples than were recorded.
  [[nodiscard]] bool is_thinned() const;
  [[nodiscard]] Eigen::MatrixXd motion() const;  // of the model found
  // z of the model found over another, by blocks left out.
  [[nodiscard]] double z_over(const JudgedModel& poorer) const;
  // Chi-square of the model found over another.
  [[nodiscard]] double evidence_over(const JudgedModel& poorer) const;
  // The law that the search accepted where this one stands: itself, or one that contains it.
  [[nodiscard]] std::size_t accepted_as(std::size_t hypothesis) const;
};

}  // namespace graybox
