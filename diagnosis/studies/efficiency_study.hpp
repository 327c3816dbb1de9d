// Does a design deliver in practice the covariance that it promises? Experiments of a design are
// simulated again and again with the robot's true parameters theta = 1 known, each time fitted, and
// the scatter of the estimates is held against H^-1 (estimator_statistics.hpp).
//
// Two depths of simulation:
//   kResponses   frequency responses G_hat = G + eta, eta drawn from formula (12), which the fit
//                knows (simulate_measurement());
//   kRecordings  recordings in the time domain: multisine references, sampled controller, noise on
//                the velocities, settled (simulation/closed_loop.hpp) on the exactly sampled local
//                model; then a fit of the responses estimated from them (responses/) and, from
//                there, of the spectral lines themselves (robot_line_fit.hpp), which is what one
//                has in practice. Each experiment is one realisation of n_u sub-experiments with
//                phases of its own.
//
// Predicted covariance. For responses H^-1, H = sum_i m_i H_i. For recordings H_i is that of (12)
// at the excited lines with the amplitude of the multisine, times P for P periods, and kappa
// (maximum_likelihood.hpp) for weights estimated from the bins between the lines. What the plant's
// free motion costs is not in it.
//
//   const EfficiencyStudy study(robot, {.seed = 1});
//   const EstimateRow row = study.estimate(design, StudyData::kResponses, 0);
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/response_fits/maximum_likelihood.hpp"
#include "diagnosis/responses/estimate_responses.hpp"
#include "diagnosis/studies/estimator_statistics.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

enum class StudyData : std::int8_t { kResponses, kRecordings };
[[nodiscard]] std::string_view to_string(StudyData data);

struct StudiedDesign {
  std::string name;
  std::vector<Eigen::VectorXd> positions;  // commanded joint angles, rad
  std::vector<std::int64_t> experiments;   // in each, at least one
};

struct EfficiencyStudyOptions {
  std::uint64_t seed = 1;
  // Each fit starts at theta = 1 off by so much: standard deviation of log theta.
  double start_spread = 0.01;
  FitOptions fit = {.tolerance = 0.03, .closed_loop_stage = false};
  // Of the recordings:
  std::size_t period = 8000;         // samples
  std::size_t settling_periods = 3;  // simulated before
  std::size_t periods = 16;          // recorded
  double degrees_of_freedom = 24.0;  // of the noise covariance of each line, at least
};

struct EstimateRow {
  StudyData data = StudyData::kResponses;
  std::string design;
  int repetition = 0;
  FitStatus status = FitStatus::kFailed;
  double chi_square = 0.0;
  std::size_t degrees_of_freedom = 0;
  Eigen::VectorXd theta;
  Eigen::MatrixXd covariance;     // C as the fit states it; empty: the data do not determine theta
  double error_chi_square = 0.0;  // (theta_hat - 1)^T C^-1 (theta_hat - 1)
};

class EfficiencyStudy {
 public:
  // Keeps a copy of the robot. Throws InputError for options out of range.
  EfficiencyStudy(const RobotModel& robot, const EfficiencyStudyOptions& options);

  // Covariance of theta_hat: see above. Throws InputError where the design is singular.
  [[nodiscard]] Eigen::MatrixXd predicted_covariance(const StudiedDesign& design,
                                                     StudyData data) const;

  // One simulated campaign and its fit, by options, name of the design and repetition alone. May be
  // called from several threads. A fit whose chi-square is rejected is made again by way of the
  // closed-loop stage.
  [[nodiscard]] EstimateRow estimate(const StudiedDesign& design, StudyData data,
                                     int repetition) const;

  // The robot as the recordings excite it: lines and power of the multisine.
  [[nodiscard]] const RobotModel& recorded_robot() const { return recorded_; }

 private:
  [[nodiscard]] std::uint64_t seed_of(const StudiedDesign& design, StudyData data,
                                      int repetition) const;
  // Responses; the recordings' spectra are appended to `data`.
  [[nodiscard]] ResponseMeasurement record(const Eigen::VectorXd& position,
                                           std::int64_t experiments, std::uint64_t seed,
                                           PeriodicData& data) const;
  void fit_responses(const std::vector<ResponseMeasurement>& measurements, const RobotModel& robot,
                     const Eigen::VectorXd& start, EstimateRow& row) const;
  // From the fit of the responses on.
  void refine_on_recordings(PeriodicData& data, EstimateRow& row) const;

  RobotModel robot_;
  RobotModel recorded_;
  EfficiencyStudyOptions options_;
  std::vector<std::size_t> lines_;
  double rms_ = 0.0;  // of each reference
  ResponseOptions responses_;
};

struct StudyTask {
  const StudiedDesign* design = nullptr;
  StudyData data = StudyData::kResponses;
  int repetition = 0;
};

// Tasks are shared among threads; on_row gets the rows as they are finished, one at a time and in
// any order. Returning false stops the study; tasks that are under way are dropped.
void run_efficiency_study(const EfficiencyStudy& study, const std::vector<StudyTask>& tasks,
                          int threads, const std::function<bool(const EstimateRow&)>& on_row);

// The estimates of one design and kind of data against their prediction. Fits that did not converge
// or whose chi-square is rejected (more than 4 standard deviations above its expectation), as a
// user would notice, are counted and left out.
struct StudySummary {
  StudyData data = StudyData::kResponses;
  std::string design;
  std::size_t rejected = 0;
  Eigen::MatrixXd predicted;  // covariance
  Eigen::MatrixXd estimates;  // n x d
  EfficiencyStatistics statistics;
  // The same against what the fits state, on average. Recordings of finite length know less than
  // `predicted`, and fits know by how much.
  Eigen::MatrixXd stated;
  EfficiencyStatistics against_stated;
  // Of the 95 % ellipsoid about theta_hat, and of the 95 % interval of each parameter.
  Interval ellipsoid_coverage;
  std::vector<Interval> parameter_coverage;
};
[[nodiscard]] StudySummary summarise(const EfficiencyStudy& study, const StudiedDesign& design,
                                     StudyData data, std::span<const EstimateRow> rows);

}  // namespace graybox
