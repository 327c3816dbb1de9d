#include "diagnosis/studies/efficiency_study.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <numbers>
#include <utility>

#include "diagnosis/response_fits/response_model.hpp"
#include "diagnosis/robot_fits/robot_line_fit.hpp"
#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/robot_information/robot_information.hpp"

namespace graybox {
namespace {

constexpr double kRejection = 4.0;  // lack of fit, in standard deviations

// A seed of its own for each place in the study.
std::uint64_t derived_seed(std::uint64_t seed, std::uint64_t place) {
  return Random(seed + 0x632be59bd9b4e019ULL * (place + 1)).next();
}

bool accepted(const EstimateRow& row) {
  const auto dof = static_cast<double>(row.degrees_of_freedom);
  return row.status == FitStatus::kConverged &&
         row.chi_square - dof <= kRejection * std::sqrt(2.0 * dof);
}

// What the fit says of its estimate, and how far that is from the truth.
void state(const FitResult& fit, EstimateRow& row) {
  row.status = fit.status;
  row.chi_square = fit.chi_square;
  row.degrees_of_freedom = fit.degrees_of_freedom;
  row.theta = fit.theta;
  if (fit.covariance.size() == 0) return;
  const Eigen::VectorXd error = row.theta.array() - 1.0;
  row.error_chi_square = error.dot(fit.covariance.llt().solve(error));
  row.covariance = fit.covariance.selfadjointView<Eigen::Lower>();
}

std::vector<double> hertz(const std::vector<double>& frequencies) {
  std::vector<double> result;
  for (const double w : frequencies) result.push_back(w / (2.0 * std::numbers::pi));
  return result;
}

}  // namespace

std::string_view to_string(StudyData data) {
  return data == StudyData::kResponses ? "responses" : "recordings";
}

EfficiencyStudy::EfficiencyStudy(const RobotModel& robot, const EfficiencyStudyOptions& options)
    : robot_(robot), recorded_(robot), options_(options) {
  if (!(options.start_spread >= 0.0) || options.period < 2 || options.periods < 2 ||
      !(options.degrees_of_freedom > static_cast<double>(robot.motor_count()) + 1.0)) {
    throw InputError(
        "efficiency study: needs two periods or more, and more degrees of freedom than outputs");
  }
  lines_ = odd_lines(hertz(robot.frequencies), options.period, robot.sample_time);
  recorded_.frequencies.clear();
  const double duration = static_cast<double>(options.period) * robot.sample_time;
  for (const std::size_t line : lines_) {
    recorded_.frequencies.push_back(2.0 * std::numbers::pi * static_cast<double>(line) / duration);
  }
  // A(k)^2 = Phi_r / n_y at each line (multisine.hpp).
  const auto inputs = static_cast<double>(robot.motor_count());
  const double amplitude = std::sqrt(robot.reference_psd / inputs);
  rms_ = amplitude * std::sqrt(2.0 * static_cast<double>(lines_.size()) /
                               (inputs * static_cast<double>(options.period)));
  // From the bins around the line itself, in the recordings of one experiment.
  responses_.leakage.samples = static_cast<int>(std::ceil(options.degrees_of_freedom / inputs));
  responses_.periodic.degrees_of_freedom = options.degrees_of_freedom;
}

Eigen::MatrixXd EfficiencyStudy::predicted_covariance(const StudiedDesign& design,
                                                      StudyData data) const {
  const bool recordings = data == StudyData::kRecordings;
  const RobotModel& robot = recordings ? recorded_ : robot_;
  const auto d = static_cast<Eigen::Index>(robot.parameters.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(d, d);
  double records = 0.0;
  for (std::size_t i = 0; i < design.positions.size(); ++i) {
    const auto experiments = static_cast<double>(design.experiments[i]);
    records += experiments * static_cast<double>(robot.motor_count());
    information += experiments * robot_information_matrix(robot, design.positions[i]);
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  if (factor.info() != Eigen::Success) {
    throw InputError(fmt::format("design {}: its information matrix is singular", design.name));
  }
  const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(d, d));
  if (!recordings) return covariance;
  const auto periods = static_cast<double>(options_.periods);
  return weights_widening(records * (periods - 1.0), robot.motor_count()) / periods * covariance;
}

std::uint64_t EfficiencyStudy::seed_of(const StudiedDesign& design, StudyData data,
                                       int repetition) const {
  std::uint64_t seed = derived_seed(options_.seed, static_cast<std::uint64_t>(data));
  if (data == StudyData::kRecordings) seed = derived_seed(seed, options_.period * options_.periods);
  for (const char letter : design.name) {
    seed = derived_seed(seed, static_cast<std::uint64_t>(static_cast<unsigned char>(letter)));
  }
  return derived_seed(seed, static_cast<std::uint64_t>(repetition));
}

ResponseMeasurement EfficiencyStudy::record(const Eigen::VectorXd& position,
                                            std::int64_t experiments, std::uint64_t seed,
                                            PeriodicData& data) const {
  const auto plant = local_robot_plant(recorded_, {}, position);
  const PeriodicLayout layout{options_.period, options_.periods, lines_};
  const PeriodicLayout silent{options_.period, options_.periods, detection_lines(layout)};
  RealTransform transform(layout.period * layout.periods);
  const Eigen::Index n = recorded_.motor_count();
  std::vector<PeriodicRecord> records;
  for (std::int64_t m = 0; m < experiments; ++m) {
    const std::uint64_t own = derived_seed(seed, static_cast<std::uint64_t>(m));
    const Multisine signal({.period = options_.period, .lines = lines_, .inputs = n, .rms = rms_},
                           own);
    for (Eigen::Index sub = 0; sub < n; ++sub) {
      const ClosedLoopOptions loop{.settling_periods = options_.settling_periods,
                                   .periods = options_.periods,
                                   .noise_psd_slope = recorded_.velocity_psd_slope,
                                   .seed = derived_seed(own, static_cast<std::uint64_t>(sub))};
      const Recording recording = simulate_closed_loop(
          *plant, recorded_.controller, recorded_.sample_time, signal.reference(sub), loop);
      Eigen::MatrixXd signals(recording.output.cols(), 3 * n);
      signals << recording.output.transpose(), recording.input.transpose(),
          recording.reference.transpose();
      PeriodicRecord record;
      record.realisation = static_cast<std::size_t>(m + 1);
      record.sub_experiment = static_cast<std::size_t>(sub + 1);
      const Eigen::MatrixXcd spectra = record_spectra(signals, transform);
      record.spectra = line_spectra(spectra, layout, responses_.leakage);
      record.detection = line_spectra(spectra, silent, responses_.leakage);
      records.push_back(std::move(record));
      data.estimation.push_back(measured_record(data, signals.leftCols(2 * n), n, transform));
      data.estimation.back().position = data.positions.size();
    }
  }
  FrequencyResponseEstimate estimate;
  estimate.outputs.resize(static_cast<std::size_t>(n));
  estimate.inputs.resize(static_cast<std::size_t>(n));
  estimate.period = options_.period;
  estimate.periods = options_.periods;
  estimate.sample_time = recorded_.sample_time;
  estimate.lines = lines_;
  estimate.frequencies = recorded_.frequencies;
  for (const double angle : position) {
    estimate.position.push_back(angle * 180.0 / std::numbers::pi);
  }
  std::vector<const PeriodicRecord*> pointers;
  for (const PeriodicRecord& each : records) pointers.push_back(&each);
  estimate_periodic_response(pointers, static_cast<std::size_t>(n), responses_.periodic,
                             "simulation", estimate);
  data.positions.push_back(position);
  return response_measurement(estimate, CovarianceKind::kNoise);
}

void EfficiencyStudy::fit_responses(const std::vector<ResponseMeasurement>& measurements,
                                    const RobotModel& robot, const Eigen::VectorXd& start,
                                    EstimateRow& row) const {
  const RobotResponseModel model(robot);
  FitOptions fit_options = options_.fit;
  FitResult fit = fit_maximum_likelihood(model, measurements, start, fit_options);
  if (fit.status != FitStatus::kConverged || fit.lack_of_fit() > kRejection) {
    fit_options.closed_loop_stage = true;
    fit = fit_maximum_likelihood(model, measurements, start, fit_options);
  }
  state(fit, row);
}

void EfficiencyStudy::refine_on_recordings(PeriodicData& data, EstimateRow& row) const {
  if (row.status == FitStatus::kFailed) return;
  const auto family = robot_family(recorded_, PlantKind::kLocal);
  state(fit_lines(*family, row.theta, {.noise_samples = options_.degrees_of_freedom}, data).fit,
        row);
}

EstimateRow EfficiencyStudy::estimate(const StudiedDesign& design, StudyData data,
                                      int repetition) const {
  const std::uint64_t seed = seed_of(design, data, repetition);
  Random random(seed);
  const bool recordings = data == StudyData::kRecordings;
  const RobotModel& robot = recordings ? recorded_ : robot_;
  Eigen::VectorXd start(static_cast<Eigen::Index>(robot.parameters.size()));
  for (double& value : start) value = std::exp(options_.start_spread * random.normal());
  EstimateRow row;
  row.data = data;
  row.design = design.name;
  row.repetition = repetition;
  std::vector<ResponseMeasurement> measurements;
  PeriodicData spectra = periodic_frame(options_.period, robot.sample_time, lines_, 1.0);
  spectra.outputs.resize(static_cast<std::size_t>(robot.motor_count()));
  for (std::size_t i = 0; i < design.positions.size(); ++i) {
    measurements.push_back(
        recordings
            ? record(design.positions[i], design.experiments[i], derived_seed(seed, i), spectra)
            : simulate_measurement(robot, design.positions[i],
                                   static_cast<double>(design.experiments[i]), random));
  }
  fit_responses(measurements, robot, start, row);
  if (recordings) refine_on_recordings(spectra, row);
  return row;
}

void run_efficiency_study(const EfficiencyStudy& study, const std::vector<StudyTask>& tasks,
                          int threads, const std::function<bool(const EstimateRow&)>& on_row) {
  std::atomic<bool> stopped = false;
  std::exception_ptr failure;
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
  for (std::size_t k = 0; k < tasks.size(); ++k) {
    if (stopped) continue;
    try {
      const EstimateRow row = study.estimate(*tasks[k].design, tasks[k].data, tasks[k].repetition);
#pragma omp critical(graybox_efficiency_study)
      if (!stopped && !on_row(row)) stopped = true;
    } catch (...) {
#pragma omp critical(graybox_efficiency_study)
      failure = std::current_exception();
      stopped = true;
    }
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

StudySummary summarise(const EfficiencyStudy& study, const StudiedDesign& design, StudyData data,
                       std::span<const EstimateRow> rows) {
  StudySummary summary;
  summary.data = data;
  summary.design = design.name;
  summary.predicted = study.predicted_covariance(design, data);
  std::vector<const EstimateRow*> kept;
  for (const EstimateRow& row : rows) {
    if (row.data != data || row.design != design.name) continue;
    if (accepted(row)) {
      kept.push_back(&row);
    } else {
      ++summary.rejected;
    }
  }
  std::ranges::sort(kept, {}, &EstimateRow::repetition);
  const Eigen::Index d = summary.predicted.rows();
  summary.estimates.resize(static_cast<Eigen::Index>(kept.size()), d);
  summary.stated = Eigen::MatrixXd::Zero(d, d);
  const double region = chi_square_quantile(kConfidence, static_cast<double>(d));
  const double width = normal_quantile(0.5 + kConfidence / 2.0);
  std::size_t inside = 0;
  std::vector<std::size_t> covered(static_cast<std::size_t>(d), 0);
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const EstimateRow& row = *kept[k];
    summary.estimates.row(static_cast<Eigen::Index>(k)) = row.theta.transpose();
    summary.stated += row.covariance / static_cast<double>(kept.size());
    inside += row.error_chi_square <= region ? 1U : 0U;
    for (Eigen::Index p = 0; p < d; ++p) {
      const bool covers = std::abs(row.theta(p) - 1.0) <= width * std::sqrt(row.covariance(p, p));
      covered[static_cast<std::size_t>(p)] += covers ? 1U : 0U;
    }
  }
  summary.statistics =
      compare_with_prediction(summary.estimates, Eigen::VectorXd::Ones(d), summary.predicted);
  summary.against_stated =
      compare_with_prediction(summary.estimates, Eigen::VectorXd::Ones(d), summary.stated);
  summary.ellipsoid_coverage = share_of(inside, kept.size());
  for (const std::size_t count : covered) {
    summary.parameter_coverage.push_back(share_of(count, kept.size()));
  }
  return summary;
}

}  // namespace graybox
