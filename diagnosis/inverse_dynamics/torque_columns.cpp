#include "diagnosis/inverse_dynamics/torque_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "diagnosis/inverse_dynamics/filtered_motion.hpp"
#include "diagnosis/inverse_dynamics/law_force.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

const LawEntry& entry_of(const Element& element) { return *find_law(element.law_name, false); }

const char* unit_of_standard_parameter(Index k) {
  if (k < 6) return "kg m^2";
  return k < 9 ? "kg m" : "kg";
}

bool is_known(const RigidRobotModel& robot, const ElementParameter& place) {
  return std::ranges::any_of(robot.known, [&](const ElementParameter& known) {
    return known.element == place.element && known.parameter == place.parameter;
  });
}

StandardParameters point_mass(const Eigen::Vector3d& place) {
  return standard_parameters({1.0, place, Eigen::Matrix3d::Zero()});
}

// The law with one of its linear parameters at one and the others at zero.
std::shared_ptr<const Law> unit_law(const Element& element, std::size_t parameter) {
  const LawEntry& entry = entry_of(element);
  std::vector<double> values = element.parameters;
  for (std::size_t p = 0; p < values.size(); ++p) {
    if (entry.parameters[p].is_linear) values[p] = p == parameter ? 1.0 : 0.0;
  }
  return entry.make(values);
}

std::string over_gain(bool unknown_gains, Index joint) {
  return unknown_gains ? fmt::format("/gain_{}", joint + 1) : "";
}

}  // namespace

std::string name_of(const RigidRobotModel& robot, const ElementParameter& place) {
  const Element& element = robot.elements[place.element];
  return element.name + "." + entry_of(element).parameters[place.parameter].name;
}

std::string unit_of(const RigidRobotModel& robot, const ElementParameter& place) {
  const Element& element = robot.elements[place.element];
  return unit_at(entry_of(element).parameters[place.parameter].unit, element.location.units);
}

void set_parameter(RigidRobotModel& robot, const ElementParameter& place, double value) {
  Element& element = robot.elements[place.element];
  element.parameters[place.parameter] = value;
  if (element.law) element.law = entry_of(element).make(element.parameters);
}

TorqueColumns::TorqueColumns(const RigidRobotModel& robot)
    : regressor_(robot), unknown_gains_(robot.channels.unknown_drive_gains) {
  add_links(robot);
  add_rotors(robot);
  if (unknown_gains_) add_gains(robot);
  for (std::size_t k = 0; k < robot.elements.size(); ++k) add_element(robot, k);
  matrix_ = Eigen::MatrixXd::Zero(robot.size(), size());
  known_ = Eigen::VectorXd::Zero(robot.size());
}

Index TorqueColumns::add_column(std::string name, std::string unit) {
  names_.push_back(std::move(name));
  units_.push_back(std::move(unit));
  return size() - 1;
}

void TorqueColumns::add_links(const RigidRobotModel& robot) {
  for (Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (joint.body) {
      bodies_.push_back({j, standard_parameters(*joint.body)});
      continue;
    }
    add_unknown_link(j);
  }
}

void TorqueColumns::add_unknown_link(Index link) {
  for (Index joint = unknown_gains_ ? 0 : link; joint <= link; ++joint) {
    links_.push_back({link, size(), unknown_gains_ ? joint : -1});
    for (Index k = 0; k < kStandardParameters; ++k) {
      (void)add_column(fmt::format("{}{}{}", kStandardParameterNames[static_cast<std::size_t>(k)],
                                   link + 1, over_gain(unknown_gains_, joint)),
                       unit_of_standard_parameter(k));
    }
  }
}

void TorqueColumns::add_rotors(const RigidRobotModel& robot) {
  for (Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (joint.rotor_inertia == 0.0) continue;
    Force force;
    force.input = force.output = robot.transmission.row(j);
    if (joint.rotor_inertia) {
      force.factor = *joint.rotor_inertia;
    } else {
      force.column =
          add_column(fmt::format("rotor_inertia_{}{}", j + 1, over_gain(unknown_gains_, j)),
                     joint.is_prismatic ? "kg" : "kg m^2");
    }
    rotors_.push_back(std::move(force));
  }
}

// Joints that carry something known have a gain: a body from there on, or their own rotor.
void TorqueColumns::add_gains(const RigidRobotModel& robot) {
  Index last = -1;
  for (const Body& body : bodies_) last = std::max(last, body.link);
  for (const Element& element : robot.elements) {
    if (element.use == LawUse::kPayload) last = robot.size() - 1;
  }
  for (Index j = 0; j < robot.size(); ++j) {
    const auto& rotor = robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
    const bool is_told = j <= last || (rotor && *rotor != 0.0);
    gains_.push_back(is_told ? add_column(fmt::format("1/gain_{}", j + 1), "1") : -1);
  }
}

void TorqueColumns::add_element(const RigidRobotModel& robot, std::size_t index) {
  const Element& element = robot.elements[index];
  const auto& parameters = entry_of(element).parameters;
  const std::string& load = element.location.load;
  add_load(load);
  if (element.law && element.law->state_count() > 0) {
    with_memory_.push_back(
        {element.location.input, element.location.output, element.law, 1.0, -1, load});
    return;
  }
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    if (!parameters[p].is_linear) continue;
    const ElementParameter place{index, p};
    const bool is_body_over_gains = element.use == LawUse::kPayload && unknown_gains_;
    const bool known = is_known(robot, place) || is_body_over_gains;
    const Index column = known ? -1 : add_column(name_of(robot, place), unit_of(robot, place));
    const double factor = known ? element.parameters[p] : 1.0;
    if (element.use == LawUse::kPayload) {
      add_payload(robot, element, column);
      continue;
    }
    Force force{element.location.input, element.location.output, nullptr, factor, column, load};
    if (element.use == LawUse::kForce) force.law = unit_law(element, p);
    forces_.push_back(std::move(force));
  }
}

// A payload whose mass has a column is a body of mass one.
void TorqueColumns::add_payload(const RigidRobotModel& robot, const Element& element,
                                Index column) {
  const auto& values = element.parameters;
  const Eigen::Vector3d offset(values[1], values[2], values[3]);
  const double mass = column < 0 ? values[0] : 1.0;
  const std::string& load = element.location.load;
  bodies_.push_back({robot.size() - 1, mass * point_mass(robot.flange * offset), column, load});
}

void TorqueColumns::add_load(const std::string& load) {
  if (!load.empty() && std::ranges::find(loads_, load) == loads_.end()) loads_.push_back(load);
}

Eigen::VectorXd TorqueColumns::change_by_filters(const Force& force, const Motion& piece) {
  Eigen::VectorXd plain(piece.samples());
  const Eigen::VectorXd deflection = piece.position * force.input;
  const Eigen::VectorXd rate = piece.velocity * force.input;
  for (Index t = 0; t < plain.size(); ++t) plain(t) = force.law->force(deflection(t), rate(t), {});
  return force.factor * (FilteredMotion(piece).force(*force.law, force.input) - plain);
}

Eigen::MatrixXd TorqueColumns::remembered(const Motion& piece) const {
  Eigen::MatrixXd torque = Eigen::MatrixXd::Zero(piece.samples(), piece.position.cols());
  for (const Force& force : with_memory_) {
    if (!force.acts_with(piece.load)) continue;
    torque += FilteredMotion(piece).force(*force.law, force.input) * force.output.transpose();
  }
  if (piece.filters.empty()) return torque;
  for (const Force& force : forces_) {
    if (force.law && force.column < 0 && force.acts_with(piece.load)) {
      torque += change_by_filters(force, piece) * force.output.transpose();
    }
  }
  return torque;
}

std::vector<TorqueColumns::FilteredColumn> TorqueColumns::filtered_columns(
    const Motion& piece) const {
  std::vector<FilteredColumn> columns;
  if (piece.filters.empty()) return columns;
  for (const Force& force : forces_) {
    if (!force.law || force.column < 0 || !force.acts_with(piece.load)) continue;
    columns.push_back({force.column, force.output, change_by_filters(force, piece)});
  }
  return columns;
}

void TorqueColumns::evaluate(const Eigen::Ref<const Eigen::VectorXd>& q,
                             const Eigen::Ref<const Eigen::VectorXd>& velocity,
                             const Eigen::Ref<const Eigen::VectorXd>& acceleration) {
  matrix_.setZero();
  known_.setZero();
  evaluate_links(regressor_.evaluate(q, velocity, acceleration));
  for (const Force& rotor : rotors_) add(rotor, rotor.input.dot(acceleration));
  for (std::size_t j = 0; j < gains_.size(); ++j) {
    if (gains_[j] < 0) continue;
    const auto row = static_cast<Index>(j);
    matrix_(row, gains_[j]) = std::exchange(known_(row), 0.0);
  }
  for (const Force& force : forces_) {
    if (!force.acts_with(load_)) continue;
    add(force, force.law ? force.law->force(force.input.dot(q), force.input.dot(velocity), {})
                         : force.input.dot(acceleration));
  }
}

void TorqueColumns::evaluate_links(const Eigen::MatrixXd& bodies) {
  const auto of_link = [&](Index link) {
    return bodies.middleCols<kStandardParameters>(kStandardParameters * link);
  };
  for (const Link& link : links_) {
    auto columns = matrix_.middleCols<kStandardParameters>(link.first);
    if (link.joint < 0) {
      columns = of_link(link.link);
    } else {
      columns.row(link.joint) = of_link(link.link).row(link.joint);
    }
  }
  for (const Body& body : bodies_) {
    if (!body.load.empty() && body.load != load_) continue;
    auto target = body.column < 0 ? Eigen::Ref<Eigen::VectorXd>(known_)
                                  : Eigen::Ref<Eigen::VectorXd>(matrix_.col(body.column));
    target.noalias() += of_link(body.link) * body.direction;
  }
}

void TorqueColumns::add(const Force& force, double value) {
  auto target = force.column < 0 ? Eigen::Ref<Eigen::VectorXd>(known_)
                                 : Eigen::Ref<Eigen::VectorXd>(matrix_.col(force.column));
  target += force.factor * value * force.output;
}

}  // namespace graybox
