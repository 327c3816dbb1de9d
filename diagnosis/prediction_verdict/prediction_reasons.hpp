// The tests that a diagnosis by prediction error passes or fails, in the order in which they decide
// its verdict. Their limits are calibrated in docs/explanation/prediction_error.md.
//
//   diagnosis.reasons = PredictionReasons(outcome).of(diagnosis);
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/prediction_verdict/prediction_outcome.hpp"

namespace graybox {

class PredictionReasons {
 public:
  explicit PredictionReasons(const PredictionOutcome& outcome) : from_(outcome) {}

  // What is left could be the sensors' noise and a disturbance.
  [[nodiscard]] bool is_disturbance() const;
  // The force left is more than next to nothing.
  [[nodiscard]] bool leaves_force() const;
  // The force left follows neither position nor speed by more than the limit.
  [[nodiscard]] bool is_without_structure() const;
  // The tests of a diagnosis whose effects, errors and implausibilities are known.
  [[nodiscard]] std::vector<VerdictReason> of(const Diagnosis& diagnosis) const;

 private:
  [[nodiscard]] bool is_within_a_step() const;
  [[nodiscard]] bool is_hidden_by_rounding() const;
  [[nodiscard]] bool is_next_to_nothing() const;
  // % of an output's signal.
  [[nodiscard]] double limit_of_error(Eigen::Index output, double scale) const;
  [[nodiscard]] bool has_stated_noise() const;  // of each output
  void add_held_out(std::vector<VerdictReason>& list) const;
  void add_whole_held_out(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) const;
  void add_whole_run(std::vector<VerdictReason>& list) const;
  void add_fitted(std::vector<VerdictReason>& list) const;
  // `most_of_small`: by how much an error may grow that is small all the same.
  void add_growth(double most_of_small, std::vector<VerdictReason>& list) const;
  void add_misleading(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) const;
  void add_against_as_given(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) const;
  void add_short_delay(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) const;
  void add_rest(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) const;
  [[nodiscard]] std::vector<VerdictReason> of_nothing_missing(
      const Diagnosis& diagnosis, std::vector<VerdictReason> list) const;

  PredictionOutcome from_;
};

// Whether the law found that is told least is told: by 3 standard errors from none, in the surest
// of its parameters, where it takes less than 3/4 of the squared error kept out. Laws without a
// standard error, and those that no recording kept out judges, are left to other tests.
[[nodiscard]] VerdictReason told_reason(const Diagnosis& diagnosis);

// Why another method should be asked where there is one: the test that leaves little of an answer.
// Empty: none fails. Where a sensor reads no sign, no other method knows the motion.
[[nodiscard]] std::string doubt_about(const Diagnosis& diagnosis,
                                      std::span<const Hypothesis> hypotheses);

}  // namespace graybox
