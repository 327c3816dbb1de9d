#include "diagnosis/periodic/place_force_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>

#include "diagnosis/estimation/quiet_ceres.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/periodic/periodic_evaluation.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// What one recording says about the place.
struct ObservedForce {
  VectorXcd deflection;  // line 0: z at rest, by the static scale
  VectorXcd force;
  VectorXd weight;     // of each line: 1 / standard error
  MatrixXcd imitated;  // D_i of each line, a column each
  double compliance = 0.0;
};

// Of a parameter that acts as a force at the place.
Complex slope_of(const PlantDerivative& change, const VectorXd& b, double w) {
  const auto along = [&](const MatrixXd& matrix) {
    return matrix.size() > 0 ? multiple_along(matrix, b) : 0.0;
  };
  return {along(change.stiffness), w * along(change.damping)};
}

MatrixXcd slopes_of(const std::vector<bool>& imitated, const LinearPlant& plant, const VectorXd& b,
                    const std::vector<double>& frequencies, Index lines) {
  MatrixXcd slopes(lines, std::ranges::count(imitated, true));
  Index column = 0;
  for (std::size_t p = 0; p < imitated.size(); ++p) {
    if (!imitated[p]) continue;
    for (Index k = 0; k < lines; ++k) {
      slopes(k, column) = slope_of(plant.derivatives[p], b, frequencies[at(k)]);
    }
    ++column;
  }
  return slopes;
}

// A force no larger than its noise is none: the motion would have that noise in it, and any law
// would seem to follow it.
void leave_out_noise(const std::vector<MatrixXcd>& receptance, const Location& place,
                     ObservedForce& seen) {
  constexpr double kSignificant = 12.0;  // power over noise: once in e^12 lines
  for (Index k = 0; k < seen.force.size(); ++k) {
    if (std::norm(seen.force(k) * seen.weight(k)) > 2.0 * kSignificant) continue;
    const VectorXcd moved = receptance[at(k)] * (seen.force(k) * place.output);
    seen.deflection(k) += place.input.cast<Complex>().dot(moved);
    seen.force(k) = 0.0;
  }
}

std::vector<ObservedForce> observe(const PlantFamily& family, const PeriodicData& data,
                                   const PeriodicFit& freed, const Location& place) {
  const ModelState model = evaluate_model(family, data, freed.parameters, freed.laws, false, 1);
  SteadyStateSolver solver(family, data, {});
  std::vector<ObservedForce> all;
  MatrixXcd answer;
  for (const MeasuredRecord& record : data.estimation) {
    const PositionResponse& position = model.positions[record.position];
    solver.solve(model, record, nullptr);
    ObservedForce& seen = all.emplace_back();
    seen.force = solver.let_act(model, record, place);
    seen.deflection = solver.state().coordinates.transpose() * place.input.cast<Complex>();
    seen.deflection(0) += solver.static_scale() * place.input.dot(position.plant.rest);
    solver.answer(model, record, place.output, answer);
    seen.weight = answer.colwise().norm();
    seen.weight.head(data.first_line).setZero();
    const std::vector<MatrixXcd>& receptance =
        solver.state().changed.empty() ? position.receptance : solver.state().changed;
    seen.compliance = (place.input.transpose() * receptance.front().real() * place.output)(0, 0);
    leave_out_noise(receptance, place, seen);
    seen.imitated = slopes_of(freed.imitated, position.plant, place.output, data.frequencies,
                              data.last_line + 1);
  }
  return all;
}

// The parameters of the model that the force imitates, then the law's; unknowns are their ratios to
// the start, or, where that is zero, themselves.
struct Unknowns {
  std::vector<std::size_t> imitated;
  VectorXd own;  // of those, at the start
  VectorXd unit, values;
};

Unknowns unknowns_of(const PeriodicFit& freed, const std::vector<double>& law) {
  Unknowns unknowns;
  for (std::size_t p = 0; p < freed.imitated.size(); ++p) {
    if (freed.imitated[p]) unknowns.imitated.push_back(p);
  }
  unknowns.own = freed.parameters(unknowns.imitated);
  const auto of_law = static_cast<Index>(law.size());
  VectorXd start(unknowns.own.size() + of_law);
  start << unknowns.own, Eigen::Map<const VectorXd>(law.data(), of_law);
  unknowns.unit = start.unaryExpr([](double value) { return value != 0.0 ? value : 1.0; });
  unknowns.values = start.cwiseQuotient(unknowns.unit);
  return unknowns;
}

class ForceResidual {
 public:
  ForceResidual(const PlantFamily& family, const PeriodicData& data, const ObservedForce& seen,
                const ActingLaw& law, const Unknowns& unknowns)
      : seen_(seen),
        law_(law),
        start_(unknowns),
        solver_(std::make_unique<SteadyStateSolver>(family, data, SteadyStateOptions{})) {}

  bool operator()(double const* const* unknowns, double* residuals) const {
    const Eigen::Map<const VectorXd> ratios(*unknowns, start_.unit.size());
    const VectorXd values = ratios.cwiseProduct(start_.unit);
    const Index imitated = start_.own.size();
    const VectorXd changes = values.head(imitated) - start_.own;
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

  // The mean by Newton's method with a secant's slope, at least half of that of a place that yields
  // freely. More precise than the differences that derivatives are taken from.
  void settle_mean(const PeriodicLaw& law, const VectorXd& changes, VectorXcd& force) const {
    constexpr int kPasses = 20;
    constexpr double kSmall = 1e-10;
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

  const ObservedForce& seen_;
  const ActingLaw& law_;
  const Unknowns& start_;
  std::unique_ptr<SteadyStateSolver> solver_;  // for its transforms
  mutable PeriodicMotion motion_;
};

void bound(ceres::Problem& problem, double* unknowns, int index, ParameterRange range,
           double unit) {
  constexpr double kLeast = 1e-6;
  if (range == ParameterRange::kAny) return;
  problem.SetParameterLowerBound(unknowns, index,
                                 range == ParameterRange::kPositive ? kLeast : 0.0);
  if (range == ParameterRange::kUnitInterval) {
    problem.SetParameterUpperBound(unknowns, index, 1.0 / unit);
  }
}

void bound_all(ceres::Problem& problem, const PlantFamily& family, const LawEntry& law,
               Unknowns& unknowns) {
  double* values = unknowns.values.data();
  int index = 0;
  for (const std::size_t p : unknowns.imitated) {
    const ParameterRange range =
        family.parameters()[p].positive ? ParameterRange::kPositive : ParameterRange::kAny;
    bound(problem, values, index, range, unknowns.unit(index));
    ++index;
  }
  for (const LawParameter& parameter : law.parameters) {
    bound(problem, values, index, parameter.range, unknowns.unit(index));
    ++index;
  }
}

void add_record(ceres::Problem& problem, std::unique_ptr<ForceResidual> residual,
                VectorXd& values) {
  const int numbers = residual->numbers();
  ceres::NumericDiffOptions steps;
  steps.relative_step_size = 1e-4;
  using Cost = ceres::DynamicNumericDiffCostFunction<ForceResidual, ceres::FORWARD>;
  auto cost = std::make_unique<Cost>(residual.release(), ceres::TAKE_OWNERSHIP, steps);
  cost->AddParameterBlock(static_cast<int>(values.size()));
  cost->SetNumResiduals(numbers);
  problem.AddResidualBlock(cost.release(), nullptr, values.data());
}

void hold_fixed(ceres::Problem& problem, const ActingLaw& law, Unknowns& unknowns) {
  const auto own = static_cast<int>(unknowns.own.size());
  std::vector<int> held;
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    if (is_fixed(law, i)) held.push_back(own + static_cast<int>(i));
  }
  if (held.empty()) return;
  const auto size = static_cast<int>(unknowns.values.size());
  problem.SetManifold(unknowns.values.data(), new ceres::SubsetManifold(size, held));
}

double power_of(const std::vector<ObservedForce>& seen) {
  double power = 0.0;
  for (const ObservedForce& record : seen) {
    power += record.weight.cwiseProduct(record.force.cwiseAbs()).squaredNorm();
  }
  return power;
}

// The law as given, and with thresholds, velocities and other parameters in which it is not linear
// larger and smaller: in those a regression has minima of its own.
std::vector<std::vector<double>> starts_of(const ActingLaw& law) {
  std::vector<std::vector<double>> starts{law.parameters};
  for (const double factor : {2.0, 0.5}) {
    std::vector<double>& start = starts.emplace_back(law.parameters);
    for (std::size_t i = 0; i < start.size(); ++i) {
      if (!law.entry->parameters[i].is_linear && !is_fixed(law, i)) start[i] *= factor;
    }
    if (start == law.parameters) starts.pop_back();
  }
  return starts;
}

// What is left of the force's power, or infinity; `unknowns` end at the best fit.
double regress(const PlantFamily& family, const PeriodicData& data,
               const std::vector<ObservedForce>& seen, const ActingLaw& law, Unknowns& unknowns) {
  ceres::Problem problem;
  for (const ObservedForce& record : seen) {
    add_record(problem, std::make_unique<ForceResidual>(family, data, record, law, unknowns),
               unknowns.values);
  }
  bound_all(problem, family, *law.entry, unknowns);
  hold_fixed(problem, law, unknowns);
  ceres::Solver::Options options;
  options.num_threads = 1;  // sums in one order, whatever the number of threads
  options.max_num_iterations = 30;
  options.function_tolerance = 1e-4;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  silence_ceres();
  ceres::Solve(options, &problem, &summary);
  const double power = power_of(seen);
  if (!summary.IsSolutionUsable() || !(power > 0.0)) {
    return std::numeric_limits<double>::infinity();
  }
  return 2.0 * summary.final_cost / power;
}

}  // namespace

PlaceForceFit fit_place_force(const PlantFamily& family, const PeriodicData& data,
                              const PeriodicFit& freed, const ActingLaw& law) {
  PlaceForceFit result{false, freed.parameters, law, std::numeric_limits<double>::infinity()};
  std::vector<ObservedForce> seen;
  try {
    seen = observe(family, data, freed, law.place->location);
  } catch (const InputError&) {
    return result;  // no rest there
  }
  for (const std::vector<double>& start : starts_of(law)) {
    Unknowns unknowns = unknowns_of(freed, start);
    const double left = regress(family, data, seen, law, unknowns);
    if (!(left < result.left)) continue;
    const VectorXd values = unknowns.values.cwiseProduct(unknowns.unit);
    const Index own = unknowns.own.size();
    result.parameters(unknowns.imitated) = values.head(own);
    std::copy(values.begin() + own, values.end(), result.law.parameters.begin());
    result.left = left;
    result.usable = true;
  }
  return result;
}

}  // namespace graybox
