// How a model is judged on recordings kept out of the fit. Of these the predictor sees the first
// 200 samples, then runs free to the end; or it looks as far ahead as the fit does.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "diagnosis/final_fit/judged_model.hpp"
#include "diagnosis/final_fit/last_fit.hpp"
#include "diagnosis/prediction_error/prediction_curves.hpp"
#include "diagnosis/prediction_error/unmodelled_force.hpp"

namespace graybox {

inline constexpr double kDisturbedShare = 0.05;  // of the signal, that a disturbance may cost

// Windows as long as the fit's, or whole runs, of the recordings kept out.
[[nodiscard]] PredictionTask held_out_task(const LastFit& last, const PredictionTask& task);

// None: no recordings were kept out, or the model can't follow them.
[[nodiscard]] std::optional<HeldOutError> held_out_by(const LastFit& last,
                                                      const ExtendedLumpedModel& model,
                                                      const PredictionTask& task);

// The error kept out by which laws are weighed: as far ahead as the fit looks where it stands
// beside a disturbance, which costs more over a whole run than any law; else that of the model.
[[nodiscard]] std::optional<HeldOutError> law_error_held_out(const LastFit& last,
                                                             const JudgedModel& model);

// Whether `with` raises that error above that of `without`, so many times.
[[nodiscard]] bool raises_held_out(const LastFit& last, const JudgedModel& without,
                                   const JudgedModel& with, double least = 1.05);

// Sets what is kept out of the model: its error, and the scale of the signals.
void judge_held_out(const LastFit& last, JudgedModel& model);

// The model found, fitted to the recordings kept out by themselves; unusable without any.
[[nodiscard]] JudgedModel fit_of_kept_out(const LastFit& last);

// The error of a model, as far ahead as the force that remains beside the one found costs at most
// `share` of each output's signal. None: no recordings were kept out, or it costs more everywhere.
[[nodiscard]] std::optional<HeldOutError> error_held_out_ahead(const LastFit& last,
                                                               const ExtendedLumpedModel& model,
                                                               const UnmodelledForce& rest,
                                                               double share);

// Each output's error on recordings kept out, over that of the fit; none below the noise. Where
// what is kept out is the larger motion, or the harder driven, the ratio of the signals, or of
// the drives, is divided out: what a law lacks grows with these, and so do most disturbances. In
// free run where the plant forgets, else as far ahead as the remaining force lets foresee.
struct HeldOutGrowth {
  Eigen::VectorXd ratio;
  Eigen::VectorXd deviation;  // of its logarithm, by blocks
};
[[nodiscard]] std::optional<HeldOutGrowth> growth_kept_out(const LastFit& last,
                                                           const UnmodelledForce& rest);

// Along time, those of recordings kept out first: by the predictions that its errors are of.
[[nodiscard]] std::vector<ResidualCurve> curves_of(const LastFit& last, const JudgedModel& model);

}  // namespace graybox
