#include "diagnosis/signal_faults/lost_sign.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;
using Values = Eigen::Ref<const Eigen::VectorXd>;

constexpr Index kFewest = 50;
constexpr double kMoves = 0.05;  // of the largest speed
constexpr double kEitherWay = 0.1;
constexpr Index kFewestEitherWay = 10;
constexpr double kNearZero = 0.1;
constexpr double kLeft = 0.6;
constexpr Index kOver = 5;  // samples

Eigen::VectorXd changes_over(const Values& rate, Index over) {
  Eigen::VectorXd changes(rate.size());
  for (Index k = 0; k < rate.size(); ++k) {
    const Index from = std::max<Index>(0, k - over / 2);
    changes(k) = rate(std::min(rate.size() - 1, k + over / 2)) - rate(from);
  }
  return changes;
}

Eigen::VectorXd signs_of(const Eigen::VectorXd& values) {
  return values.unaryExpr([](double value) { return value < 0.0 ? -1.0 : 1.0; });
}

// What a mass with friction asks of its drive: speed, its change, and its sign.
Eigen::MatrixXd motion_columns(const Values& rate) {
  Eigen::MatrixXd columns(rate.size(), 3);
  columns << rate, changes_over(rate, kOver), signs_of(rate);
  for (Index c = 0; c < columns.cols(); ++c) {
    columns.col(c) /= std::max(columns.col(c).norm(), 1e-300);
  }
  return columns;
}

// rms of what least squares leave.
double rest_of(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& solver,
               const Eigen::MatrixXd& columns, const Eigen::VectorXd& right,
               Eigen::VectorXd* fitted = nullptr) {
  const Eigen::VectorXd model = columns * solver.solve(right);
  if (fitted != nullptr) *fitted = model;
  return std::sqrt((right - model).squaredNorm() / static_cast<double>(right.size()));
}

// What is left of the sizes, with signs that the motion gives them; it begins with these signs.
double rest_with_signs(const Eigen::MatrixXd& columns, const Eigen::VectorXd& size,
                       Eigen::VectorXd signs) {
  constexpr int kRounds = 6;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(columns);
  double least = HUGE_VAL;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::VectorXd fitted;
    least = std::min(least, rest_of(solver, columns, signs.cwiseProduct(size), &fitted));
    signs = signs_of(fitted);
  }
  return least;
}

}  // namespace

Eigen::VectorXd central_steps(const Values& position) {
  const Index n = position.size();
  Eigen::VectorXd steps = Eigen::VectorXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    const Index from = std::max<Index>(0, k - 1), to = std::min(n - 1, k + 1);
    if (to > from) steps(k) = (position(to) - position(from)) / static_cast<double>(to - from);
  }
  return steps;
}

bool moves_both_ways(const Values& rate) {
  if (rate.size() == 0) return false;
  const double least = kMoves * rate.cwiseAbs().maxCoeff();
  if (!(least > 0.0)) return false;
  const Index forward = (rate.array() > least).count(), backward = (rate.array() < -least).count();
  const auto few = static_cast<double>(std::min(forward, backward));
  return few >= static_cast<double>(kFewestEitherWay) &&
         few >= kEitherWay * static_cast<double>(forward + backward);
}

std::optional<LostSign> find_lost_sign(const Values& drive, const Values& rate) {
  if (drive.size() < kFewest || drive.size() != rate.size()) return {};
  if (!drive.allFinite() || !rate.allFinite() || !moves_both_ways(rate)) return {};
  const bool is_negative = drive.maxCoeff() <= 0.0;
  if (!is_negative && drive.minCoeff() < 0.0) return {};
  const Eigen::VectorXd size = drive.cwiseAbs();
  if (!(size.minCoeff() < kNearZero * quantile(size, 0.95))) return {};
  const Eigen::MatrixXd columns = motion_columns(rate);
  const double with_signs = std::min(rest_with_signs(columns, size, signs_of(columns.col(0))),
                                     rest_with_signs(columns, size, signs_of(columns.col(1))));
  Eigen::MatrixXd plain(columns.rows(), columns.cols() + 1);
  plain << columns, Eigen::VectorXd::Ones(columns.rows());
  const double without = rest_of(Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(plain), plain, size);
  const double whole = std::sqrt(size.squaredNorm() / static_cast<double>(size.size()));
  const double left = with_signs / std::min(without, whole);
  if (!(left < kLeft)) return {};
  return LostSign{left, kLeft / std::max(left, 1e-3), is_negative};
}

}  // namespace graybox
