#include "diagnosis/force_balance_data/uncertain_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "diagnosis/plausibility/plausibility.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kSeen = 1e-9;      // length of a column that the motion shows, of the longest
constexpr double kToldApart = 2.0;  // standard errors
constexpr int kHalvings = 40;

constexpr std::array<std::string_view, 10> kUnits{"kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2",
                                                  "kg m^2", "kg m",   "kg m",   "kg m",   "kg"};
constexpr std::array<std::string_view, 10> kWords{
    "inertia XX", "inertia XY",   "inertia XZ",   "inertia YY",   "inertia YZ",
    "inertia ZZ", "mass times x", "mass times y", "mass times z", "mass"};

PhysicalBody body_of(const StandardParameters& p, std::string name) {
  PhysicalBody body{std::move(name), p(9), p.segment<3>(6), Eigen::Matrix3d(), 0.0};
  body.inertia << p(0), p(1), p(2), p(1), p(3), p(4), p(2), p(4), p(5);
  return body;
}

// The share of the way from one to the other at which the body begins to exist: bodies that can
// exist are a convex set. Infinite where the other one can't exist.
double share_to_possible(const StandardParameters& from, const StandardParameters& to) {
  if (can_exist(body_of(from, {}))) return 0.0;
  if (!can_exist(body_of(to, {}))) return std::numeric_limits<double>::infinity();
  double impossible = 0.0, possible = 1.0;
  for (int halving = 0; halving < kHalvings; ++halving) {
    const double share = 0.5 * (impossible + possible);
    const StandardParameters between = (1.0 - share) * from + share * to;
    (can_exist(body_of(between, {})) ? possible : impossible) = share;
  }
  return possible;
}

// How far a fitted body is from one that can exist, in standard errors of the parameter that must
// change most: on the way to what is stated, or by larger moments of inertia, whichever is nearer.
// Parameters that the motion does not show (error zero) may be anything.
double errors_from_possible(const StandardParameters& fitted, const StandardParameters& stated,
                            const StandardParameters& errors) {
  const auto along = [&](const StandardParameters& way) {
    double most = 0.0;
    for (Index k = 0; k < way.size(); ++k) {
      if (errors(k) > 0.0) most = std::max(most, std::abs(way(k)) / errors(k));
    }
    const double share = share_to_possible(fitted, fitted + way);
    return share == 0.0 ? 0.0 : share * most;
  };
  const double size = fitted.segment<3>(6).squaredNorm() / std::max(fitted(9), 1e-300);
  StandardParameters inertia = StandardParameters::Zero();
  for (const Index moment : {0, 3, 5}) {
    inertia(moment) = 10.0 * (fitted.head<6>().cwiseAbs().maxCoeff() + size);
  }
  return std::min(along(stated - fitted), along(inertia));
}

Eigen::VectorXd lengths_of(std::span<const Eigen::MatrixXd> blocks) {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(blocks.front().cols());
  for (const Eigen::MatrixXd& block : blocks) squares += block.colwise().squaredNorm().transpose();
  return squares.cwiseSqrt();
}

// Those of stated bodies that the motion shows, on one joint or on all (-1). `lengths`: of the
// bodies' columns. `scale`: of the prior.
std::vector<UncertainParameter> parameters_seen(const RigidRobotModel& robot,
                                                const Eigen::VectorXd& lengths, Index joint,
                                                double scale) {
  std::vector<UncertainParameter> parameters;
  for (Index link = 0; link < robot.size(); ++link) {
    const std::optional<RigidBody>& body = robot.joints[static_cast<std::size_t>(link)].body;
    if (!body || !(body->mass > 0.0)) continue;
    const StandardParameters stated = standard_parameters(*body);
    const StandardParameters deviations = prior_deviations(stated, robot.body_uncertainty);
    for (Index k = 0; k < kStandardParameters; ++k) {
      const double length = lengths(link * kStandardParameters + k);
      if (!(length > kSeen * lengths.maxCoeff()) || !(deviations(k) > 0.0)) continue;
      parameters.push_back({link, k, stated(k), scale * deviations(k), joint});
    }
  }
  return parameters;
}

// A departure from what is stated, in the parameter's own unit.
struct BodyDeparture {
  const UncertainParameter* parameter;
  double value, standard_error;
};

BodyDeparture departure_of(const ForceBalanceData& data, const UncertainParameter& parameter,
                           const std::vector<LawParameterEstimate>& model_parameters,
                           const LawParameterEstimate& estimate) {
  if (parameter.joint < 0) return {&parameter, estimate.value, estimate.standard_error};
  const auto joint = static_cast<std::size_t>(parameter.joint);
  const Index gain = data.gain_parameters[joint];
  const double inverse = gain >= 0 ? model_parameters[static_cast<std::size_t>(gain)].value
                                   : data.prior_gains(parameter.joint);
  return {&parameter, estimate.value / inverse, estimate.standard_error / std::abs(inverse)};
}

// The departure with the least standard error, for each parameter of a link.
std::vector<BodyDeparture> departures_of(
    const ForceBalanceData& data, const std::vector<LawParameterEstimate>& model_parameters) {
  std::map<std::pair<Index, Index>, BodyDeparture> best;
  const std::size_t first = model_parameters.size() - data.uncertain.size();
  for (std::size_t k = 0; k < data.uncertain.size(); ++k) {
    const UncertainParameter& parameter = data.uncertain[k];
    const BodyDeparture departure =
        departure_of(data, parameter, model_parameters, model_parameters[first + k]);
    const auto [place, is_first] =
        best.try_emplace({parameter.link, parameter.parameter}, departure);
    if (!is_first && departure.standard_error < place->second.standard_error) {
      place->second = departure;
    }
  }
  std::vector<BodyDeparture> departures;
  for (const auto& [key, departure] : best) departures.push_back(departure);
  return departures;
}

}  // namespace

StandardParameters prior_deviations(const StandardParameters& stated, double share) {
  const double mass = stated(9);
  const double radius =
      mass > 0.0 ? std::sqrt(std::max(0.0, 0.5 * (stated(0) + stated(3) + stated(5)) / mass)) : 0.0;
  StandardParameters deviations;
  deviations.head<6>().setConstant(share * mass * radius * radius);
  deviations.segment<3>(6).setConstant(share * mass * radius);
  deviations(9) = share * mass;
  return deviations;
}

bool may_free_bodies(const ForceBalanceData& data) {
  return data.estimation.bodies.count > 0 && data.uncertain.empty();
}

std::optional<ForceBalanceData> with_uncertain_bodies(const ForceBalanceData& data, double worth,
                                                      const Eigen::VectorXd& inverse_gains) {
  if (!may_free_bodies(data)) return {};
  const RigidRobotModel& robot = data.robot;
  std::vector<UncertainParameter> parameters;
  if (!robot.channels.unknown_drive_gains) {
    parameters = parameters_seen(robot, lengths_of(data.estimation.bodies.in), -1, 1.0);
  }
  for (Index j = 0; j < inverse_gains.size(); ++j) {
    if (inverse_gains(j) == 0.0 || data.idle[static_cast<std::size_t>(j)]) continue;
    const Eigen::VectorXd lengths =
        lengths_of({&data.estimation.bodies.in[static_cast<std::size_t>(j)], 1});
    std::ranges::move(parameters_seen(robot, lengths, j, std::abs(inverse_gains(j))),
                      std::back_inserter(parameters));
  }
  if (parameters.empty()) return {};
  std::vector<BalanceColumns::Chosen> chosen;
  for (const UncertainParameter& each : parameters) {
    chosen.push_back({each.link * kStandardParameters + each.parameter, each.joint});
  }
  ForceBalanceData result = data;
  result.prior_gains = inverse_gains;
  const Index before = data.estimation.model.count;
  result.estimation.model.append(data.estimation.bodies, chosen);
  result.validation.model.append(data.validation.bodies, chosen);
  Eigen::VectorXd& precision = result.estimation.model_precision;
  precision = Eigen::VectorXd::Zero(result.estimation.model.count);
  result.estimation.worth = worth;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const UncertainParameter& parameter = parameters[k];
    const auto own = static_cast<std::size_t>(parameter.parameter);
    precision(before + static_cast<Index>(k)) =
        1.0 / (worth * parameter.deviation * parameter.deviation);
    result.parameter_names.push_back(
        fmt::format("{} departure of {}{}", kStandardParameterNames[own],
                    robot.joints[static_cast<std::size_t>(parameter.link)].name,
                    parameter.joint < 0 ? "" : fmt::format(" over gain_{}", parameter.joint + 1)));
    result.parameter_units.emplace_back(kUnits[own]);
    result.parameter_kinds.push_back(QuantityKind::kOther);
  }
  result.uncertain = std::move(parameters);
  for (ForceBalanceRows* rows : {&result.estimation, &result.validation}) {
    rows->laws = std::make_shared<LawSampleCache>(rows->samples());  // places are others now
  }
  return result;
}

std::vector<PhysicalBody> fitted_bodies(const ForceBalanceData& data,
                                        const std::vector<LawParameterEstimate>& model_parameters) {
  std::vector<PhysicalBody> bodies;
  if (data.robot.channels.unknown_drive_gains) return bodies;
  const std::size_t first = model_parameters.size() - data.uncertain.size();
  for (std::size_t k = 0; k < data.uncertain.size();) {
    const Index link = data.uncertain[k].link;
    const RobotJoint& joint = data.robot.joints[static_cast<std::size_t>(link)];
    const StandardParameters stated = standard_parameters(*joint.body);
    StandardParameters fitted = stated, errors = StandardParameters::Zero();
    for (; k < data.uncertain.size() && data.uncertain[k].link == link; ++k) {
      const LawParameterEstimate& departure = model_parameters[first + k];
      fitted(data.uncertain[k].parameter) += departure.value;
      errors(data.uncertain[k].parameter) = departure.standard_error;
    }
    bodies.push_back(body_of(fitted, joint.name + "'s link"));
    bodies.back().errors_from_possible = errors_from_possible(fitted, stated, errors);
  }
  return bodies;
}

std::vector<std::string> departures_from_stated(
    const ForceBalanceData& data, const std::vector<LawParameterEstimate>& model_parameters) {
  std::vector<std::pair<double, std::string>> found;
  for (const BodyDeparture& departure : departures_of(data, model_parameters)) {
    const UncertainParameter& parameter = *departure.parameter;
    const double errors = std::abs(departure.value) / departure.standard_error;
    if (!(errors > kToldApart)) continue;
    const auto own = static_cast<std::size_t>(parameter.parameter);
    found.emplace_back(
        -errors, fmt::format("{} of {}'s link {:.3g} ± {:.2g} {} (stated: {:.3g})", kWords[own],
                             data.robot.joints[static_cast<std::size_t>(parameter.link)].name,
                             parameter.stated + departure.value, departure.standard_error,
                             kUnits[own], parameter.stated));
  }
  std::ranges::stable_sort(found, {}, &std::pair<double, std::string>::first);
  std::vector<std::string> words;
  for (auto& [order, each] : found) words.push_back(std::move(each));
  return words;
}

}  // namespace graybox
