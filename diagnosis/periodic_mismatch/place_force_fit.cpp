#include "graybox/diagnosis/periodic_mismatch/place_force_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>

#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

// What one recording says about the place.
struct ObservedForce {
  VectorXcd deflection;  // line 0: z at rest, by the static scale
  VectorXcd force;
  VectorXd weight;     // of each line: 1 / standard error
  MatrixXcd imitated;  // D_i of each line, a column each
  double compliance = 0.0;
};

// b^T D b / (b^T b)^2 of a parameter that acts as a force at the place.
Complex slope_of(const PlantDerivative& change, const VectorXd& b, double w) {
  const double size = b.squaredNorm() * b.squaredNorm();
  const auto along = [&](const MatrixXd& matrix) {
    return matrix.size() > 0 ? b.dot(matrix * b) / size : 0.0;
  };
  return {along(change.stiffness) - w * w * along(change.mass), w * along(change.damping)};
}

std::vector<ObservedForce> observe(const PlantFamily& family, const PeriodicData& data,
                                   const PeriodicFit& freed, const std::vector<ActingLaw>& others,
                                   const Location& place, int threads) {
  const ModelState model = evaluate_model(family, data, freed.parameters, others, false, threads);
  SteadyStateSolver solver(family, data, {});
  std::vector<ObservedForce> all;
  MatrixXcd answer;
  for (const MeasuredRecord& record : data.estimation) {
    const PositionResponse& position = model.positions[record.position];
    solver.solve(model, record, nullptr);
    ObservedForce& seen = all.emplace_back();
    seen.force = solver.free(model, record, place);
    seen.deflection = solver.state().coordinates.transpose() * place.input.cast<Complex>();
    seen.deflection(0) += solver.static_scale() * place.input.dot(position.plant.rest);
    solver.answer(model, record, place.output, answer);
    seen.weight = answer.colwise().norm();
    seen.weight.head(data.first_line).setZero();
    seen.compliance =
        (place.input.transpose() * position.receptance.front().real() * place.output)(0, 0);
    seen.imitated.resize(data.last_line + 1, 0);
    for (std::size_t p = 0; p < freed.imitated.size(); ++p) {
      if (!freed.imitated[p]) continue;
      seen.imitated.conservativeResize(Eigen::NoChange, seen.imitated.cols() + 1);
      for (Index k = 0; k <= data.last_line; ++k) {
        seen.imitated(k, seen.imitated.cols() - 1) =
            slope_of(position.plant.derivatives[p], place.output, data.frequencies[at(k)]);
      }
    }
  }
  return all;
}

// Unknowns: each parameter over its value at the start, or, where that is zero, over 1.
struct Scaled {
  VectorXd unit;
  std::size_t imitated = 0;  // how many of them are the model's; they come first
};

class ForceResidual {
 public:
  ForceResidual(const PlantFamily& family, const PeriodicData& data, const ObservedForce& seen,
                const ActingLaw& law, const VectorXd& own, const Scaled& scaled)
      : data_(data),
        seen_(seen),
        law_(law),
        own_(own),
        scaled_(scaled),
        solver_(std::make_shared<SteadyStateSolver>(family, data, SteadyStateOptions{})) {}

  bool operator()(double const* const* unknowns, double* residuals) const {
    const Eigen::Map<const VectorXd> u(*unknowns, scaled_.unit.size());
    const VectorXd values = u.cwiseProduct(scaled_.unit);
    const auto imitated = static_cast<Index>(scaled_.imitated);
    const VectorXd changes = values.head(imitated) - own_;
    const PeriodicLaw law(*law_.entry,
                          std::span(values.data() + imitated, at(values.size() - imitated)));
    VectorXcd force;
    settle_mean(law, changes, force);
    for (Index k = 0; k < force.size(); ++k) {
      const Complex left = seen_.weight(k) * (seen_.force(k) - force(k));
      *residuals++ = left.real();
      *residuals++ = left.imag();
    }
    return force.allFinite();
  }

  [[nodiscard]] int numbers() const { return 2 * static_cast<int>(seen_.force.size()); }

 private:
  void force_at(const PeriodicLaw& law, const VectorXd& changes, double mean,
                VectorXcd& force) const {
    VectorXcd deflection = seen_.deflection;
    deflection(0) = mean;
    if (!law.is_linear()) solver_->motion_of(deflection, motion_);
    solver_->force_lines(law, deflection, motion_, force);
    force += (seen_.imitated * changes).cwiseProduct(deflection);
  }

  // The mean by Newton's method with a secant's slope, which is at least that of a place that yields freely.
  void settle_mean(const PeriodicLaw& law, const VectorXd& changes, VectorXcd& force) const {
    constexpr int kPasses = 12;
    constexpr double kSmall = 1e-8;
    const double rest = seen_.deflection(0).real();
    const double size = std::max(seen_.deflection.norm(), std::numeric_limits<double>::min());
    double mean = rest, before = 0.0, error_before = 0.0;
    for (int pass = 0; pass < kPasses; ++pass) {
      force_at(law, changes, mean, force);
      const double error = mean - rest + seen_.compliance * force(0).real();
      double slope = 1.0;
      if (pass > 0 && mean != before) {
        slope = std::max(0.5, (error - error_before) / (mean - before));
      }
      if (!(std::abs(error) > kSmall * size)) return;
      before = mean;
      error_before = error;
      mean -= error / slope;
    }
  }

  const PeriodicData& data_;
  const ObservedForce& seen_;
  const ActingLaw& law_;
  const VectorXd& own_;
  const Scaled& scaled_;
  std::shared_ptr<SteadyStateSolver> solver_;  // for its transforms
  mutable PeriodicMotion motion_;
};

void bound(ceres::Problem& problem, double* unknown, int index, ParameterRange range, double unit) {
  constexpr double kLeast = 1e-6;
  switch (range) {
    case ParameterRange::kPositive:
      problem.SetParameterLowerBound(unknown, index, kLeast);
      break;
    case ParameterRange::kNonNegative:
      problem.SetParameterLowerBound(unknown, index, 0.0);
      break;
    case ParameterRange::kUnitInterval:
      problem.SetParameterLowerBound(unknown, index, 0.0);
      problem.SetParameterUpperBound(unknown, index, 1.0 / unit);
      break;
    case ParameterRange::kAny:
      break;
  }
}

}  // namespace

PlaceForceFit fit_place_force(const PlantFamily& family, const PeriodicData& data,
                              const PeriodicFit& freed, const std::vector<ActingLaw>& laws,
                              int threads) {
  PlaceForceFit result{false, freed.parameters, laws.back(), 1.0};
  const std::vector<ObservedForce> seen = observe(
      family, data, freed, {laws.begin(), laws.end() - 1}, result.law.place->location, threads);
  std::vector<std::size_t> imitated;
  for (std::size_t p = 0; p < freed.imitated.size(); ++p) {
    if (freed.imitated[p]) imitated.push_back(p);
  }
  const VectorXd own = freed.parameters(imitated);
  Scaled scaled{VectorXd(own.size() + static_cast<Index>(result.law.parameters.size())),
                imitated.size()};
  scaled.unit << own, Eigen::Map<const VectorXd>(result.law.parameters.data(),
                                                 static_cast<Index>(result.law.parameters.size()));
  VectorXd unknowns(scaled.unit.size());
  for (Index k = 0; k < unknowns.size(); ++k) {
    unknowns(k) = scaled.unit(k) != 0.0 ? 1.0 : 0.0;
    if (scaled.unit(k) == 0.0) scaled.unit(k) = 1.0;
  }
  ceres::Problem problem;
  for (const ObservedForce& record : seen) {
    auto residual = std::make_unique<ForceResidual>(family, data, record, result.law, own, scaled);
    const int numbers = residual->numbers();
    auto cost =
        std::make_unique<ceres::DynamicNumericDiffCostFunction<ForceResidual, ceres::FORWARD>>(
            residual.release());
    cost->AddParameterBlock(static_cast<int>(unknowns.size()));
    cost->SetNumResiduals(numbers);
    problem.AddResidualBlock(cost.release(), nullptr, unknowns.data());
  }
  for (Index k = 0; k < unknowns.size(); ++k) {
    const bool is_own = k < own.size();
    const ParameterRange range =
        is_own ? (family.parameters()[imitated[at(k)]].positive ? ParameterRange::kPositive
                                                                : ParameterRange::kAny)
               : result.law.entry->parameters[at(k - own.size())].range;
    bound(problem, unknowns.data(), static_cast<int>(k), range, scaled.unit(k));
  }
  ceres::Solver::Options options;
  options.num_threads = threads;
  options.max_num_iterations = 30;
  options.function_tolerance = 1e-4;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return result;
  const VectorXd values = unknowns.cwiseProduct(scaled.unit);
  result.parameters(imitated) = values.head(own.size());
  std::copy(values.begin() + own.size(), values.end(), result.law.parameters.begin());
  double power = 0.0;
  for (const ObservedForce& record : seen) {
    power += record.weight.cwiseProduct(record.force.cwiseAbs()).squaredNorm();
  }
  result.left = power > 0.0 ? 2.0 * summary.final_cost / power : 1.0;
  result.usable = true;
  return result;
}

}  // namespace graybox
