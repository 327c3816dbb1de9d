#include "diagnosis/harmonic_balance/plant_family.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>

#include "diagnosis/hypotheses/place_file.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/chain_dynamics.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "problems/mechanisms/robot_rest.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXcd controller_inverse(const PiController& controller, double w, double sample_time) {
  return controller_response(controller, w, sample_time).cwiseInverse().asDiagonal();
}

// ---- robots -------------------------------------------------------------------------------------

class RobotOwnForce : public OwnForce {
 public:
  RobotOwnForce(const RobotModel& robot, const LinearPlant& plant)
      : arm_(robot.arm_size()),
        dynamics_(robot.chain),
        rest_(plant.rest.head(arm_)),
        mass_(plant.mass.topLeftCorner(arm_, arm_)) {
    RigidChainEvaluator evaluator(robot.chain);
    gravity_ = evaluator.gravity_torque(rest_);
    gravity_stiffness_ = evaluator.gravity_stiffness(rest_);
  }

  void evaluate(const MatrixXd& q, const MatrixXd& velocity, const MatrixXd& acceleration,
                MatrixXd& force) override {
    force.setZero(q.rows(), q.cols());
    for (Index t = 0; t < q.cols(); ++t) {
      moved_ = rest_ + q.col(t).head(arm_);
      velocity_ = velocity.col(t).head(arm_);
      dynamics_.evaluate(moved_, velocity_);
      force.col(t).head(arm_) =
          -((dynamics_.mass() - mass_) * acceleration.col(t).head(arm_) + dynamics_.bias() -
            gravity_ - gravity_stiffness_ * q.col(t).head(arm_));
    }
  }

 private:
  Index arm_;
  ChainDynamics dynamics_;
  VectorXd rest_, gravity_, moved_, velocity_;
  MatrixXd mass_, gravity_stiffness_;
};

// How far the controlled velocities have led on average over the period. The PI controller's
// u = K_p (e + (T_s/T_i) sum e) tells the sum of all errors e = r - y since the start, and the
// references sum to zero over whole periods: at the period's end the outputs have led by
//   -T_s sum e + (T_s/2) y,
// the last term for the trapezoidal rule.
VectorXd controlled_offset(const PiController& controller, double sample_time,
                           const PeriodEnd& end) {
  const VectorXd sum = (end.input.cwiseQuotient(controller.proportional) - end.error)
                           .cwiseProduct(controller.integral_time);
  return -sum + 0.5 * sample_time * end.output - end.output_integral;
}

class RobotFamily : public PlantFamily {
 public:
  explicit RobotFamily(const std::filesystem::path& file)
      : RobotFamily(load_extended_robot(file)) {}
  explicit RobotFamily(const RobotModel& robot) : RobotFamily(ExtendedRobot{robot, {}}) {}

  [[nodiscard]] LinearPlant plant(const VectorXd& joint_angles, const VectorXd& parameters,
                                  std::span<const Element> bodies) const override {
    if (joint_angles.size() != robot_.motor_count()) {
      throw InputError(fmt::format("{}: a position needs {} joint angles, not {}", robot_.name,
                                   robot_.motor_count(), joint_angles.size()));
    }
    const RobotModel robot = with_stiffness_factors(with_bodies(bodies), parameters);
    const RobotRest rest = robot_rest(robot, constant_forces(bodies), joint_angles);
    const LocalModel local =
        LocalModelBuilder(robot).build_at(rest.coordinates.head(robot.arm_size()), joint_angles);
    LinearPlant result;
    result.mass = local.mass;
    result.damping = local.damping;
    result.stiffness = local.stiffness;
    result.input = local.input;
    result.velocity_output = local.output;
    result.position_output = MatrixXd::Zero(local.output.rows(), local.output.cols());
    result.rest = rest.coordinates;
    result.holding_input = rest.holding_torque;
    result.held.assign(static_cast<std::size_t>(local.mass.rows()), false);
    std::fill(result.held.begin() + robot.arm_size(), result.held.end(), true);
    const MatrixXd compliance = receptance(result, 0.0).real();
    for (std::size_t p = 0; p < local.parameters.size(); ++p) {
      const LinearElement& spring = local.elements[local.parameters[p]];
      const MatrixXd stiffness = spring.value / parameters(static_cast<Index>(p)) *
                                 spring.location * spring.location.transpose();
      result.derivatives.push_back({{}, {}, stiffness, -compliance * (stiffness * result.rest)});
    }
    return result;
  }

  [[nodiscard]] std::unique_ptr<OwnForce> own_force(
      const LinearPlant& plant, std::span<const Element> bodies) const override {
    return std::make_unique<RobotOwnForce>(with_bodies(bodies), plant);
  }

  // The motors are held, the arm hangs.
  [[nodiscard]] bool shifts_rest(const Location& location) const override {
    return location.kind == LocationKind::kElement && location.output == location.input &&
           !location.output.head(robot_.arm_size()).isZero(0.0);
  }

  [[nodiscard]] MatrixXcd inverse_controller(double w) const override {
    return controller_inverse(robot_.controller, w, robot_.sample_time);
  }

  void add_places_of(const std::filesystem::path& file) override {
    for (CandidatePlace& place : add_places(file, RobotPlaces(robot_), places_)) {
      place.shifts_rest = shifts_rest(place.location);
    }
  }

  [[nodiscard]] VectorXd mean_offset(const PeriodEnd& end) const override {
    if (end.error.size() == 0) return {};
    return robot_.transmission.partialPivLu().solve(
        controlled_offset(robot_.controller, sample_time_, end));
  }

 private:
  explicit RobotFamily(ExtendedRobot extended) : robot_(std::move(extended.robot)) {
    sample_time_ = robot_.sample_time;
    inputs_ = outputs_ = robot_.motor_count();
    for (Element& element : extended.elements) {
      const bool built_in = element.use == LawUse::kInertia || element.use == LawUse::kPayload;
      if (!built_in) elements_.push_back(std::move(element));
    }
    for (const std::string& name : robot_.parameter_names()) {
      parameters_.push_back({name, "1", 1.0, true});
    }
    list_places();
  }

  [[nodiscard]] RobotModel with_bodies(std::span<const Element> bodies) const {
    RobotModel robot = robot_;
    for (const Element& body : bodies) {
      if (!is_constant_force(body)) build_in_inertia(robot, body);
    }
    return robot;
  }

  static bool is_constant_force(const Element& body) { return body.law_name == "offset"; }

  [[nodiscard]] ElementDynamics constant_forces(std::span<const Element> bodies) const {
    std::vector<Element> forces;
    for (const Element& body : bodies) {
      if (!is_constant_force(body)) continue;
      forces.push_back(body);
      forces.back().law = find_law("offset", false)->make(body.parameters);
    }
    return {std::move(forces), inputs_, outputs_};
  }

  // What the model's spring of the place's name, if there is one, says of the place.
  void describe_spring(CandidatePlace& place) const {
    for (std::size_t i = 0; i < robot_.springs.size(); ++i) {
      if (robot_.springs[i].name != place.location.name) continue;
      place.spring_stiffness = robot_.springs[i].stiffness;
      place.has_free_stiffness = std::ranges::count(robot_.parameters, i) > 0;
    }
  }

  [[nodiscard]] Location place_of(Index joint, const VectorXd& b, const std::string& axis) const {
    Location place;
    place.name = robot_.joint_names[static_cast<std::size_t>(joint)] + "." + axis;
    place.input = place.output = b;
    place.channel = joint;
    place.units = {"N m", "rad", "kg m^2"};
    place.takes_inertia = axis == "motor" || axis == "arm";
    return place;
  }

  [[nodiscard]] VectorXd axis_vector(Index joint, const std::string& axis) const {
    const Index arm = robot_.arm_size();
    VectorXd b = VectorXd::Zero(arm + robot_.motor_count());
    const Index gearbox = robot_.gearbox_rotations()[static_cast<std::size_t>(joint)];
    if (axis == "motor") b.tail(robot_.motor_count()) = robot_.transmission.row(joint).transpose();
    if (axis == "arm" || axis == "gearbox") b(gearbox) = 1.0;
    if (axis == "gearbox") b(arm + joint) = -1.0;
    return b;
  }

  void list_places() {
    for (Index joint = 0; joint < robot_.motor_count(); ++joint) list_joint(joint);
    Location flange;
    flange.name = "flange";
    flange.is_flange = true;
    flange.units = {"N", "m", "kg"};
    places_.push_back({flange, "{kind: element, axis: flange}"});
    for (Index joint = 0; joint < robot_.motor_count(); ++joint) {
      list_signal(joint, LocationKind::kActuator, "actuator", "N m");
      list_signal(joint, LocationKind::kSensor, "sensor", "rad/s");
    }
  }

  void list_joint(Index joint) {
    const std::string& name = robot_.joint_names[static_cast<std::size_t>(joint)];
    const auto yaml = [&](const std::string& axis) {
      return fmt::format("{{kind: element, joint: {}, axis: {}}}", name, axis);
    };
    for (const char* axis : {"motor", "gearbox", "arm"}) {
      CandidatePlace place{place_of(joint, axis_vector(joint, axis), axis), yaml(axis)};
      describe_spring(place);
      place.turns = place.location.takes_inertia;
      place.shifts_rest = shifts_rest(place.location);
      places_.push_back(place);
    }
    for (Index i = 0; i < robot_.arm_size(); ++i) {
      const ArmSpring& spring = robot_.springs[static_cast<std::size_t>(i)];
      if (spring.is_gearbox || spring.joint != static_cast<std::size_t>(joint)) continue;
      const std::string axis = spring.name.substr(spring.name.find('.') + 1);
      CandidatePlace place{
          place_of(joint, VectorXd::Unit(axis_vector(joint, "arm").size(), i), axis), yaml(axis)};
      describe_spring(place);
      places_.push_back(place);
    }
    list_couplings(joint);
  }

  // Forces at a joint that follow the motion elsewhere: a gearbox whose transmission error follows
  // its motor, a motor driven by its neighbours.
  void list_couplings(Index joint) {
    add_coupling(joint, "gearbox", joint, "motor");
    for (const Index other : {joint - 1, joint + 1}) {
      if (other >= 0 && other < robot_.motor_count()) add_coupling(joint, "motor", other, "motor");
    }
  }

  void add_coupling(Index joint, const char* axis, Index driver, const char* driving_axis) {
    const auto& names = robot_.joint_names;
    CandidatePlace place{
        place_of(joint, axis_vector(joint, axis), axis),
        fmt::format("{{kind: element, joint: {}, axis: {}, driven_by: {{joint: {}, "
                    "axis: {}}}}}",
                    names[static_cast<std::size_t>(joint)], axis,
                    names[static_cast<std::size_t>(driver)], driving_axis)};
    place.location.input = axis_vector(driver, driving_axis);
    place.location.name +=
        " driven by " + names[static_cast<std::size_t>(driver)] + "." + driving_axis;
    place.location.takes_inertia = false;
    place.is_coupling = true;
    place.turns = true;
    places_.push_back(place);
  }

  void list_signal(Index joint, LocationKind kind, const char* noun, const char* unit) {
    const std::string& name = robot_.joint_names[static_cast<std::size_t>(joint)];
    Location place;
    place.kind = kind;
    place.channel = joint;
    place.name = fmt::format("{} {}", noun, name);
    place.units.force = unit;
    places_.push_back({place, fmt::format("{{kind: {}, joint: {}}}", noun, name)});
  }

  RobotModel robot_;
};

class LocalRobotFamily : public RobotFamily {
 public:
  using RobotFamily::RobotFamily;
  [[nodiscard]] std::unique_ptr<OwnForce> own_force(const LinearPlant&,
                                                    std::span<const Element>) const override {
    return nullptr;
  }
};

// ---- lumped models ------------------------------------------------------------------------------

class LumpedFamily : public PlantFamily {
 public:
  explicit LumpedFamily(const std::filesystem::path& file) : model_(load_lumped_model(file)) {
    sample_time_ = model_.sample_time;
    inputs_ = model_.input.cols();
    outputs_ = model_.velocity_output.rows();
    units_ = model_.input_units.front() == "N m" ? PlaceUnits{"N m", "rad", "kg m^2"}
                                                 : PlaceUnits{"N", "m", "kg"};
    check_signals(file);
    list_parameters();
    list_places();
    list_held();
  }

  [[nodiscard]] LinearPlant plant(const VectorXd&, const VectorXd& parameters,
                                  std::span<const Element>) const override {
    const Index n = model_.mass.rows();
    LinearPlant result;
    result.mass = fixed_.mass;
    result.damping = fixed_.damping;
    result.stiffness = fixed_.stiffness;
    result.input = model_.input;
    result.position_output = model_.position_output;
    result.velocity_output = model_.velocity_output;
    result.rest = VectorXd::Zero(n);
    result.holding_input = VectorXd::Zero(model_.input.cols());
    result.held = held_;
    result.derivatives = derivatives_;
    for (std::size_t p = 0; p < derivatives_.size(); ++p) {
      const PlantDerivative& derivative = derivatives_[p];
      const double value = parameters(static_cast<Index>(p));
      if (derivative.mass.size() > 0) result.mass += value * derivative.mass;
      if (derivative.damping.size() > 0) result.damping += value * derivative.damping;
      if (derivative.stiffness.size() > 0) result.stiffness += value * derivative.stiffness;
    }
    return result;
  }

  [[nodiscard]] std::unique_ptr<OwnForce> own_force(const LinearPlant&,
                                                    std::span<const Element>) const override {
    return nullptr;
  }

  [[nodiscard]] MatrixXcd inverse_controller(double w) const override {
    if (!model_.controller) return {};
    return controller_inverse(*model_.controller, w, model_.sample_time);
  }

  [[nodiscard]] VectorXd mean_offset(const PeriodEnd& end) const override {
    const auto held = std::ranges::count(held_, true);
    if (held == 0 || (held_by_control_ && end.error.size() == 0)) return {};
    const VectorXd seen = held_by_control_
                              ? controlled_offset(*model_.controller, model_.sample_time, end)
                              : end.output_mean;
    const MatrixXd& output = held_by_control_ ? model_.velocity_output : model_.position_output;
    const VectorXd moved = output.completeOrthogonalDecomposition().solve(seen);
    VectorXd offset(held);
    Index next = 0;
    for (Index i = 0; i < moved.size(); ++i) {
      if (held_[static_cast<std::size_t>(i)]) offset(next++) = moved(i);
    }
    return offset;
  }

  void add_places_of(const std::filesystem::path& file) override {
    for (CandidatePlace& place : add_places(file, *lumped_places(model_, units_), places_)) {
      mark_free_laws(place);
    }
  }

 private:
  void check_signals(const std::filesystem::path& file) const {
    using Quantity = LumpedOutput::Quantity;
    const auto is_motion = [](const LumpedOutput& output) {
      return output.quantity == Quantity::kPosition || output.quantity == Quantity::kVelocity;
    };
    if (!model_.is_driven_by_forces_alone() || !std::ranges::all_of(model_.outputs, is_motion)) {
      throw InputError(fmt::format(
          "{}: a diagnosis of periodic recordings knows forces as inputs and positions and "
          "velocities as outputs",
          file.string()));
    }
  }

  // Masses, springs and dampers go into the plant; those that are known stay as they are.
  void list_parameters() {
    const Index n = model_.mass.rows();
    fixed_.mass = fixed_.damping = fixed_.stiffness = MatrixXd::Zero(n, n);
    std::size_t next = 0;  // of the model's parameters
    for (Index i = 0; i < n; ++i) {
      if (model_.masses(i) == 0.0) continue;
      PlantDerivative derivative;
      derivative.mass = MatrixXd::Zero(n, n);
      derivative.mass(i, i) = 1.0;
      add_parameter(model_.parameters[next++], derivative);
    }
    for (Element& part : model_.parts) {
      for (std::size_t p = 0; p < part.parameters.size(); ++p) {
        part.fixed[p] = model_.parameters[next + p].fixed;
      }
      if (is_in_plant(part)) {
        const Location& place = part.location;
        const MatrixXd change = place.output * place.input.transpose();
        PlantDerivative derivative;
        (part.use == LawUse::kInertia   ? derivative.mass
         : part.law_name == "stiffness" ? derivative.stiffness
                                        : derivative.damping) = change;
        add_parameter(model_.parameters[next], derivative);
      } else {
        elements_.push_back(part);
      }
      next += part.parameters.size();
    }
  }

  static bool is_in_plant(const Element& part) {
    return part.location.kind == LocationKind::kElement &&
           (part.use == LawUse::kInertia || part.law_name == "stiffness" ||
            part.law_name == "viscous");
  }

  void add_parameter(const LumpedParameter& parameter, const PlantDerivative& derivative) {
    if (!parameter.fixed) {
      parameters_.push_back(
          {parameter.name, parameter.unit, parameter.value, parameter.value > 0.0});
      derivatives_.push_back(derivative);
      return;
    }
    if (derivative.mass.size() > 0) fixed_.mass += parameter.value * derivative.mass;
    if (derivative.damping.size() > 0) fixed_.damping += parameter.value * derivative.damping;
    if (derivative.stiffness.size() > 0) fixed_.stiffness += parameter.value * derivative.stiffness;
  }

  // Masses that no spring holds may be held by the control: those whose velocity it controls by the
  // force on them, whatever other forces act. (Where it acts elsewhere, the mean of other forces
  // moves them.) Without it they stand where their sensors of position say, as they are: laws of
  // the model at sensors don't change the mean.
  void list_held() {
    const MatrixXd& velocity = model_.velocity_output;
    held_.assign(static_cast<std::size_t>(velocity.cols()), false);
    held_by_control_ = model_.controller && model_.position_output.isZero(0.0) &&
                       velocity.rows() == model_.input.cols() &&
                       velocity == model_.input.transpose();
    const MatrixXd& seen = held_by_control_ ? velocity : model_.position_output;
    for (Index i = 0; i < velocity.cols(); ++i) {
      held_[static_cast<std::size_t>(i)] = !seen.col(i).isZero(0.0) && drifts(i);
    }
  }

  // Whether forces of mean zero may leave a mass anywhere, with those held that are.
  [[nodiscard]] bool drifts(Index mass) const {
    std::vector<Index> free;
    for (Index i = 0; i < static_cast<Index>(held_.size()); ++i) {
      if (!held_[static_cast<std::size_t>(i)]) free.push_back(i);
    }
    const MatrixXd stiffness = plant({}, start_values(), {}).stiffness(free, free);
    Eigen::FullPivLU<MatrixXd> factored(stiffness);
    factored.setThreshold(1e-9);
    const MatrixXd drifting = factored.kernel();  // zero if there are none
    return !drifting.row(std::ranges::find(free, mass) - free.begin()).isZero(1e-6);
  }

  // Masses, what the elements connect, and signals.
  void list_places() {
    const Index n = model_.mass.rows();
    for (Index i = 0; i < n; ++i) {
      CandidatePlace place{{}, "{kind: element, mass: " + mass_name(i) + "}"};
      place.location.name = mass_name(i);
      place.location.input = place.location.output = VectorXd::Unit(n, i);
      place.location.takes_inertia = true;
      place.has_free_inertia = model_.masses(i) != 0.0 && !is_fixed_mass(i);
      place.turns = units_.deflection == "rad";
      add_place(place);
    }
    for (const Element& part : model_.parts) {
      if (part.location.kind == LocationKind::kElement) add_place_between(part.location.output);
    }
    for (std::size_t c = 0; c < model_.input_names.size(); ++c) {
      add_signal(c, LocationKind::kActuator, "actuator", "input", model_.input_names,
                 model_.input_units);
    }
    for (std::size_t c = 0; c < model_.output_names.size(); ++c) {
      add_signal(c, LocationKind::kSensor, "sensor", "output", model_.output_names,
                 model_.output_units);
    }
  }

  [[nodiscard]] bool is_fixed_mass(Index i) const {
    std::size_t parameter = 0;
    for (Index before = 0; before < i; ++before) {
      if (model_.masses(before) != 0.0) ++parameter;
    }
    return model_.parameters[parameter].fixed;
  }

  [[nodiscard]] const std::string& mass_name(Index i) const {
    return model_.mass_names[static_cast<std::size_t>(i)];
  }

  void add_place_between(const VectorXd& b) {
    Index plus = 0, minus = 0;
    if ((b.array() != 0.0).count() != 2 || b.maxCoeff(&plus) != 1.0 || b.minCoeff(&minus) != -1.0) {
      return;  // a single mass, or a ratio between the two
    }
    CandidatePlace place{
        {}, fmt::format("{{kind: element, between: [{}, {}]}}", mass_name(plus), mass_name(minus))};
    place.location.name = mass_name(plus) + "-" + mass_name(minus);
    place.location.input = place.location.output = b;
    const auto known = [&](const CandidatePlace& other) {
      return other.location.output.size() == b.size() &&
             (other.location.output == b || other.location.output == -b);
    };
    if (std::ranges::none_of(places_, known)) add_place(place);
  }

  void add_place(CandidatePlace place) {
    place.location.units = units_;
    mark_free_laws(place);
    places_.push_back(std::move(place));
  }

  void mark_free_laws(CandidatePlace& place) const {
    for (const Element& part : model_.parts) {
      const Location& there = part.location;
      if (there.kind != LocationKind::kElement || there.output != there.input ||
          (there.output != place.location.output && there.output != -place.location.output)) {
        continue;
      }
      if (part.law_name == "stiffness") place.spring_stiffness += part.parameters[0];
      if (part.fixed[0]) continue;
      place.has_free_stiffness |= part.law_name == "stiffness";
      place.has_free_damping |= part.law_name == "viscous";
      place.has_free_inertia |= part.use == LawUse::kInertia;
    }
  }

  void add_signal(std::size_t channel, LocationKind kind, const char* noun, const char* key,
                  const std::vector<std::string>& names, const std::vector<std::string>& units) {
    Location place;
    place.kind = kind;
    place.channel = static_cast<Index>(channel);
    place.name = fmt::format("{} {}", noun, names[channel]);
    place.units.force = units[channel];
    places_.push_back({place, fmt::format("{{kind: {}, {}: {}}}", noun, key, names[channel])});
  }

  LumpedModel model_;
  PlaceUnits units_;
  std::vector<PlantDerivative> derivatives_;
  PlantDerivative fixed_;   // what is known of M, C and K
  std::vector<bool> held_;  // LinearPlant::held
  bool held_by_control_ = false;
};

}  // namespace

std::unique_ptr<PlantFamily> plant_family(const std::filesystem::path& model,
                                          std::span<const std::filesystem::path> places) {
  const std::string format =
      YamlField::load(model).at("format").choice({"graybox-robot/1", "graybox-lumped/1"});
  std::unique_ptr<PlantFamily> family;
  if (format == "graybox-robot/1") {
    family = std::make_unique<RobotFamily>(model);
  } else {
    family = std::make_unique<LumpedFamily>(model);
  }
  for (const std::filesystem::path& file : places) family->add_places_of(file);
  return family;
}

std::unique_ptr<PlantFamily> robot_family(const RobotModel& robot, PlantKind dynamics) {
  if (dynamics == PlantKind::kFull) return std::make_unique<RobotFamily>(robot);
  return std::make_unique<LocalRobotFamily>(robot);
}

}  // namespace graybox
