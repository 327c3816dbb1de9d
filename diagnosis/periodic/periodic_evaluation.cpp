#include "diagnosis/periodic/periodic_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/harmonic_balance/place_observer.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {

namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What a force at the freed place can do, line by line.
void take_out(const MatrixXcd& answer, Eigen::Ref<MatrixXcd> columns) {
  const Index outputs = answer.rows();
  for (Index k = 0; k < answer.cols(); ++k) {
    const double size = answer.col(k).norm();
    if (!(size > 0.0)) continue;
    const Eigen::VectorXcd direction = answer.col(k) / size;
    auto rows = columns.middleRows(k * outputs, outputs);
    const Eigen::RowVectorXcd along = direction.adjoint() * rows;
    rows.noalias() -= direction * along;
  }
}

// Parameters of the model that act as a force at the place: springs and dampers beside it.
std::vector<bool> imitated_by(const ModelState& model, const Location& place) {
  const std::vector<PlantDerivative>& derivatives = model.positions.front().plant.derivatives;
  std::vector<bool> imitated(derivatives.size(), false);
  if (place.kind != LocationKind::kElement) return imitated;
  const VectorXd& b = place.output;
  const auto is_along = [&](const MatrixXd& matrix) {
    const MatrixXd rest = matrix - multiple_along(matrix, b) * b * b.transpose();
    return rest.norm() <= 1e-9 * matrix.norm();
  };
  for (std::size_t p = 0; p < derivatives.size(); ++p) {
    const PlantDerivative& change = derivatives[p];
    imitated[p] = change.mass.size() == 0 &&
                  (change.stiffness.size() == 0 || is_along(change.stiffness)) &&
                  (change.damping.size() == 0 || is_along(change.damping));
  }
  return imitated;
}

}  // namespace

double multiple_along(const MatrixXd& matrix, const VectorXd& b) {
  const double size = b.squaredNorm();
  return b.dot(matrix * b) / (size * size);
}

FitUnknowns::FitUnknowns(const PlantFamily& family, const std::vector<ActingLaw>& laws)
    : family_(family), laws_(laws) {
  for (const ModelParameter& parameter : family.parameters()) {
    kinds_.push_back(parameter.positive ? Kind::kPositive : Kind::kFree);
  }
  for (const ActingLaw& law : laws) {
    for (const LawParameter& parameter : law.entry->parameters) {
      kinds_.push_back(kind_of(parameter.range));
    }
  }
}

FitUnknowns::Kind FitUnknowns::kind_of(ParameterRange range) {
  switch (range) {
    case ParameterRange::kPositive:
      return Kind::kPositive;
    case ParameterRange::kNonNegative:
      return Kind::kNonNegative;
    case ParameterRange::kUnitInterval:
      return Kind::kUnitInterval;
    case ParameterRange::kAny:
      break;
  }
  return Kind::kFree;
}

Index FitUnknowns::model_size() const { return static_cast<Index>(family_.parameters().size()); }

VectorXd FitUnknowns::start_values(const VectorXd& parameters) const {
  VectorXd values(size());
  values.head(parameters.size()) = parameters;
  Index k = parameters.size();
  for (const ActingLaw& law : laws_) {
    for (const double value : law.parameters) values(k++) = value;
  }
  return values;
}

std::vector<ActingLaw> FitUnknowns::laws_at(const VectorXd& values) const {
  std::vector<ActingLaw> laws = laws_;
  Index k = model_size();
  for (ActingLaw& law : laws) {
    for (double& value : law.parameters) value = values(k++);
  }
  return laws;
}

double FitUnknowns::scale(Index k, const VectorXd& values) const {
  return kinds_[at(k)] == Kind::kPositive ? values(k) : 1.0;
}

VectorXd FitUnknowns::moved(const VectorXd& values, const VectorXd& step) const {
  VectorXd result = values;
  for (Index k = 0; k < values.size(); ++k) {
    switch (kinds_[at(k)]) {
      case Kind::kPositive:
        result(k) = values(k) * std::exp(std::clamp(step(k), -0.7, 0.7));
        break;
      case Kind::kNonNegative:
        result(k) = std::max(values(k) + step(k), 0.1 * values(k));
        break;
      case Kind::kUnitInterval:
        result(k) = std::clamp(values(k) + step(k), 0.0, 1.0);
        break;
      case Kind::kFree:
        result(k) = values(k) + step(k);
        break;
    }
  }
  return result;
}

struct PeriodicEvaluator::Workspace {
  SteadyStateSolver solver;
  MatrixXcd jacobian, answer;
  Eigen::VectorXcd residual;
};

struct PeriodicEvaluator::RecordSums {
  MatrixXd information;
  VectorXd gradient;
  VectorXd seen;  // squared derivatives before the freed force has taken its part
  double chi_square = 0.0, unsettled = 0.0;
  MatrixXcd forces;
};

PeriodicEvaluation PeriodicEvaluator::evaluate(const VectorXd& values,
                                               const std::vector<MatrixXcd>* starts,
                                               bool exact) const {
  PeriodicEvaluation result;
  result.values = values;
  std::optional<ModelState> model;
  try {
    model.emplace(evaluate_model(family_, data_, values.head(unknowns_.model_size()),
                                 unknowns_.laws_at(values), true, options_.threads));
  } catch (const InputError&) {
    return result;  // no rest there
  }
  const std::size_t records = data_.estimation.size();
  std::vector<RecordSums> sums(records);
  const StopClock clock;
#pragma omp parallel num_threads(options_.threads)
  {
    Workspace work{SteadyStateSolver(family_, data_, {}), {}, {}, {}};
#pragma omp for schedule(dynamic)
    for (std::size_t i = 0; i < records; ++i) {
      if (clock.stops()) continue;
      sums[i] = sums_of(work, *model, data_.estimation[i],
                        starts != nullptr ? &(*starts)[i] : nullptr, exact);
    }
  }
  stop_if_requested();
  if (options_.freed != nullptr) result.imitated = imitated_by(*model, *options_.freed);
  add_up(sums, result);
  return result;
}

PeriodicEvaluator::RecordSums PeriodicEvaluator::sums_of(Workspace& work, const ModelState& model,
                                                         const MeasuredRecord& record,
                                                         const MatrixXcd* start, bool exact) const {
  RecordSums sums;
  const SteadyState& state = work.solver.solve(model, record, start);
  if (options_.freed != nullptr && options_.freed->kind == LocationKind::kElement) {
    work.solver.let_act(model, record, *options_.freed);
  }
  work.solver.differentiate(model, record, exact, work.jacobian);
  work.residual = state.residual.reshaped();
  if (options_.freed != nullptr) {
    sums.seen = work.jacobian.colwise().squaredNorm();
    answer_at(work.solver, model, record, *options_.freed, work.answer);
    take_out(work.answer, work.jacobian);
    take_out(work.answer, work.residual);
  }
  record.decorrelate(work.jacobian);
  record.decorrelate(work.residual);
  sums.information.noalias() = as_real(work.jacobian).transpose() * as_real(work.jacobian);
  sums.gradient.noalias() = as_real(work.jacobian).transpose() * as_real(work.residual);
  sums.chi_square = work.residual.squaredNorm();
  sums.unsettled = state.unsettled;
  sums.forces = state.forces;
  return sums;
}

// By the unknowns that steps are taken in.
void PeriodicEvaluator::add_up(std::vector<RecordSums>& sums, PeriodicEvaluation& result) const {
  const Index size = unknowns_.size();
  VectorXd scales(size);
  for (Index k = 0; k < size; ++k) scales(k) = unknowns_.scale(k, result.values);
  result.chi_square = 0.0;
  result.information = MatrixXd::Zero(size, size);
  result.gradient = VectorXd::Zero(size);
  result.record_gradients.resize(static_cast<Index>(sums.size()), size);
  Index row = 0;
  for (RecordSums& record : sums) {
    result.record_gradients.row(row++) = record.gradient.transpose();
    result.chi_square += record.chi_square;
    result.unsettled += record.unsettled * record.unsettled / static_cast<double>(sums.size());
    result.information += scales.asDiagonal() * record.information * scales.asDiagonal();
    result.gradient += scales.cwiseProduct(record.gradient);
    result.forces.push_back(std::move(record.forces));
  }
  result.unsettled = std::sqrt(result.unsettled);
  // A force may be finite where its derivatives no longer are.
  if (!std::isfinite(result.chi_square) || !result.information.allFinite() ||
      !result.gradient.allFinite()) {
    result.chi_square = std::numeric_limits<double>::infinity();
  } else if (options_.freed != nullptr) {
    hold_unseen(sums, result);
  }
}

// Parameters that act as forces at the freed place stay as they are: nothing but rounding is left
// of them, or little where laws couple lines.
void PeriodicEvaluator::hold_unseen(const std::vector<RecordSums>& sums,
                                    PeriodicEvaluation& result) {
  constexpr double kLeft = 1e-8;
  VectorXd left = VectorXd::Zero(result.gradient.size()), seen = left;
  for (const RecordSums& record : sums) {
    left += record.information.diagonal();
    seen += record.seen;
  }
  for (Index k = 0; k < left.size(); ++k) {
    const bool is_imitated = at(k) < result.imitated.size() && result.imitated[at(k)];
    if (!is_imitated && left(k) > kLeft * seen(k)) continue;
    result.information.row(k).setZero();
    result.information.col(k).setZero();
    result.gradient(k) = 0.0;
  }
}

}  // namespace graybox
