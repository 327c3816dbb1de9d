#include "diagnosis/response_fits/maximum_likelihood.hpp"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/estimation/quiet_ceres.hpp"
#include "diagnosis/estimation/stop_when_asked.hpp"
#include "diagnosis/response_fits/whitened_residuals.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

// A closed-loop stage whose chi-square lies further above its expectation, in standard deviations,
// has ended in a local minimum (or the model is wrong): another start is worth its time.
constexpr double kRejection = 4.0;
constexpr int kClosedLoopIterations = 40;
constexpr double kClosedLoopTolerance = 1e-6;  // relative decrease of the cost

class Fit {
 public:
  Fit(const ResponseModel& model, std::span<const ResponseMeasurement> measurements,
      const FitOptions& options)
      : model_(model), measurements_(measurements), options_(options) {}

  FitResult run(const Eigen::VectorXd& start) {
    result_.theta = start;
    if (options_.closed_loop_stage && has_feedback()) closed_loop_stage(start);
    result_.status = FitStatus::kIterationLimit;
    while (result_.status == FitStatus::kIterationLimit &&
           result_.renewals < options_.renewal_limit) {
      const Eigen::VectorXd before = result_.theta;
      ++result_.renewals;
      if (!renew(ResidualKind::kResponse, before)) {
        result_.status = FitStatus::kFailed;
        return result_;
      }
      const Eigen::VectorXd moved = result_.theta - before;
      const double standard_errors = std::sqrt(moved.dot(result_.information * moved));
      if (standard_errors <= options_.tolerance) result_.status = FitStatus::kConverged;
    }
    invert_information();
    return result_;
  }

 private:
  [[nodiscard]] bool has_feedback() const {
    const auto any = std::ranges::find_if(
        measurements_, [](const ResponseMeasurement& data) { return !data.frequencies.empty(); });
    return any != measurements_.end() && model_.inverse_controller(any->frequencies[0]).size() > 0;
  }

  // Leaves the theta of the best stage; the start where all of them fail.
  void closed_loop_stage(const Eigen::VectorXd& start) {
    Random random(options_.seed);
    Eigen::VectorXd best = start;
    double best_chi_square = std::numeric_limits<double>::infinity();
    while (result_.starts < options_.starts) {
      result_.theta = result_.starts == 0 ? start : perturbed(start, random);
      ++result_.starts;
      if (!renew(ResidualKind::kClosedLoop, start)) continue;
      if (result_.chi_square < best_chi_square) {
        best_chi_square = result_.chi_square;
        best = result_.theta;
      }
      if (result_.lack_of_fit() < kRejection) break;
    }
    result_.theta = best;
  }

  [[nodiscard]] Eigen::VectorXd perturbed(const Eigen::VectorXd& start, Random& random) const {
    Eigen::VectorXd other = internal(start);
    const Eigen::VectorXd deviation = prior_deviation(start);
    for (Eigen::Index p = 0; p < other.size(); ++p) other(p) += deviation(p) * random.normal();
    return external(other);
  }

  // The parameters as Ceres sees them.
  [[nodiscard]] bool logarithmic() const { return options_.scale == ParameterScale::kLogarithmic; }
  [[nodiscard]] Eigen::VectorXd internal(const Eigen::VectorXd& theta) const {
    return logarithmic() ? Eigen::VectorXd(theta.array().log()) : theta;
  }
  [[nodiscard]] Eigen::VectorXd external(const Eigen::VectorXd& parameters) const {
    return logarithmic() ? Eigen::VectorXd(parameters.array().exp()) : parameters;
  }
  [[nodiscard]] Eigen::VectorXd prior_deviation(const Eigen::VectorXd& start) const {
    Eigen::VectorXd deviation = Eigen::VectorXd::Constant(start.size(), options_.start_spread);
    for (Eigen::Index p = 0; !logarithmic() && p < start.size(); ++p) {
      if (start(p) != 0.0) deviation(p) *= std::abs(start(p));
    }
    return deviation;
  }

  // One minimisation with operating points and noise of the present theta; leaves theta, H and
  // chi-square of its end. False where the model can't be evaluated; theta is then what it was.
  bool renew(ResidualKind kind, const Eigen::VectorXd& prior_mean) {
    Eigen::VectorXd parameters = internal(result_.theta);
    ceres::Problem problem;
    std::vector<const WhitenedResiduals*> blocks;  // of each measurement; the problem owns them
    try {
      for (const ResponseMeasurement& measurement : measurements_) {
        auto residuals = std::make_unique<WhitenedResiduals>(measurement, model_, result_.theta,
                                                             options_.scale, kind);
        blocks.push_back(residuals.get());
        problem.AddResidualBlock(residuals.release(), nullptr, parameters.data());
      }
    } catch (const InputError&) {
      return false;
    }
    if (kind == ResidualKind::kClosedLoop) {
      const Eigen::MatrixXd root = prior_deviation(prior_mean).cwiseInverse().asDiagonal();
      problem.AddResidualBlock(new ceres::NormalPrior(root, internal(prior_mean)), nullptr,
                               parameters.data());
    }
    ceres::Solver::Summary summary;
    silence_ceres();
    ceres::Solver::Options solver = solver_options(kind);
    StopWhenAsked stop;
    solver.callbacks.push_back(&stop);
    silence_ceres();
    ceres::Solve(solver, &problem, &summary);
    result_.iterations += static_cast<int>(summary.iterations.size());
    if (!summary.IsSolutionUsable() || !external(parameters).allFinite()) return false;
    result_.theta = external(parameters);
    return evaluate_end(parameters, blocks);
  }

  [[nodiscard]] ceres::Solver::Options solver_options(ResidualKind kind) const {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    solver.num_threads = options_.threads;
    solver.logging_type = ceres::SILENT;
    solver.parameter_tolerance = 1e-14;
    solver.gradient_tolerance = 0.0;
    if (kind == ResidualKind::kClosedLoop) {
      solver.max_num_iterations = std::min(kClosedLoopIterations, options_.iteration_limit);
      solver.function_tolerance = kClosedLoopTolerance;
    } else {
      // A step of t standard errors lowers the cost by t^2 / 2; Ceres compares with the cost, which
      // noise keeps near half the number of residuals.
      std::size_t residuals = 0;
      for (const ResponseMeasurement& data : measurements_) residuals += 2 * data.channel_count();
      solver.max_num_iterations = options_.iteration_limit;
      solver.function_tolerance =
          0.1 * options_.tolerance * options_.tolerance / static_cast<double>(residuals);
    }
    return solver;
  }

  // H and chi-square, block by block.
  bool evaluate_end(const Eigen::VectorXd& parameters,
                    const std::vector<const WhitenedResiduals*>& blocks) {
    const Eigen::Index d = parameters.size();
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;  // transposed: Ceres writes it row by row
    result_.chi_square = 0.0;
    result_.information.setZero(d, d);
    gradient_covariance_.setZero(d, d);
    Eigen::Index count = 0;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const WhitenedResiduals* block = blocks[b];
      residuals.resize(block->num_residuals());
      jacobian.resize(d, residuals.size());
      const double* at = parameters.data();
      double* derivatives = jacobian.data();
      if (!block->Evaluate(&at, residuals.data(), &derivatives)) return false;
      result_.chi_square += residuals.squaredNorm();
      result_.information.selfadjointView<Eigen::Lower>().rankUpdate(jacobian);
      widen(measurements_[b], jacobian);
      gradient_covariance_.selfadjointView<Eigen::Lower>().rankUpdate(jacobian);
      count += residuals.size();
    }
    result_.degrees_of_freedom = static_cast<std::size_t>(count - d);
    const Eigen::VectorXd chain = logarithmic() ? Eigen::VectorXd(result_.theta.cwiseInverse())
                                                : Eigen::VectorXd(Eigen::VectorXd::Ones(d));
    for (Eigen::MatrixXd* matrix : {&result_.information, &gradient_covariance_}) {
      const Eigen::MatrixXd full = matrix->selfadjointView<Eigen::Lower>();
      *matrix = chain.asDiagonal() * full * chain.asDiagonal();
    }
    return result_.information.allFinite();
  }

  [[nodiscard]] bool estimated_noise() const {
    return std::ranges::any_of(measurements_, [](const ResponseMeasurement& measurement) {
      return std::ranges::any_of(measurement.noise, [](const ResponseNoise& noise) {
        return noise.degrees_of_freedom > 0.0;
      });
    });
  }

  // Multiplies the derivatives (d x residuals) at each frequency by kappa^(1/2).
  static void widen(const ResponseMeasurement& measurement, Eigen::MatrixXd& jacobian) {
    Eigen::Index column = 0;
    for (std::size_t f = 0; f < measurement.noise.size(); ++f) {
      const Eigen::Index count = 2 * measurement.responses[f].size();
      const double q = measurement.noise[f].degrees_of_freedom;
      if (q > 0.0) {
        jacobian.middleCols(column, count) *=
            std::sqrt(weights_widening(q, measurement.responses[f].rows()));
      }
      column += count;
    }
  }

  // H must be positive definite after scaling to unit diagonal, to a relative 1e-12.
  void invert_information() {
    const Eigen::VectorXd diagonal = result_.information.diagonal();
    if ((diagonal.array() > 0.0).all()) {
      const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd correlation =
          scale.asDiagonal() * result_.information * scale.asDiagonal();
      const Eigen::LLT<Eigen::MatrixXd> factor(correlation);
      if (factor.info() == Eigen::Success && factor.rcond() > 1e-12) {
        const Eigen::Index d = diagonal.size();
        const Eigen::MatrixXd inverse =
            scale.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(d, d)) * scale.asDiagonal();
        result_.covariance =
            estimated_noise() ? Eigen::MatrixXd(inverse * gradient_covariance_ * inverse) : inverse;
        return;
      }
    }
    result_.status = FitStatus::kSingular;
  }

  const ResponseModel& model_;
  std::span<const ResponseMeasurement> measurements_;
  const FitOptions& options_;
  FitResult result_;
  Eigen::MatrixXd gradient_covariance_;  // S
};

void check(const ResponseModel& model, const ResponseMeasurement& measurement, std::size_t number) {
  const auto fail = [&](const std::string& text) {
    throw InputError(fmt::format("measurement {}: {}", number, text));
  };
  const std::size_t count = measurement.frequencies.size();
  if (measurement.responses.size() != count) {
    fail(fmt::format("{} responses for {} frequencies", measurement.responses.size(), count));
  }
  if (!measurement.noise.empty() && measurement.noise.size() != count) {
    fail(fmt::format("noise at {} of {} frequencies", measurement.noise.size(), count));
  }
  if (!(measurement.experiments > 0.0)) {
    fail(fmt::format("the number of experiments must be positive, is {}", measurement.experiments));
  }
  const Eigen::Index n_y = model.output_count(), n_u = model.input_count();
  for (const Eigen::MatrixXcd& response : measurement.responses) {
    if (response.rows() != n_y || response.cols() != n_u || !response.allFinite()) {
      fail(fmt::format("responses must be finite {} x {} matrices", n_y, n_u));
    }
  }
  for (const ResponseNoise& noise : measurement.noise) {
    if (noise.left.rows() != n_y || noise.left.cols() != n_y || noise.right.rows() != n_u ||
        noise.right.cols() != n_u || !noise.left.allFinite() || !noise.right.allFinite()) {
      fail(fmt::format("noise factors must be finite, {0} x {0} and {1} x {1}", n_y, n_u));
    }
    const double q = noise.degrees_of_freedom;
    if (q != 0.0 && !(q > static_cast<double>(n_y) + 1.0)) {
      fail(fmt::format("{} degrees of freedom of the noise of {} outputs are too few", q, n_y));
    }
  }
}

void check(const ResponseModel& model, std::span<const ResponseMeasurement> measurements,
           const Eigen::VectorXd& start, const FitOptions& options) {
  const std::size_t d = model.parameter_names().size();
  if (start.size() != static_cast<Eigen::Index>(d)) {
    throw InputError(
        fmt::format("fit: the start has {} parameters, the model {}", start.size(), d));
  }
  const bool logarithmic = options.scale == ParameterScale::kLogarithmic;
  if (!start.allFinite() || (logarithmic && !(start.array() > 0.0).all())) {
    throw InputError("fit: the start must be finite, and positive in the logarithmic scale");
  }
  std::size_t numbers = 0;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    check(model, measurements[i], i);
    numbers += 2 * measurements[i].channel_count();
  }
  if (numbers < d) {
    throw InputError(
        fmt::format("fit: {} measured numbers can't determine {} parameters", numbers, d));
  }
  if (!(options.tolerance > 0.0) || !(options.start_spread > 0.0) || options.renewal_limit < 1 ||
      options.iteration_limit < 1 || options.starts < 1 || options.threads < 1) {
    throw InputError("fit: tolerance, start_spread, limits, starts and threads must be positive");
  }
}

}  // namespace

std::string_view to_string(FitStatus status) {
  switch (status) {
    case FitStatus::kConverged:
      return "converged";
    case FitStatus::kIterationLimit:
      return "iteration_limit";
    case FitStatus::kSingular:
      return "singular";
    case FitStatus::kFailed:
      return "failed";
  }
  return "unknown";
}

double FitResult::lack_of_fit() const {
  const auto dof = static_cast<double>(degrees_of_freedom);
  return dof > 0.0 ? (chi_square - dof) / std::sqrt(2.0 * dof) : 0.0;
}

Eigen::VectorXd FitResult::standard_errors() const { return covariance.diagonal().cwiseSqrt(); }

Eigen::MatrixXd information_at(const ResponseModel& model,
                               std::span<const ResponseMeasurement> measurements,
                               const Eigen::VectorXd& theta) {
  const Eigen::Index d = theta.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(d, d);
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;  // transposed
  for (const ResponseMeasurement& measurement : measurements) {
    const WhitenedResiduals block(measurement, model, theta, ParameterScale::kLinear,
                                  ResidualKind::kResponse);
    residuals.resize(block.num_residuals());
    jacobian.resize(d, residuals.size());
    const double* at = theta.data();
    double* derivatives = jacobian.data();
    if (!block.Evaluate(&at, residuals.data(), &derivatives)) {
      throw InputError("information: the model has no finite response there");
    }
    information += jacobian * jacobian.transpose();
  }
  return information;
}

double weights_widening(double degrees_of_freedom, Eigen::Index outputs) {
  const double beyond = degrees_of_freedom - static_cast<double>(outputs);
  return degrees_of_freedom * beyond / (beyond * beyond - 1.0);
}

Eigen::MatrixXd effective_information(const FitResult& fit) {
  if (fit.covariance.size() == 0) return fit.information;
  const Eigen::Index d = fit.covariance.rows();
  return fit.covariance.llt().solve(Eigen::MatrixXd::Identity(d, d));
}

FitResult fit_maximum_likelihood(const ResponseModel& model,
                                 std::span<const ResponseMeasurement> measurements,
                                 const Eigen::VectorXd& start, const FitOptions& options) {
  check(model, measurements, start, options);
  return Fit(model, measurements, options).run(start);
}

}  // namespace graybox
