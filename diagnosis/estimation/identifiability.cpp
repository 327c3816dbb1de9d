#include "diagnosis/estimation/identifiability.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSingular = 1e-12;     // eigenvalues of R below are rounding
constexpr double kPart = 1e-4;          // a smaller part in an unseen direction is rounding
constexpr double kUnseen = 1.0;         // relative standard error
constexpr double kWeak = 0.2;           // likewise
constexpr double kMentioned = 0.05;     // smaller relative changes are left out of the words
constexpr double kSameRelation = 0.02;  // how well a direction must fit a sum, product or ratio

// Gauss and Jordan with full pivoting on the columns of a basis: each column of the result has an
// entry 1 where all others have 0, so that it names few parameters.
void make_sparse(Eigen::MatrixXd& basis) {
  std::vector<bool> used(static_cast<std::size_t>(basis.rows()), false);
  for (Eigen::Index k = 0; k < basis.cols(); ++k) {
    Eigen::Index pivot_row = 0, pivot_column = k;
    double largest = -1.0;
    for (Eigen::Index column = k; column < basis.cols(); ++column) {
      for (Eigen::Index row = 0; row < basis.rows(); ++row) {
        if (used[static_cast<std::size_t>(row)] || std::abs(basis(row, column)) <= largest)
          continue;
        largest = std::abs(basis(row, column));
        pivot_row = row;
        pivot_column = column;
      }
    }
    used[static_cast<std::size_t>(pivot_row)] = true;
    basis.col(k).swap(basis.col(pivot_column));
    basis.col(k) /= basis(pivot_row, k);
    for (Eigen::Index column = 0; column < basis.cols(); ++column) {
      if (column == k) continue;
      const double factor = basis(pivot_row, column);
      basis.col(column) -= factor * basis.col(k);
    }
  }
}

std::string percent(double share) {
  return std::isfinite(share) ? fmt::format("{:.3g} %", 100.0 * share) : std::string("infinite");
}

// The function of two parameters that stays the same along the direction, if it is a plain one.
const char* kept_function(double change_1, double change_2, double value_1, double value_2) {
  const auto cancel = [](double a, double b) {
    return std::abs(a + b) <= kSameRelation * std::max(std::abs(a), std::abs(b));
  };
  if (cancel(change_1 * value_1, change_2 * value_2)) return "sum";
  if (cancel(change_1 * value_1, -change_2 * value_2)) return "difference";
  if (cancel(change_1, change_2)) return "product";
  if (cancel(change_1, -change_2)) return "ratio";
  if (value_1 != 0.0 && value_2 != 0.0 && cancel(change_1 / value_1, change_2 / value_2)) {
    return "sum of reciprocals (springs in series)";
  }
  return nullptr;
}

std::string words_of(const UnseenCombination& unseen, const Eigen::VectorXd& values,
                     const std::vector<std::string>& names) {
  const auto& direction = unseen.direction;
  const auto name = [&](Eigen::Index p) { return names[static_cast<std::size_t>(p)]; };
  std::vector<Eigen::Index> members;
  for (Eigen::Index p = 0; p < direction.size(); ++p) {
    if (std::abs(direction(p)) > kMentioned) members.push_back(p);
  }
  const std::string how_little =
      fmt::format("relative standard error {}", percent(unseen.relative_standard_error));
  if (members.size() == 1) {
    return fmt::format("{}: the data do not see it ({})", name(members[0]), how_little);
  }
  if (members.size() == 2) {
    const Eigen::Index a = members[0], b = members[1];
    if (const char* kept = kept_function(direction(a), direction(b), values(a), values(b))) {
      return fmt::format("{} and {}: the data see only their {} ({} of what they do not see)",
                         name(a), name(b), kept, how_little);
    }
  }
  std::string changes;
  for (const Eigen::Index p : members) {
    changes += fmt::format("{}{} {:+.2g} %", changes.empty() ? "" : ", ", name(p), direction(p));
  }
  return fmt::format("changed together they leave the data as they are: {} ({})", changes,
                     how_little);
}

class Examination {
 public:
  Examination(const Eigen::MatrixXd& information, const Eigen::VectorXd& values,
              const std::vector<std::string>& names)
      : information_(information), values_(values), names_(names), scale_(values.cwiseAbs()) {
    for (double& each : scale_) {
      if (each == 0.0) each = 1.0;
    }
  }

  Identifiability run() {
    invert_on_range();
    measure_directions();
    blank_undetermined_at_once();
    examine_finite_directions();
    blank_undetermined();
    return std::move(result_);
  }

 private:
  // C on the range of H, and the directions outside it.
  void invert_on_range() {
    const Eigen::Index d = information_.rows();
    std::vector<Eigen::Index> touched;  // parameters with some information
    for (Eigen::Index p = 0; p < d; ++p) {
      if (information_(p, p) > 0.0) {
        touched.push_back(p);
      } else {
        add_null(Eigen::VectorXd::Unit(d, p));
      }
    }
    result_.covariance.setZero(d, d);
    if (touched.empty()) return;
    const Eigen::VectorXd root =
        Eigen::VectorXd(information_.diagonal())(touched).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        root.asDiagonal() * Eigen::MatrixXd(information_(touched, touched)) * root.asDiagonal());
    const Eigen::MatrixXd directions = root.asDiagonal() * eigen.eigenvectors();
    const Eigen::Index null_count = (eigen.eigenvalues().array() <= kSingular).count();
    const Eigen::Index range = directions.cols() - null_count;
    const Eigen::MatrixXd range_directions = directions.rightCols(range);
    result_.covariance(touched, touched) =
        range_directions * eigen.eigenvalues().tail(range).cwiseInverse().asDiagonal() *
        range_directions.transpose();
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(d, null_count);
    basis(touched, Eigen::all) = directions.leftCols(null_count);
    basis = Eigen::MatrixXd(scale_.cwiseInverse().asDiagonal() * basis);
    make_sparse(basis);
    for (Eigen::Index k = 0; k < null_count; ++k) add_null(basis.col(k));
  }

  void add_null(const Eigen::VectorXd& direction) { add(direction, kInfinity); }

  void add(const Eigen::VectorXd& direction, double relative_standard_error) {
    Eigen::Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    UnseenCombination unseen;
    unseen.direction = direction / direction(largest);
    unseen.relative_standard_error = relative_standard_error;
    unseen.words = words_of(unseen, values_, names_);
    result_.unseen.push_back(std::move(unseen));
  }

  // From D H D; those of no information are known by now.
  void measure_directions() {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        scale_.asDiagonal() * information_ * scale_.asDiagonal(), Eigen::EigenvaluesOnly);
    const auto null_count = static_cast<Eigen::Index>(result_.unseen.size());
    result_.relative_standard_errors = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseInverse();
    result_.relative_standard_errors.head(null_count).setConstant(kInfinity);
  }

  // Parameters with a part in a direction of no information.
  void blank_undetermined_at_once() {
    for (const UnseenCombination& unseen : result_.unseen) {
      for (Eigen::Index p = 0; p < unseen.direction.size(); ++p) {
        if (std::abs(unseen.direction(p)) > kPart) blank(p);
      }
    }
  }

  void blank(Eigen::Index p) {
    result_.covariance.row(p).setConstant(kNaN);
    result_.covariance.col(p).setConstant(kNaN);
  }

  void examine_finite_directions() {
    const Eigen::Index d = values_.size();
    std::vector<Eigen::Index> rest;
    for (Eigen::Index p = 0; p < d; ++p) {
      if (result_.determined(p)) rest.push_back(p);
    }
    const Eigen::VectorXd size = scale_(rest);
    const Eigen::MatrixXd relative = size.cwiseInverse().asDiagonal() *
                                     Eigen::MatrixXd(result_.covariance(rest, rest)) *
                                     size.cwiseInverse().asDiagonal();
    if (rest.empty()) return;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(relative);
    for (Eigen::Index k = 0; k < eigen.eigenvalues().size(); ++k) {
      const double error = std::sqrt(std::max(eigen.eigenvalues()(k), 0.0));
      if (error <= kUnseen) continue;
      Eigen::VectorXd direction = Eigen::VectorXd::Zero(d);
      direction(rest) = eigen.eigenvectors().col(k);
      add(direction, error);
    }
  }

  void blank_undetermined() {
    for (Eigen::Index p = 0; p < values_.size(); ++p) {
      if (!result_.determined(p)) continue;
      const double error = std::sqrt(result_.covariance(p, p)) / scale_(p);
      if (error > kUnseen) {
        blank(p);
      } else if (error > kWeak) {
        result_.weak.push_back(fmt::format("{}: relative standard error {}",
                                           names_[static_cast<std::size_t>(p)], percent(error)));
      }
    }
  }

  const Eigen::MatrixXd& information_;
  const Eigen::VectorXd& values_;
  const std::vector<std::string>& names_;
  Eigen::VectorXd scale_;
  Identifiability result_;
};

}  // namespace

bool Identifiability::determined(Eigen::Index p) const { return !std::isnan(covariance(p, p)); }

Eigen::MatrixXd Identifiability::correlation() const {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

Identifiability examine_identifiability(const Eigen::MatrixXd& information,
                                        const Eigen::VectorXd& values,
                                        const std::vector<std::string>& names) {
  if (information.rows() != values.size() || information.cols() != values.size() ||
      names.size() != static_cast<std::size_t>(values.size())) {
    throw InputError(fmt::format("identifiability: a {} x {} matrix, {} values and {} names",
                                 information.rows(), information.cols(), values.size(),
                                 names.size()));
  }
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (std::isfinite(values(i)) && information.row(i).allFinite()) continue;
    throw InputError(fmt::format(
        "parameter {}: its value or what the recordings tell of it is no finite number; look for "
        "absurd numbers in the recordings (graybox recordings) and in the model",
        names[static_cast<std::size_t>(i)]));
  }
  return Examination(information, values, names).run();
}

}  // namespace graybox
