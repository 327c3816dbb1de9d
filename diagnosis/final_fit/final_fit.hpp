// The model that a search ended with, fitted once more for what is reported, and judged: parameters
// with errors, what it leaves on the recordings of the fit and on those kept out, and what each law
// is worth.
//
// It is judged in free run where free run has skill (errors below a fifth of the signal in every
// output), else over the longest windows that have. It is fitted there, too, unless a disturbance
// hides the sizes of laws there (disturbance_beside.hpp). Then laws go that gain nothing
// (idle_laws.hpp), change for plainer ones (plainer_laws.hpp), or come to it (short_ripples.hpp).
// Standard errors are those of size_errors.hpp; recordings kept out have held_out_judging.hpp.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/final_fit/held_out_judging.hpp"
#include "diagnosis/final_fit/last_fit.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/prediction_error/unmodelled_force.hpp"

namespace graybox {

class FinalFit {
 public:
  // References are kept.
  FinalFit(const PredictionData& data, const PredictionHypotheses& hypotheses,
           const PredictionFindings& findings, int threads);

  [[nodiscard]] const JudgedModel& found() const { return last_.found; }
  [[nodiscard]] const JudgedModel& as_given() const { return last_.as_given; }
  // The model refitted without one of its laws.
  [[nodiscard]] JudgedModel without(std::size_t law) const;
  // The model refitted with the last law of `rival` in place of one of its laws.
  [[nodiscard]] JudgedModel exchanged(std::size_t law, const ExtendedLumpedModel& rival) const;
  // The model refitted with a more general law in place of one of its laws, from the best of the
  // starts about that one; unusable without any.
  [[nodiscard]] JudgedModel in_place_of(std::size_t law, std::size_t hypothesis) const;
  // `poorer` with a law of another hypothesis, from the best of its starts; unusable without any.
  [[nodiscard]] JudgedModel with_law(const JudgedModel& poorer, std::size_t hypothesis) const {
    return last_.with_law(poorer, hypothesis);
  }
  // The model found with one law more, and its standard errors; unusable without any start.
  [[nodiscard]] JudgedModel beside(std::size_t hypothesis) const;
  // The model refitted with a weight in place of a spring; unusable where none can be.
  [[nodiscard]] JudgedModel weight_in_place_of(std::size_t law) const;
  // Hypotheses that may be one with this law in what is measured.
  [[nodiscard]] std::vector<std::size_t> elsewhere(std::size_t hypothesis) const;
  [[nodiscard]] const UnmodelledForce& rest() const { return *rest_; }
  // As in held_out_judging.hpp.
  [[nodiscard]] std::optional<HeldOutError> held_out_ahead(const JudgedModel& model,
                                                           double share) const {
    if (!model.fit.usable) return {};
    return error_held_out_ahead(last_, model.fit.model, *rest_, share);
  }
  [[nodiscard]] std::optional<HeldOutError> law_held_out(const JudgedModel& model) const {
    return law_error_held_out(last_, model);
  }
  // That by which the model is judged: in free run, or as far ahead as it can be foreseen.
  [[nodiscard]] std::optional<HeldOutError> held_out_as_judged(const JudgedModel& model) const {
    if (!model.fit.usable) return {};
    return held_out_by(last_, model.fit.model, last_.judged_by);
  }
  [[nodiscard]] JudgedModel fitted_to_kept_out() const { return fit_of_kept_out(last_); }
  [[nodiscard]] std::optional<HeldOutGrowth> growth() const {
    return growth_kept_out(last_, *rest_);
  }
  [[nodiscard]] std::vector<ResidualCurve> curves(const JudgedModel& model) const {
    return curves_of(last_, model);
  }
  // What changes most surely of each law; none where all windows are whole recordings.
  [[nodiscard]] std::vector<LawTrend> trends() const;
  // z of the model found over another, by blocks left out.
  [[nodiscard]] double z_over(const JudgedModel& poorer) const { return last_.z_over(poorer); }
  [[nodiscard]] Eigen::MatrixXd motion() const { return last_.motion(); }
  // The law that the search accepted where this one stands: itself, or one that contains it.
  [[nodiscard]] std::size_t accepted_as(std::size_t hypothesis) const {
    return last_.accepted_as(hypothesis);
  }

 private:
  LastFit last_;
  std::optional<UnmodelledForce> rest_;
};

}  // namespace graybox
