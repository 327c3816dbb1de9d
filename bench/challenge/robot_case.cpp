#include "bench/challenge/robot_case.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "diagnosis/signals/multisine.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;

std::vector<double> log_spaced(double from, double to, int count) {
  std::vector<double> values;
  for (int k = 0; k < count; ++k) values.push_back(from * std::pow(to / from, k / (count - 1.0)));
  return values;
}

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// A point mass at `place`, by the masses' moments about the frame's origin.
RigidBody with_mass(const RigidBody& body, double mass, const Eigen::Vector3d& place) {
  const auto about_origin = [](double m, const Eigen::Vector3d& r) -> Eigen::Matrix3d {
    return m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  };
  RigidBody joined;
  joined.mass = body.mass + mass;
  joined.centre_of_mass = (body.mass * body.centre_of_mass + mass * place) / joined.mass;
  joined.inertia = body.inertia + about_origin(body.mass, body.centre_of_mass) +
                   about_origin(mass, place) - about_origin(joined.mass, joined.centre_of_mass);
  return joined;
}

class RobotCase final : public CaseSystem {
 public:
  RobotCase(Family family, std::uint64_t seed)
      : file_(default_robot_file().parent_path() /
              (family == Family::kRobot ? "irb6600_like.yaml" : "three_axis.yaml")),
        believed_(load_robot_model(file_)),
        true_(believed_) {
    Random random(derived_seed(seed, {1}));
    perturb(believed_.parameters.size(), random);
    parameter_names_ = believed_.parameter_names();
    true_ = with_stiffness_factors(
        believed_,
        Eigen::Map<const Eigen::VectorXd>(factors_.data(), static_cast<Index>(factors_.size())));
    controller_ = true_.controller;
    name_channels();
    make_plan(family, random);
    draw_noise(random);
    list_places();
  }

  [[nodiscard]] std::unique_ptr<Plant> plant(const std::vector<Element>& elements,
                                             std::size_t position) const override {
    RobotModel robot = true_;
    for (const Element& element : elements) build_in(element, robot);
    // The plant keeps a reference to its robot.
    class OwningPlant final : public Plant {
     public:
      OwningPlant(RobotModel model, const std::vector<Element>& all, const Eigen::VectorXd& angles)
          : robot_(std::move(model)), plant_(robot_plant(robot_, all, angles)) {}
      [[nodiscard]] Index input_count() const override { return plant_->input_count(); }
      [[nodiscard]] Index output_count() const override { return plant_->output_count(); }
      void restart() override { plant_->restart(); }
      [[nodiscard]] Eigen::VectorXd output() const override { return plant_->output(); }
      void advance(const Eigen::VectorXd& input) override { plant_->advance(input); }

     private:
      RobotModel robot_;
      std::unique_ptr<Plant> plant_;
    };
    return std::make_unique<OwningPlant>(std::move(robot), elements, angles_at(position));
  }

  [[nodiscard]] LinearDynamics linear(std::size_t position) const override {
    const LocalModel local = LocalModelBuilder(true_).build(angles_at(position));
    LinearDynamics result{local.mass,
                          local.damping,
                          local.stiffness,
                          local.input,
                          Eigen::MatrixXd::Zero(local.output.rows(), local.output.cols()),
                          local.output,
                          local.position,
                          {}};
    for (const std::size_t p : local.parameters) {
      const LinearElement& spring = local.elements[p];
      result.derivatives.push_back(
          {{}, {}, spring.value * spring.location * spring.location.transpose()});
    }
    return result;
  }

  void write_model(const fs::path& folder) const override {
    const std::string urdf = YamlField::load(file_).at("urdf").text();
    write_text_file((folder / "model.yaml").string(), text_of(file_));
    write_text_file((folder / urdf).string(), text_of(file_.parent_path() / urdf));
  }

 private:
  [[nodiscard]] Eigen::VectorXd angles_at(std::size_t position) const {
    return plan_.positions[position] * (std::numbers::pi / 180.0);
  }

  void name_channels() {
    for (Index j = 1; j <= true_.motor_count(); ++j) {
      channels_.references.push_back(fmt::format("r_{}", j));
      channels_.inputs.push_back(fmt::format("u_{}", j));
      channels_.outputs.push_back(fmt::format("y_{}", j));
      channels_.output_units.emplace_back("rad/s");
    }
    channels_.input_unit = "N m";
  }

  // Positions at random within ranges in which the arm stands clear of its limits.
  void make_plan(Family family, Random& random) {
    const bool is_full = family == Family::kRobot;
    plan_.sample_time = true_.sample_time;
    plan_.period = static_cast<std::size_t>(std::lround(0.5 / plan_.sample_time));
    plan_.settling_periods = 4;
    plan_.periods = 4;
    plan_.lines = odd_lines(log_spaced(2.0, 60.0, 30), plan_.period, plan_.sample_time);
    plan_.levels = {2.0, 8.0, 4.0};
    for (int p = 0; p < 3; ++p) {
      Eigen::VectorXd angles(true_.motor_count());
      const std::array<std::array<double, 2>, 6> ranges{
          {{-150, 150}, {-40, 60}, {-120, 30}, {-180, 180}, {-100, 100}, {-180, 180}}};
      for (Index j = 0; j < angles.size(); ++j) {
        const auto& [from, to] = ranges[static_cast<std::size_t>(j)];
        angles(j) = std::round(random.uniform(from, to));
      }
      plan_.positions.push_back(angles);
    }
    plan_.sets = {{0, 0, 0, false}, {1, 1, 0, false}, {2, 2, 0, true}};
    if (!is_full) plan_.sets.insert(plan_.sets.begin() + 1, {0, 1, 0, false});
  }

  // Of an encoder, and white of 1 to 10 % of what the outputs do at the lowest level.
  void draw_noise(Random& random) {
    noise_psd_slope_ = std::pow(10.0, random.uniform(-11.0, -9.0));
    const double share = std::pow(10.0, random.uniform(-2.0, -1.0));
    white_noise_ = Eigen::VectorXd::Constant(true_.motor_count(), share * plan_.levels[0]);
  }

  void list_places() {
    const Index arm = true_.arm_size(), motors = true_.motor_count();
    const auto gearboxes = true_.gearbox_rotations();
    for (Index j = 0; j < motors; ++j) {
      const Index gearbox = gearboxes[static_cast<std::size_t>(j)];
      Eigen::VectorXd motor = Eigen::VectorXd::Zero(arm + motors);
      motor.tail(motors) = true_.transmission.row(j).transpose();
      const Eigen::VectorXd link = Eigen::VectorXd::Unit(arm + motors, gearbox);
      const Eigen::VectorXd gear = link - Eigen::VectorXd::Unit(arm + motors, arm + j);
      add_force_place(j, "motor", motor, motor, kAxisPlace, 0.0);
      add_force_place(j, "arm", link, link, kAxisPlace, 0.0);
      add_force_place(j, "gearbox", gear, gear, kSpringPlace,
                      true_.springs[static_cast<std::size_t>(gearbox)].stiffness);
      add_coupling(j, "gearbox", gear, j, motor);
      if (j > 0) {
        Eigen::VectorXd before = Eigen::VectorXd::Zero(arm + motors);
        before.tail(motors) = true_.transmission.row(j - 1).transpose();
        add_coupling(j, "motor", motor, j - 1, before);
      }
      add_signal(j, LocationKind::kActuator, "actuator", "N m", kActuatorPlace);
      add_signal(j, LocationKind::kSensor, "sensor", "rad/s", kSensorPlace);
    }
    for (Index i = 0; i < arm; ++i) {
      const ArmSpring& spring = true_.springs[static_cast<std::size_t>(i)];
      if (spring.is_gearbox) continue;
      const Eigen::VectorXd b = Eigen::VectorXd::Unit(arm + motors, i);
      add_force_place(static_cast<Index>(spring.joint),
                      spring.name.substr(spring.name.find('.') + 1), b, b, kSpringPlace,
                      spring.stiffness);
    }
    ChallengePlace flange;
    flange.location.name = "flange";
    flange.location.is_flange = true;
    flange.location.units = {"N", "m", "kg"};
    flange.kinds = kFlangePlace;
    places_.push_back(flange);
  }

  void add_force_place(Index joint, const std::string& axis, const Eigen::VectorXd& input,
                       const Eigen::VectorXd& output, unsigned kinds, double spring) {
    ChallengePlace place;
    place.location.name =
        fmt::format("{}.{}", true_.joint_names[static_cast<std::size_t>(joint)], axis);
    place.location.input = input;
    place.location.output = output;
    place.location.channel = joint;
    place.location.takes_inertia = kinds == kAxisPlace;
    place.location.units = {"N m", "rad", "kg m^2"};
    place.kinds = kinds;
    place.turns = kinds != kSpringPlace;
    place.spring = spring;
    places_.push_back(std::move(place));
  }

  void add_coupling(Index joint, const std::string& axis, const Eigen::VectorXd& output,
                    Index driver, const Eigen::VectorXd& input) {
    add_force_place(joint, axis, input, output, kCouplingPlace, 0.0);
    places_.back().location.name +=
        fmt::format(" driven by {}.motor", true_.joint_names[static_cast<std::size_t>(driver)]);
  }

  void add_signal(Index joint, LocationKind kind, const char* noun, const char* unit,
                  unsigned kinds) {
    ChallengePlace place;
    place.location.kind = kind;
    place.location.channel = joint;
    place.location.name =
        fmt::format("{} {}", noun, true_.joint_names[static_cast<std::size_t>(joint)]);
    place.location.units.force = unit;
    place.kinds = kinds;
    places_.push_back(std::move(place));
  }

  void build_in(const Element& element, RobotModel& robot) const {
    if (element.use != LawUse::kInertia && element.use != LawUse::kPayload) return;
    const auto& p = element.parameters;
    std::vector<ChainRotation> rotations = robot.chain.rotations();
    if (element.use == LawUse::kPayload) {
      rotations.back().body = with_mass(rotations.back().body, p[0], {p[1], p[2], p[3]});
    } else if (!element.location.output.tail(robot.motor_count()).isZero(0.0)) {
      robot.motor_inertia(element.location.channel) += p[0];
      return;
    } else {
      Index rotation = 0;
      element.location.output.cwiseAbs().maxCoeff(&rotation);
      ChainRotation& turned = rotations[static_cast<std::size_t>(rotation)];
      turned.body.inertia += p[0] * turned.axis * turned.axis.transpose();
    }
    robot.chain = RigidChain(std::move(rotations), robot.chain.gravity());
  }

  fs::path file_;
  RobotModel believed_, true_;
};

}  // namespace

std::unique_ptr<CaseSystem> draw_robot_case(Family family, std::uint64_t seed) {
  return std::make_unique<RobotCase>(family, seed);
}

}  // namespace graybox::bench
