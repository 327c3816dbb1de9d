// The model that a search ended with, fitted once more for what is reported, and judged: parameters
// with errors, what it leaves on the recordings of the fit and on those kept out, and what each law
// is worth.
//
// It is judged in free run where free run has skill (errors below a fifth of the signal in every
// output), else over the longest windows that have. It is fitted there, too, unless a force remains
// (unmodelled_force.hpp) and the rest is above twice the sensors' noise. A disturbance adds up, and
// what adds up hides the size of a law. Then fits over windows of 10 and 30 samples of the
// search are tried beside it, whose filters follow the force. The likeliest is taken, by the
// likelihood of latent_force.hpp.
//
// Standard errors allow for residuals with memory and of changing size: H^-1 (sum over blocks
// g_b g_b') H^-1, g_b = J_b'r_b, never below those of white residuals. They don't see a bias: noise
// in what the filter starts from, or a law that is finer in the machine. So the fit is repeated
// over the next shorter windows, and what both differ by beyond their errors is added. Of
// recordings kept out the predictor sees the first 200 samples, then runs free to the end.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"
#include "diagnosis/prediction_error/unmodelled_force.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"
#include "diagnosis/predictor/residual_whitener.hpp"

namespace graybox {

struct JudgedModel {
  PredictionFit fit;
  Eigen::Index horizon = 0;    // of the errors; 0: free run
  Eigen::VectorXd deviations;  // of the free parameters, in their units; NaN: not seen
  Eigen::VectorXd error;       // rms by output, recordings of the fit
  std::optional<Eigen::VectorXd> held_out_error;
  Eigen::VectorXd held_out_scale;  // rms of the outputs kept out about their means
};

// An error on recordings kept out, so far ahead.
struct HeldOutError {
  Eigen::Index horizon = 0;  // samples
  Eigen::VectorXd error;     // rms by output
};

// rms over outputs of errors over their scales.
[[nodiscard]] double relative_size(const Eigen::VectorXd& error, const Eigen::VectorXd& scale);

class FinalFit {
 public:
  // References are kept.
  FinalFit(const PredictionData& data, const PredictionHypotheses& hypotheses,
           const PredictionFindings& findings, int threads);

  [[nodiscard]] const JudgedModel& found() const { return found_; }
  [[nodiscard]] const JudgedModel& as_given() const { return as_given_; }
  // The model refitted without one of its laws.
  [[nodiscard]] JudgedModel without(std::size_t law) const;
  // The model refitted with the last law of `rival` in place of one of its laws.
  [[nodiscard]] JudgedModel exchanged(std::size_t law, const ExtendedLumpedModel& rival) const;
  // The model refitted with a more general law in place of one of its laws, from the best of the
  // starts about that one; unusable without any.
  [[nodiscard]] JudgedModel in_place_of(std::size_t law, std::size_t hypothesis) const;
  // `poorer` with a law of another hypothesis, from the best of its starts; unusable without any.
  [[nodiscard]] JudgedModel with_law(const JudgedModel& poorer, std::size_t hypothesis) const;
  // The model found with one law more, and its standard errors; unusable without any start.
  [[nodiscard]] JudgedModel beside(std::size_t hypothesis) const;
  // The model refitted with a weight in place of a spring; unusable where none can be.
  [[nodiscard]] JudgedModel weight_in_place_of(std::size_t law) const;
  // Hypotheses that may be one with this law in what is measured.
  [[nodiscard]] std::vector<std::size_t> elsewhere(std::size_t hypothesis) const;
  [[nodiscard]] const UnmodelledForce& rest() const { return *rest_; }
  // The error of the model found, as far ahead as the remaining force costs at most `share` of each
  // output's signal. None: no recordings were kept out, or it costs more everywhere.
  [[nodiscard]] std::optional<HeldOutError> held_out_ahead(double share) const;
  // The error kept out by which laws are weighed: as far ahead as the fit looks where it stands
  // beside a disturbance, which costs more over a whole run than any law; else that of the model.
  [[nodiscard]] std::optional<HeldOutError> law_held_out(const JudgedModel& model) const {
    if (!model.fit.usable) return {};
    return held_out_by(model.fit.model, disturbance_.is_there() ? task_ : judged_by_);
  }
  // That by which the model is judged: in free run, or as far ahead as it can be foreseen.
  [[nodiscard]] std::optional<HeldOutError> held_out_as_judged(const JudgedModel& model) const {
    if (!model.fit.usable) return {};
    return held_out_by(model.fit.model, judged_by_);
  }
  // The model found, fitted to the recordings kept out by themselves; unusable without any.
  [[nodiscard]] JudgedModel fitted_to_kept_out() const;
  // Each output's error on recordings kept out, over that of the fit; none below the noise. Where
  // what is kept out is the larger motion, or the harder driven, the ratio of the signals, or of
  // the drives, is divided out: what a law lacks grows with these, and so do most disturbances. In
  // free run where the plant forgets, else as far ahead as the remaining force lets foresee.
  struct Growth {
    Eigen::VectorXd ratio;
    Eigen::VectorXd deviation;  // of its logarithm, by blocks
  };
  [[nodiscard]] std::optional<Growth> growth() const;
  // What changes most surely of each law; none where all windows are whole recordings.
  [[nodiscard]] std::vector<LawTrend> trends() const;
  // z of the model found over another, by blocks left out.
  [[nodiscard]] double z_over(const JudgedModel& poorer) const {
    return z_between(poorer.fit, found_.fit);
  }
  [[nodiscard]] Eigen::MatrixXd motion() const { return fitter(task_).motion(found_.fit); }
  // Along time, those of recordings kept out first: by the predictions that its errors are of.
  [[nodiscard]] std::vector<ResidualCurve> curves(const JudgedModel& model) const;
  // The law that the search accepted where this one stands: itself, or one that contains it.
  [[nodiscard]] std::size_t accepted_as(std::size_t hypothesis) const;

 private:
  [[nodiscard]] std::optional<HeldOutError> held_out_by(const ExtendedLumpedModel& model,
                                                        const PredictionTask& task) const;
  // The best fit of the model with this law, of those starts that replace this part; none: of those
  // that replace nothing.
  [[nodiscard]] JudgedModel best_of_starts(const ExtendedLumpedModel& model, std::size_t hypothesis,
                                           std::optional<std::size_t> replaced) const;
  [[nodiscard]] bool is_thinned() const;
  void climb_again();
  void fit_as_judged();
  void fit_again_or_drop_laws();
  void fit_innovations();
  void fit_beside_disturbance();
  // A fit whose filter follows a disturbance.
  struct Beside {
    PredictionTask task;
    Eigen::VectorXd weights;
    DisturbanceForce disturbance;
    JudgedModel found;
    double log_likelihood = 0.0;
  };
  [[nodiscard]] std::optional<Beside> follow_disturbance(const JudgedModel& from,
                                                         const UnmodelledForce& rest,
                                                         Eigen::Index horizon);
  [[nodiscard]] JudgedModel judged(const ExtendedLumpedModel& model, int iterations) const;
  // Fitted by the task of the fit; the weights are set to what a first fit leaves.
  [[nodiscard]] JudgedModel weighed(const ExtendedLumpedModel& model);
  [[nodiscard]] PredictionFitter fitter(const PredictionTask& task) const;
  // In free run from where the search began, too: short windows may lead to another valley.
  [[nodiscard]] JudgedModel judged_from_both(const ExtendedLumpedModel& model) const;
  void choose_horizon();
  [[nodiscard]] bool has_skill(const Eigen::VectorXd& error) const;
  void drop_idle_laws();
  // Whether a law went whose sizes, or whose frequency, the recordings do not tell.
  [[nodiscard]] bool drop_undetermined_law();
  [[nodiscard]] bool raises_held_out(const JudgedModel& without, const JudgedModel& with,
                                     double least = 1.05) const;  // times the error
  [[nodiscard]] PredictionTask held_out_task(const PredictionTask& task) const;
  [[nodiscard]] bool is_told(const PredictionFit& fit, const PlacedFinding& law) const;
  void fit_where_laws_are_told();
  // z of a law on the rung where it was accepted, beside the others found.
  [[nodiscard]] double missed_nearby(const PlacedFinding& law) const;
  [[nodiscard]] bool is_worth_nothing(std::size_t hypothesis, const JudgedModel& without) const;
  [[nodiscard]] double evidence_over(const JudgedModel& without) const {
    return white_evidence(task_, data_->output_count(), without.fit.residuals,
                          found_.fit.residuals);
  }
  [[nodiscard]] bool takes_most(const JudgedModel& without, double z) const;
  [[nodiscard]] bool runs_true() const;
  [[nodiscard]] bool is_needed_in_free_run(const JudgedModel& without) const;
  [[nodiscard]] bool is_surely_there(const PlacedFinding& law, const JudgedModel& without) const;
  [[nodiscard]] bool is_borne_out(const JudgedModel& without) const;
  [[nodiscard]] double least_z() const;
  bool take_better_places();
  bool take_plainer_laws();
  [[nodiscard]] JudgedModel with_sizes_of(const PlacedFinding& rich,
                                          const ExtendedLumpedModel& bare,
                                          std::size_t hypothesis) const;
  bool take_steep_friction(std::size_t law);
  bool take_friction_for_dead_drive(std::size_t law);
  bool take_rival_that_holds(std::size_t law);
  bool take_weight_for_spring(std::size_t law);
  [[nodiscard]] bool predicts_further(JudgedModel& plainer) const;
  void add_short_ripples();
  [[nodiscard]] std::optional<ExtendedLumpedModel> with_ripple(const LatentForce& force) const;
  [[nodiscard]] bool take_plainer_law(std::size_t law);
  // The plainer law and one more of the position, where these predict better than the richer one.
  bool take_sum_with(const JudgedModel& plainer, const PlacedFinding& rich, std::size_t plain);
  void judge_held_out(JudgedModel& model) const;
  [[nodiscard]] ExtendedLumpedModel climbed(ExtendedLumpedModel model) const;
  [[nodiscard]] JudgedModel refitted_without(const PlacedFinding& law) const;
  [[nodiscard]] Eigen::VectorXd deviations_of(const PredictionFit& fit) const;
  [[nodiscard]] std::optional<PredictionTask> another_horizon() const;
  // The model found, fitted by this task and weighed by what it leaves there.
  [[nodiscard]] PredictionFit fitted_at(const PredictionTask& task) const;
  [[nodiscard]] Eigen::VectorXd with_disagreement(Eigen::VectorXd deviations) const;
  [[nodiscard]] Eigen::ArrayXd relative_errors(const PredictionFit& fit) const;

  const PredictionData* data_;
  const PredictionHypotheses* hypotheses_;
  const PredictionFindings* findings_;
  int threads_;
  PredictionTask judged_by_, task_;  // of the errors, and of the fit
  DisturbanceForce disturbance_;     // that the filter of the fit follows
  DisturbanceForce remaining_;       // that the rungs are asked beside; none: no force remains
  Eigen::VectorXd weights_;
  JudgedModel found_, as_given_;
  std::optional<UnmodelledForce> rest_;
  std::map<std::size_t, std::size_t> accepted_as_;  // plainer laws: what they were accepted as
};

}  // namespace graybox
