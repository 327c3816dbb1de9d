#include "diagnosis/inverse_dynamics/base_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <sstream>

#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kStructuralTolerance = 1e-9;
constexpr double kNegligible = 1e-7;  // share of the largest coefficient: rounding

// Orthonormal basis of the independent columns, W_i = basis * triangle.
class Basis {
 public:
  Basis(Index rows, Index capacity)
      : vectors_(rows, capacity), triangle_(Eigen::MatrixXd::Zero(capacity, capacity)) {}

  // False, with the coefficients of the independent columns, if the column depends on them.
  bool add(const Eigen::VectorXd& column, double tolerance, Eigen::VectorXd& coefficients) {
    const auto basis = vectors_.leftCols(size_);
    Eigen::VectorXd rest = column;
    Eigen::VectorXd shares = Eigen::VectorXd::Zero(size_);
    for (int pass = 0; pass < 2; ++pass) {
      const Eigen::VectorXd change = basis.transpose() * rest;
      rest.noalias() -= basis * change;
      shares += change;
    }
    const double length = rest.norm();
    if (length <= tolerance * column.norm()) {
      coefficients =
          triangle_.topLeftCorner(size_, size_).triangularView<Eigen::Upper>().solve(shares);
      return false;
    }
    triangle_.col(size_).head(size_) = shares;
    triangle_(size_, size_) = length;
    vectors_.col(size_) = rest / length;
    ++size_;
    return true;
  }

 private:
  Eigen::MatrixXd vectors_, triangle_;
  Index size_ = 0;
};

std::string term(double coefficient, const std::string& name, bool is_first) {
  const double size = std::abs(coefficient);
  const std::string sign =
      is_first ? (coefficient < 0.0 ? "-" : "") : (coefficient < 0.0 ? " - " : " + ");
  const std::string factor = std::abs(size - 1.0) < kNegligible ? "" : fmt::format("{:.6g} ", size);
  return sign + factor + name;
}

// "ZZ2", "M1", "rotor_inertia_2".
bool is_positive(const std::string& name) {
  const bool is_moment = name.starts_with("XX") || name.starts_with("YY") || name.starts_with("ZZ");
  const bool is_mass =
      name.size() > 1 && name[0] == 'M' && std::isdigit(static_cast<unsigned char>(name[1])) != 0;
  return is_moment || is_mass || name.starts_with("rotor_inertia_");
}

void name_base_parameters(const std::vector<std::string>& names, BaseParameters& base) {
  for (Index b = 0; b < base.size(); ++b) {
    const Index own = base.columns[static_cast<std::size_t>(b)];
    std::string name = names[static_cast<std::size_t>(own)];
    std::string relation = name;
    for (Index p = 0; p < base.regrouping.cols(); ++p) {
      if (p == own || base.regrouping(b, p) == 0.0) continue;
      relation += term(base.regrouping(b, p), names[static_cast<std::size_t>(p)], false);
    }
    const bool is_regrouped = relation != name;
    if (is_regrouped) {
      name += "R";
      base.relations.push_back(fmt::format("{} = {}", name, relation));
    }
    base.names.push_back(std::move(name));
  }
}

}  // namespace

BaseParameters base_parameters(const Eigen::MatrixXd& columns,
                               const std::vector<std::string>& names, double tolerance) {
  BaseParameters base;
  if (columns.cols() == 0) return base;
  Basis basis(columns.rows(), std::min(columns.rows(), columns.cols()));
  base.regrouping = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
  const Eigen::VectorXd lengths = columns.colwise().norm();
  const double negligible = tolerance * lengths.maxCoeff() * 1e-3;
  for (Index p = 0; p < columns.cols(); ++p) {
    if (lengths(p) <= negligible) {
      base.without_effect.push_back(names[static_cast<std::size_t>(p)]);
      continue;
    }
    Eigen::VectorXd coefficients;
    if (basis.add(columns.col(p) / lengths(p), tolerance, coefficients)) {
      base.regrouping(base.size(), p) = 1.0;
      base.columns.push_back(p);
      continue;
    }
    const double largest = coefficients.lpNorm<Eigen::Infinity>();
    for (Index b = 0; b < base.size(); ++b) {
      if (std::abs(coefficients(b)) < kNegligible * largest) continue;
      base.regrouping(b, p) =
          coefficients(b) * lengths(p) / lengths(base.columns[static_cast<std::size_t>(b)]);
    }
  }
  base.regrouping.conservativeResize(base.size(), Eigen::NoChange);
  name_base_parameters(names, base);
  return base;
}

QuantityKind base_parameter_kind(const std::string& name, const std::string& unit,
                                 const std::vector<std::string>& relations) {
  if (name.starts_with("1/gain_")) return QuantityKind::kGain;
  if (name.find('.') != std::string::npos) return quantity_kind(name, unit);
  const auto relation = std::ranges::find_if(
      relations, [&](const std::string& each) { return each.starts_with(name + " = "); });
  if (relation == relations.end()) {
    const bool is_regrouped = name.ends_with('R');  // with what is not known
    return is_positive(name) && !is_regrouped ? quantity_kind(name, unit) : QuantityKind::kOther;
  }
  std::istringstream words(relation->substr(name.size() + 3));
  for (std::string word; words >> word;) {
    const bool is_name = std::isalpha(static_cast<unsigned char>(word[0])) != 0;
    if (word[0] == '-' || (is_name && !is_positive(word))) return QuantityKind::kOther;
  }
  return quantity_kind(name, unit);
}

BaseParameters structural_base_parameters(TorqueColumns& columns, Index joints) {
  std::vector<std::string> loads = columns.loads();
  loads.emplace_back();  // and without any
  const Index samples = (columns.size() + 10) * static_cast<Index>(loads.size());
  Eigen::MatrixXd stacked(samples * joints, columns.size());
  Random random(1);
  Eigen::VectorXd q(joints), velocity(joints), acceleration(joints);
  for (Index t = 0; t < samples; ++t) {
    for (Index j = 0; j < joints; ++j) {
      q(j) = random.uniform(-std::numbers::pi, std::numbers::pi);
      velocity(j) = random.normal();
      acceleration(j) = random.normal();
    }
    columns.carry(loads[static_cast<std::size_t>(t) % loads.size()]);
    columns.evaluate(q, velocity, acceleration);
    stacked.middleRows(t * joints, joints) = columns.matrix();
  }
  return base_parameters(stacked, columns.names(), kStructuralTolerance);
}

}  // namespace graybox
