#include "diagnosis/recordings/channel_arithmetic.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

namespace graybox {
namespace {

using Index = Eigen::Index;

// A new channel made from others.
Signal combined(const PreprocessData& context, const std::vector<std::string>& of,
                const std::string& name, const std::string& unit, std::optional<ChannelRole> role) {
  const Signal& least = context.least_filtered(of);
  const ChannelRole own = context.data().signals[context.index_of(of.front())].role;
  return {name, unit, role.value_or(own), least.low_pass, least.filters};
}

Eigen::VectorXd integral_of(const Eigen::VectorXd& time, const Eigen::VectorXd& values) {
  Eigen::VectorXd integral = Eigen::VectorXd::Zero(time.size());
  for (Index k = 1; k < time.size(); ++k) {
    integral(k) = integral(k - 1) + 0.5 * (time(k) - time(k - 1)) * (values(k) + values(k - 1));
  }
  return integral;
}

}  // namespace

std::string unit_of_integral(std::string_view base) {
  if (base.ends_with("/s^2")) return std::string(base.substr(0, base.size() - 2));
  if (base.ends_with("/s")) return std::string(base.substr(0, base.size() - 2));
  return {};
}

void scale_channels(const PreprocessData& context, const Scale& step) {
  for (const Index channel : context.indices(step.channels)) {
    for (SignalPiece& piece : context.data().pieces) piece.values.col(channel) *= step.factor;
  }
}

void add_integrals(const PreprocessData& context, const Integral& step) {
  std::vector<Signal> added;
  for (std::size_t k = 0; k < step.of.size(); ++k) {
    const std::string& unit = context.data().signals[context.index_of(step.of[k])].unit;
    const std::string result = unit_of_integral(unit);
    if (result.empty()) {
      context.fail(fmt::format("integral: {} is in {}; velocities and accelerations have integrals",
                               step.of[k], unit));
    }
    added.push_back(combined(context, {step.of[k]}, step.names[k], result, step.role));
  }
  const std::vector<Index> of = context.indices(step.of);
  for (SignalPiece& piece : context.data().pieces) {
    Eigen::MatrixXd integrals(piece.time.size(), static_cast<Index>(of.size()));
    for (std::size_t k = 0; k < of.size(); ++k) {
      integrals.col(static_cast<Index>(k)) = integral_of(piece.time, piece.values.col(of[k]));
    }
    PreprocessData::append(piece, integrals);
  }
  auto& signals = context.data().signals;
  signals.insert(signals.end(), added.begin(), added.end());
}

void add_product(const PreprocessData& context, const Product& step) {
  Signal added = combined(context, step.of, step.name, step.unit, step.role);
  const std::vector<Index> of = context.indices(step.of);
  for (SignalPiece& piece : context.data().pieces) {
    Eigen::VectorXd product = Eigen::VectorXd::Ones(piece.time.size());
    for (const Index channel : of) product.array() *= piece.values.col(channel).array();
    PreprocessData::append(piece, product);
  }
  context.data().signals.push_back(std::move(added));
}

void add_sum(const PreprocessData& context, const WeightedSum& step) {
  const std::string unit = context.data().signals[context.index_of(step.of.front())].unit;
  for (const std::string& name : step.of) context.expect_unit("sum", name, unit);
  Signal added =
      combined(context, step.of, step.name, step.unit.empty() ? unit : step.unit, step.role);
  const std::vector<Index> of = context.indices(step.of);
  for (SignalPiece& piece : context.data().pieces) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(piece.time.size());
    for (std::size_t k = 0; k < of.size(); ++k) sum += step.weights[k] * piece.values.col(of[k]);
    PreprocessData::append(piece, sum);
  }
  context.data().signals.push_back(std::move(added));
}

void add_constant(const PreprocessData& context, const ConstantChannel& step) {
  for (SignalPiece& piece : context.data().pieces) {
    PreprocessData::append(piece, Eigen::VectorXd::Constant(piece.time.size(), step.value));
  }
  // A constant passes every low-pass as it is, so it counts as filtered as the others are.
  std::vector<Signal>& signals = context.data().signals;
  Signal added{step.name, step.unit, step.role};
  if (!signals.empty()) {
    added.low_pass = signals.front().low_pass;
    added.filters = signals.front().filters;
  }
  signals.push_back(std::move(added));
}

void add_motor_torque(const PreprocessData& context, const MotorTorque& step) {
  context.expect_unit("motor_torque", step.voltage, "V");
  context.expect_unit("motor_torque", step.speed, "rad/s");
  Signal added = combined(context, {step.voltage, step.speed}, step.name, "N m", step.role);
  const std::vector<Index> of = context.indices({step.voltage, step.speed});
  for (SignalPiece& piece : context.data().pieces) {
    const Eigen::VectorXd torque =
        step.torque_constant / step.resistance *
        (piece.values.col(of[0]) - step.back_emf * piece.values.col(of[1]));
    PreprocessData::append(piece, torque);
  }
  context.data().signals.push_back(std::move(added));
}

}  // namespace graybox
