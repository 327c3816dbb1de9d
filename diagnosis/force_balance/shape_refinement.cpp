#include "diagnosis/force_balance/shape_refinement.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

#include "diagnosis/inverse_dynamics/torque_refinement.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr std::size_t kStarts = 4;   // of a new law
constexpr int kFirstSteps = 6;       // of one law, from each start
constexpr int kOwnSteps = 30;        // from the best of them
constexpr double kHopeful = 1.1;     // times the least rest: a start that goes on
constexpr int kCommonSteps = 15;     // of all
constexpr double kTolerance = 1e-6;  // of the squared rest
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// One law's columns, projected, at the last parameters asked for.
class ProjectedLaw {
 public:
  ProjectedLaw(const ForceBalanceData& data, const BalanceProjection& projection,
               const RefinedLaw& law)
      : data_(data), projection_(projection), law_(law.law) {
    const bool is_bounded = !law.is_new || law.scale->stands_under_force;
    if (is_bounded) widest_transition_ = graybox::widest_transition(*law.scale);
    set(law_.parameters);
  }

  void set(const std::vector<double>& parameters) {
    if (columns_.size() > 0 && parameters == law_.parameters) return;
    law_.parameters = parameters;
    columns_ = projection_.columns(law_columns(law_, data_, data_.estimation));
  }
  [[nodiscard]] const PlacedLaw& law() const { return law_; }
  [[nodiscard]] double widest_transition() const { return widest_transition_; }
  [[nodiscard]] const Eigen::MatrixXd& columns() const { return columns_; }
  [[nodiscard]] Eigen::MatrixXd slopes(const Eigen::VectorXd& amplitudes) const {
    PlacedLaw actual = law_;
    actual.set_amplitudes(amplitudes);
    const std::vector<std::size_t> refined = law_.refined();
    Eigen::MatrixXd result =
        projection_.columns(law_slopes(actual, refined, data_, data_.estimation));
    // Where amplitudes scale refined parameters, too, the step was in the scaled ones.
    const std::vector<std::size_t> scaled = law_.scaled();
    for (std::size_t k = 0; k < refined.size(); ++k) {
      if (std::ranges::find(scaled, refined[k]) != scaled.end()) {
        result.col(static_cast<Index>(k)) *= amplitudes(0);
      }
    }
    return result;
  }

 private:
  const ForceBalanceData& data_;
  const BalanceProjection& projection_;
  PlacedLaw law_;
  // A friction that has been found stays one; a new one that would rather be a damper shows itself.
  double widest_transition_ = kInfinity;
  Eigen::MatrixXd columns_;
};

// The projected problem in the shapes of `moving` laws, the others' shapes held.
class ShapeProblem {
 public:
  ShapeProblem(std::vector<ProjectedLaw>& laws, std::vector<std::size_t> moving,
               const Eigen::VectorXd& force)
      : laws_(laws), moving_(std::move(moving)), force_(force) {
    Index count = 0;
    for (const ProjectedLaw& law : laws_) {
      first_.push_back(count);
      count += law.columns().cols();
    }
    columns_.resize(force_.size(), count);
    lengths_.resize(count);
    for (std::size_t l = 0; l < laws_.size(); ++l) take_columns(l);
    gram_ = columns_.transpose() * columns_;
    right_ = columns_.transpose() * force_;
  }

  [[nodiscard]] std::vector<ParameterRange> ranges() const {
    std::vector<ParameterRange> result;
    for (const std::size_t l : moving_) {
      const PlacedLaw& law = laws_[l].law();
      for (const std::size_t index : law.refined()) {
        result.push_back(law.entry->parameters[index].range);
      }
    }
    return result;
  }
  [[nodiscard]] Eigen::VectorXd values() const {
    std::vector<double> result;
    for (const std::size_t l : moving_) {
      const PlacedLaw& law = laws_[l].law();
      for (const std::size_t index : law.refined()) result.push_back(law.parameters[index]);
    }
    return Eigen::Map<const Eigen::VectorXd>(result.data(), static_cast<Index>(result.size()));
  }
  void set(const Eigen::VectorXd& theta) {
    Index at = 0;
    for (const std::size_t l : moving_) {
      std::vector<double> parameters = laws_[l].law().parameters;
      for (const std::size_t index : laws_[l].law().refined()) parameters[index] = theta(at++);
      laws_[l].set(parameters);
    }
  }

  bool evaluate(const Eigen::VectorXd& theta, Eigen::VectorXd& residuals,
                Eigen::MatrixXd* jacobian) {
    set(theta);
    if (!is_plausible()) return false;
    for (const std::size_t l : moving_) {
      if (!laws_[l].columns().allFinite()) return false;
      take_columns(l);
    }
    multiply_moving();
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor(gram_);
    const Eigen::VectorXd scaled = factor.solve(right_);
    residuals = force_ - columns_ * scaled;
    if (jacobian == nullptr) return residuals.allFinite();
    const Eigen::VectorXd amplitudes = scaled.cwiseQuotient(lengths_);
    jacobian->resize(force_.size(), theta.size());
    Index at = 0;
    for (const std::size_t l : moving_) {
      const Eigen::MatrixXd slopes =
          laws_[l].slopes(amplitudes.segment(first_[l], laws_[l].columns().cols()));
      jacobian->middleCols(at, slopes.cols()) = -slopes;
      at += slopes.cols();
    }
    *jacobian -= columns_ * factor.solve(columns_.transpose() * *jacobian);
    return residuals.allFinite() && jacobian->allFinite();
  }
  [[nodiscard]] double square(const Eigen::VectorXd& theta) {
    Eigen::VectorXd residuals;
    return evaluate(theta, residuals, nullptr) ? residuals.squaredNorm() : kInfinity;
  }

 private:
  // Exponents beyond these make corners, and overflow on motion larger than that of the fit.
  [[nodiscard]] bool is_plausible() const {
    constexpr double kLeast = 0.05, kMost = 20.0;
    for (const std::size_t l : moving_) {
      const PlacedLaw& law = laws_[l].law();
      for (std::size_t i = 0; i < law.parameters.size(); ++i) {
        const LawParameter& parameter = law.entry->parameters[i];
        if (parameter.unit == "1" && parameter.range == ParameterRange::kPositive &&
            !(law.parameters[i] >= kLeast && law.parameters[i] <= kMost)) {
          return false;
        }
        if (parameter.name == "transition_velocity" &&
            law.parameters[i] > laws_[l].widest_transition()) {
          return false;
        }
      }
    }
    return true;
  }

  // A law's columns, each of length one.
  void take_columns(std::size_t law) {
    const Eigen::MatrixXd& own = laws_[law].columns();
    for (Index k = 0; k < own.cols(); ++k) {
      const double length = std::max(own.col(k).norm(), 1e-300);
      lengths_(first_[law] + k) = length;
      columns_.col(first_[law] + k) = own.col(k) / length;
    }
  }
  // Products with the columns of moving laws; the others stay.
  void multiply_moving() {
    for (const std::size_t l : moving_) {
      const Index count = laws_[l].columns().cols();
      const auto own = columns_.middleCols(first_[l], count);
      auto products = gram_.middleCols(first_[l], count);
      products.noalias() = columns_.transpose() * own;
      // The law's own products with each other are in their place already.
      const Index before = first_[l], after = gram_.rows() - before - count;
      gram_.middleRows(before, count).leftCols(before) = products.topRows(before).transpose();
      gram_.middleRows(before, count).rightCols(after) = products.bottomRows(after).transpose();
      right_.segment(first_[l], count).noalias() = own.transpose() * force_;
    }
  }

  std::vector<ProjectedLaw>& laws_;
  std::vector<std::size_t> moving_;
  const Eigen::VectorXd& force_;
  std::vector<Index> first_;  // column of each law
  Eigen::MatrixXd columns_;   // of all laws, each of length one
  Eigen::VectorXd lengths_;
  Eigen::MatrixXd gram_;
  Eigen::VectorXd right_;
};

// Square of the rest after refinement from the problem's values, which become the refined ones.
double refine(ShapeProblem& problem, int steps, const std::function<bool()>& keep_going,
              bool& interrupted) {
  const Eigen::VectorXd start = problem.values();
  if (start.size() == 0) return problem.square(start);
  const double before = problem.square(start);
  if (!std::isfinite(before)) return kInfinity;
  const RefinementResult result = refine_parameters(
      start, problem.ranges(),
      [&problem](const Eigen::VectorXd& theta, Eigen::VectorXd& residuals,
                 Eigen::MatrixXd* jacobian) {
        return problem.evaluate(theta, residuals, jacobian);
      },
      steps, kTolerance, keep_going);
  interrupted = interrupted || result.interrupted;
  const double after = result.values.allFinite() ? problem.square(result.values) : kInfinity;
  if (after <= before) return after;
  return problem.square(start);
}

// Parameters of the laws' shapes at the amplitudes that suit them best, least rest first.
std::vector<std::vector<double>> best_shapes(const RefinedLaw& law, std::vector<ProjectedLaw>& laws,
                                             std::size_t own, const ForceBalanceData& data,
                                             const BalanceProjection& projection) {
  Index others = 0;
  for (std::size_t l = 0; l < laws.size(); ++l) others += l == own ? 0 : laws[l].columns().cols();
  Eigen::MatrixXd fixed(projection.force().size(), others);
  others = 0;
  for (std::size_t l = 0; l < laws.size(); ++l) {
    if (l == own) continue;
    fixed.middleCols(others, laws[l].columns().cols()) = laws[l].columns();
    others += laws[l].columns().cols();
  }
  Eigen::MatrixXd basis(fixed.rows(), 0);
  (void)extend_basis(fixed, basis);
  const Eigen::VectorXd& force = projection.force();
  const Eigen::VectorXd rest = force - basis * (basis.transpose() * force);
  std::vector<std::pair<double, std::vector<double>>> found;
  for (const LawShape& shape : law_shapes(*law.law.entry, *law.law.place, *law.scale)) {
    Eigen::MatrixXd columns =
        projection.columns(basis_columns(law.law, shape.basis, data, data.estimation));
    if (!columns.allFinite()) continue;
    columns -= basis * (basis.transpose() * columns);
    const Eigen::MatrixXd gram = columns.transpose() * columns;
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> normal(gram);
    const Eigen::VectorXd right = columns.transpose() * rest;
    const Eigen::VectorXd amplitudes = normal.solve(right);
    std::vector<double> parameters = shape.parameters(amplitudes);
    if (parameters.empty()) continue;
    found.emplace_back(-amplitudes.dot(right), std::move(parameters));
  }
  std::ranges::stable_sort(found, {}, &std::pair<double, std::vector<double>>::first);
  std::vector<std::vector<double>> result;
  for (auto& [gain, parameters] : found) result.push_back(std::move(parameters));
  return result;
}

// The best of several starts, the other laws' shapes held.
bool refine_new(const RefinedLaw& law, std::vector<ProjectedLaw>& laws, std::size_t own,
                const ForceBalanceData& data, const BalanceProjection& projection,
                const std::function<bool()>& keep_going) {
  std::vector<std::vector<double>> starts{law.law.parameters};
  if (law.law.refined().size() > 1) {
    for (std::vector<double>& start : best_shapes(law, laws, own, data, projection)) {
      if (starts.size() >= kStarts) break;
      if (start != law.law.parameters) starts.push_back(std::move(start));
    }
  }
  bool interrupted = false;
  const auto refined_from = [&](const std::vector<double>& start, int steps) {
    laws[own].set(start);
    ShapeProblem problem(laws, {own}, projection.force());
    const double square = interrupted ? kInfinity : refine(problem, steps, keep_going, interrupted);
    return std::pair(square, laws[own].law().parameters);
  };
  std::vector<std::pair<double, std::vector<double>>> ends;
  // A load changes all of a robot's own parameters: few steps say nothing.
  const bool sifts = starts.size() > 1 && law.law.entry->use != LawUse::kPayload;
  for (const std::vector<double>& start : starts) {
    ends.push_back(refined_from(start, sifts ? kFirstSteps : kOwnSteps));
  }
  const double first = std::ranges::min(ends | std::views::keys);
  for (auto& end : ends) {
    if (sifts && end.first < kHopeful * first) {
      end = refined_from(std::vector<double>(end.second), kOwnSteps);
    }
  }
  if (interrupted) return false;
  const auto& [least, best] = *std::ranges::min_element(ends);
  laws[own].set(best);
  return std::isfinite(least);
}

}  // namespace

bool refine_shapes(const ForceBalanceData& data, const BalanceProjection& projection,
                   std::vector<RefinedLaw>& laws, const std::function<bool()>& keep_going) {
  std::vector<ProjectedLaw> projected;
  std::vector<std::size_t> moving;
  for (std::size_t l = 0; l < laws.size(); ++l) {
    projected.emplace_back(data, projection, laws[l]);
    if (!laws[l].is_held && !laws[l].law.refined().empty()) moving.push_back(l);
  }
  if (moving.empty()) return true;
  for (const std::size_t l : moving) {
    if (!laws[l].is_new) continue;
    if (!refine_new(laws[l], projected, l, data, projection, keep_going)) return false;
  }
  bool interrupted = false;
  ShapeProblem all(projected, moving, projection.force());
  if (moving.size() > 1 || !laws[moving.front()].is_new) {
    if (!std::isfinite(refine(all, kCommonSteps, keep_going, interrupted)) || interrupted) {
      return false;
    }
  }
  for (std::size_t l = 0; l < laws.size(); ++l)
    laws[l].law.parameters = projected[l].law().parameters;
  return true;
}

}  // namespace graybox
