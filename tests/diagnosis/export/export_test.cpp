// What `graybox export` writes, against the model itself: the C is compiled and run, the URDF is
// read by urdfdom, the tables are read as text.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "diagnosis/export/c_function.hpp"
#include "diagnosis/export/law_source.hpp"
#include "diagnosis/export/law_tables.hpp"
#include "diagnosis/export/urdf_file.hpp"
#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "problems/base/random.hpp"
#include "problems/elements/element_dynamics.hpp"
#include "problems/laws/law_file.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"
#include "problems/mechanisms/urdf_chain.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::expect_refused;
using testing::read_text;
using testing::write_text;

constexpr double kTolerance = 1e-9;  // of the largest force of the row

class Export : public ::testing::Test {
 protected:
  // Compiles the source with a main program that reads `inputs` numbers a line and prints what
  // `call`, a statement of x[] and y[], makes of them.
  MatrixXd run_c(const std::string& source, const std::string& call, const MatrixXd& x,
                 Index outputs) {
    std::string program = source + "\n#include <stdio.h>\nint main(void) {\n";
    program += fmt::format("  double x[{}], y[{}];\n  int i;\n  for (;;) {{\n", x.cols(), outputs);
    program += fmt::format(
        "    for (i = 0; i < {}; ++i) if (scanf(\"%lf\", &x[i]) != 1) return 0;\n", x.cols());
    program += "    " + call + "\n";
    program += fmt::format(
        "    for (i = 0; i < {}; ++i) printf(\"%.17g \", y[i]);\n    printf(\"\\n\");\n  }}\n}}\n",
        outputs);
    write_text(folder_.file("program.c"), program);
    std::ofstream in(folder_.file("in"));
    for (Index k = 0; k < x.rows(); ++k) {
      for (Index i = 0; i < x.cols(); ++i) in << fmt::format("{} ", x(k, i));
      in << '\n';
    }
    in.close();
    const std::string command = fmt::format(
        "cd '{}' && cc -std=c99 -pedantic -Wall -Wextra -Wshadow -Werror -O1 program.c -o program "
        "-lm 2>log && ./program < in > out",
        folder_.file(""));
    EXPECT_EQ(std::system(command.c_str()), 0) << read_text(folder_.file("log")) << program;
    std::ifstream out(folder_.file("out"));
    MatrixXd y = MatrixXd::Constant(x.rows(), outputs, std::nan(""));
    for (Index k = 0; k < y.rows(); ++k) {
      for (Index i = 0; i < outputs; ++i) out >> y(k, i);
    }
    return y;
  }

  std::string write(const std::string& name, const std::string& text) {
    write_text(folder_.file(name), text);
    return folder_.file(name);
  }

  // Forces of an exported model along random motions, one a row: q, q', q''.
  MatrixXd forces_of(const ExportedModel& model, const MatrixXd& motion) {
    const Index n = model.size();
    return run_c(c_function(model, "m"), fmt::format("m_force(x, x + {}, x + {}, y);", n, 2 * n),
                 motion, n);
  }

  testing::TemporaryFolder folder_;
};

MatrixXd random_motion(Index coordinates, int states, double size = 1.0) {
  Random random(7);
  MatrixXd motion(states, 3 * coordinates);
  for (double& value : motion.reshaped()) value = size * random.normal();
  return motion;
}

void expect_equal(const MatrixXd& exported, const MatrixXd& own) {
  ASSERT_EQ(exported.rows(), own.rows());
  for (Index k = 0; k < own.rows(); ++k) {
    const double error = (exported.row(k) - own.row(k)).cwiseAbs().maxCoeff();
    EXPECT_LE(error, kTolerance * own.row(k).cwiseAbs().maxCoeff())
        << k << ": " << exported.row(k) << " instead of " << own.row(k);
  }
}

// ---- laws ---------------------------------------------------------------------------------------

// One function for each law, its parameters behind z and v.
std::string law_program(const std::vector<const LawEntry*>& laws) {
  std::string text = "#include <math.h>\n";
  for (const LawHelper& helper : kLawHelpers) text += std::string(helper.source);
  for (std::size_t k = 0; k < laws.size(); ++k) {
    text += fmt::format("static double law_{}(double z, double v, const double* p) {{\n", k);
    for (std::size_t i = 0; i < laws[k]->parameters.size(); ++i) {
      text += fmt::format("  const double {} = p[{}];\n", c_name(laws[k]->parameters[i].name), i);
    }
    text += "  (void)z;\n  (void)v;\n" + *law_source(*laws[k]) + "\n}\n";
  }
  return text;
}

std::vector<const LawEntry*> closed_laws() {
  std::vector<const LawEntry*> laws;
  for (const auto* list : {&law_catalogue(), &supplementary_laws()}) {
    for (const LawEntry& law : *list) {
      if (law.use != LawUse::kForce) {
        EXPECT_FALSE(law_source(law)) << law.name;
        continue;
      }
      const std::vector<double> ones(law.parameters.size(), 0.5);
      const bool remembers = law.make(ones)->state_count() > 0;
      EXPECT_EQ(law_source(law).has_value(), !remembers) << law.name;
      if (!remembers) laws.push_back(&law);
    }
  }
  return laws;
}

TEST_F(Export, EveryLawWithAClosedForceIsTheSameInC) {
  write("laws.yaml", R"(format: graybox-laws/1
laws:
  - name: exported_formula
    description: a formula with all that formulas may have
    force: k * (z^5 - -double * abs(v)^1.5 / (1 + z^2) + min(z, v) * sign(v) * tanh(z / double)
      - (z - (v - z)) / (2 / 3) / 3 + 2^-2 * max(z, v)^3 - sqrt(exp(-z^2)) + sin(pi * v) / cosh(z))
    parameters: {k: {unit: F}, double: {unit: x, range: positive, tried: deflection}}
)");
  (void)add_law_file(folder_.file("laws.yaml"));
  const std::vector<const LawEntry*> laws = closed_laws();
  ASSERT_GT(laws.size(), 15U);
  Random random(3);
  constexpr Index kPoints = 300;
  const Index width = 2 + static_cast<Index>(kMaxLawParameters);
  MatrixXd x(kPoints, width), own(kPoints, static_cast<Index>(laws.size()));
  std::string call;
  for (Index k = 0; k < kPoints; ++k) {
    for (Index i = 0; i < 2; ++i) x(k, i) = random.normal();
    for (Index i = 2; i < width; ++i) x(k, i) = random.uniform(0.05, 1.0);
  }
  for (std::size_t l = 0; l < laws.size(); ++l) {
    const auto column = static_cast<Index>(l);
    call += fmt::format("y[{0}] = law_{0}(x[0], x[1], x + 2); ", l);
    for (Index k = 0; k < kPoints; ++k) {
      std::vector<double> parameters;
      for (std::size_t i = 0; i < laws[l]->parameters.size(); ++i) {
        parameters.push_back(x(k, 2 + static_cast<Index>(i)));
      }
      own(k, column) = laws[l]->make(parameters)->force(x(k, 0), x(k, 1), {});
    }
  }
  const MatrixXd exported = run_c(law_program(laws), call, x, own.cols());
  for (std::size_t l = 0; l < laws.size(); ++l) {
    const auto column = static_cast<Index>(l);
    const double scale = own.col(column).cwiseAbs().maxCoeff();
    EXPECT_GT(scale, 0.0) << laws[l]->name;
    for (Index k = 0; k < kPoints; ++k) {
      EXPECT_NEAR(exported(k, column), own(k, column),
                  kTolerance * std::abs(own(k, column)) + 1e-15 * scale)
          << laws[l]->name;
    }
  }
}

// ---- lumped models ------------------------------------------------------------------------------

const std::string kDrive = R"(format: graybox-lumped/1
sample_time: 0.001
motion: rotation
masses: {motor: 0.0021, load: 0.035}
elements:
  - {name: shaft, location: {kind: element, between: [motor, load]}, law: stiffness,
     parameters: {stiffness: {value: 45, unit: N m/rad}}}
  - {name: hard, location: {kind: element, deflection: {motor: 1, load: -50}}, law: cubic_spring,
     parameters: {stiffness: {value: 3, unit: N m/rad^3}}}
  - {name: play, location: {kind: element, between: [motor, load]}, law: backlash,
     parameters: {half_gap: {value: 0.3, unit: rad}, stiffness: {value: 45, unit: N m/rad}}}
  - {name: bearing, location: {kind: element, mass: load}, law: viscous,
     parameters: {damping: {value: 0.01, unit: N m s/rad}}}
  - {name: "seal */ of the motor", location: {kind: element, mass: motor}, law: stribeck,
     parameters: {level: {value: 0.1, unit: N m}, static_level: {value: 0.2, unit: N m},
       stribeck_velocity: {value: 0.4, unit: rad/s},
       transition_velocity: {value: 0.1, unit: rad/s}}}
  - {name: cogging, location: {kind: element, mass: load, driven_by: {mass: motor}}, law: ripple,
     parameters: {amplitude: {value: 0.3, unit: N m}, period: {value: 0.5, unit: rad},
       phase: {value: 0.2, unit: rad}}}
  - {name: disc, location: {kind: element, between: [motor, load]}, law: inertia,
     parameters: {inertia: {value: 0.004, unit: kg m^2}}}
  - {name: amplifier, location: {kind: actuator, input: torque}, law: gain,
     parameters: {error: {value: -0.2, unit: 1}}}
  - {name: dead, location: {kind: actuator, input: torque}, law: dead_zone,
     parameters: {half_width: {value: 0.05, unit: N m}}}
  - {name: limit, location: {kind: actuator, input: torque}, law: saturation,
     parameters: {limit: {value: 2, unit: N m}, corner: {value: 0.5, unit: N m}}}
  - {name: zero, location: {kind: actuator, input: torque}, law: offset,
     parameters: {value: {value: 0.1, unit: N m}}}
  - {name: reading, location: {kind: sensor, output: speed}, law: offset,
     parameters: {value: {value: 0.1, unit: rad/s}}}
inputs:
  - {name: torque, mass: motor}
outputs:
  - {name: speed, mass: motor, quantity: velocity}
)";

TEST_F(Export, ALumpedModelsForcesAreTheModels) {
  const std::string file = write("drive.yaml", kDrive);
  const ExportedModel exported = read_exported_model(file, {});
  const LumpedModel model = load_lumped_model(file);
  ElementDynamics elements(model.elements, 1, 1);
  const MatrixXd motion = random_motion(2, 200);
  MatrixXd own(motion.rows(), 2);
  VectorXd states, rates;
  for (Index k = 0; k < motion.rows(); ++k) {
    const VectorXd q = motion.row(k).head<2>(), v = motion.row(k).segment<2>(2),
                   a = motion.row(k).tail<2>();
    VectorXd force = VectorXd::Zero(2);
    elements.add_force(q, v, states, force, rates);
    own.row(k) = model.mass * a + model.damping * v + model.stiffness * q - force;
  }
  expect_equal(forces_of(exported, motion), own);
}

TEST_F(Export, CommandsUndoTheLawsOfAnActuator) {
  const std::string file = write("drive.yaml", kDrive);
  const LumpedModel model = load_lumped_model(file);
  ElementDynamics elements(model.elements, 1, 1);
  const std::string source = c_function(read_exported_model(file, {}), "drive");
  MatrixXd force = MatrixXd::Zero(41, 2), own(41, 1);
  for (Index k = 0; k < force.rows(); ++k) {
    force(k, 0) = 0.0947 * static_cast<double>(k - 20);  // within the limit
    own.row(k) = elements.command_for(force.row(k).head<1>());
  }
  const MatrixXd commands = run_c(source, "drive_command(x, y);", force, 1);
  expect_equal(commands, own);
  // The commands really make these forces.
  VectorXd none(0);
  for (Index k = 0; k < force.rows(); ++k) {
    VectorXd signal = commands.row(k).transpose();
    elements.act(signal, none, none);
    EXPECT_NEAR(signal(0), force(k, 0), 1e-9);
  }
  // Beyond the limit: the command that comes nearest.
  MatrixXd beyond = MatrixXd::Zero(1, 2);
  beyond(0, 0) = -7.0;
  VectorXd signal = run_c(source, "drive_command(x, y);", beyond, 1).row(0).transpose();
  elements.act(signal, none, none);
  EXPECT_NEAR(signal(0), -2.0 + 0.1, 1e-9);
}

TEST_F(Export, LawsThatFollowFromThePastAreRefusedByName) {
  std::string text = testing::replaced(kDrive,
                                       "law: viscous,\n     parameters: {damping: {value: "
                                       "0.01, unit: N m s/rad}}",
                                       "law: dahl,\n     parameters: {stiffness: {value: 5, unit: "
                                       "N m/rad}, level: {value: 1, unit: N m}}");
  text = testing::replaced(text, "law: gain,\n     parameters: {error: {value: -0.2, unit: 1}}",
                           "law: delay,\n     parameters: {time: {value: 0.01, unit: s}}");
  const std::string file = write("drive.yaml", text);
  const auto source = [&](const ExportOptions& options) {
    return c_function(read_exported_model(file, options), "m");
  };
  expect_refused([&] { (void)source({}); }, "element 'bearing' (dahl at load) has memory");
  expect_refused([&] { (void)source({}); }, "element 'amplifier' (delay at actuator torque)");
  EXPECT_NE(source({.without = {"bearing", "amplifier"}}), "");
  expect_refused([&] { (void)source({.without = {"bearings"}}); }, "no element 'bearings'");
  const std::string driven = testing::replaced(
      kDrive,
      "mass: load}, law: viscous,\n     parameters: {damping: {value: 0.01, unit: N m s/rad}",
      "mass: load, driven_by: {input: torque}}, law: load_dependent_friction,\n     parameters: "
      "{level: {value: 1, unit: N m}, coefficient: {value: 1, unit: N m/(N m)}, "
      "transition_velocity: {value: 1, unit: rad/s}");
  const std::string other = write("driven.yaml", driven);
  expect_refused([&] { (void)c_function(read_exported_model(other, {}), "m"); },
                 "element 'bearing' (load_dependent_friction at load driven by torque) is driven");
  expect_refused([&] { (void)c_function(read_exported_model(other, {}), "1m"); }, "--name");
}

// ---- rigid robots -------------------------------------------------------------------------------

// Three axes, the second of which slides, with coupled motors.
const std::string kArm = R"(format: graybox-rigid-robot/1
gravity: [1, -2, -9.81]
denavit_hartenberg: standard
transmission: [[50, 0, 0], [0, 80, 0], [0, 30, -60]]
joints:
  - {name: waist, a: 0.2, alpha: 40, d: 0.3, theta: 10, rotor_inertia: 1e-3,
     body: {mass: 20, centre_of_mass: [0.1, -0.2, 0.05],
            inertia: {xx: 1, yy: 1.5, zz: 0.9, xy: 0.1, xz: -0.2, yz: 0.05}}}
  - {name: slide, type: prismatic, a: 0.5, alpha: -70, d: 0.1, theta: 20, rotor_inertia: 2e-3,
     body: {mass: 12, centre_of_mass: [0.3, 0.1, 0.02],
            inertia: {xx: 0.4, yy: 0.5, zz: 0.6, xy: 0.02, xz: 0.03, yz: -0.04}}}
  - {name: wrist, a: 0.1, alpha: 90, d: 0.2, theta: -30, rotor_inertia: 0,
     body: {mass: 5, centre_of_mass: [-0.05, 0.1, 0.2],
            inertia: {xx: 0.1, yy: 0.15, zz: 0.12, xy: 0.01, xz: 0.02, yz: 0.01}}}
elements:
  - {name: dry, location: {kind: element, joint: waist, axis: motor}, law: asymmetric_coulomb,
     parameters: {forward_level: {value: 0.2, unit: N m}, backward_level: {value: 0.3, unit: N m},
       transition_velocity: {value: 0.5, unit: rad/s}}}
  - {name: coupled, location: {kind: element, joint: wrist, axis: arm,
       driven_by: {deflection: {waist: 2, wrist: -1}}}, law: sublinear_friction,
     parameters: {level: {value: 3, unit: N m}, exponent: {value: 0.4, unit: 1},
       reference_velocity: {value: 1, unit: rad/s}, transition_velocity: {value: 0.1, unit: rad/s}}}
  - {name: spring, location: {kind: element, joint: slide, axis: arm}, law: dead_zone,
     parameters: {clearance: {value: 0.2, unit: m}, stiffness: {value: 300, unit: N/m}}}
  - {name: rotor, location: {kind: element, joint: wrist, axis: arm}, law: inertia,
     parameters: {inertia: {value: 0.7, unit: kg m^2}}}
  - {name: tool, location: {kind: element, axis: flange}, law: payload,
     parameters: {mass: {value: 2, unit: kg}, x: {value: 0.1, unit: m}, y: {value: 0, unit: m},
       z: {value: 0.2, unit: m}}}
  - {name: part, location: {kind: element, axis: flange, load: part}, law: payload,
     parameters: {mass: {value: 3, unit: kg}, x: {value: 0, unit: m}, y: {value: 0.3, unit: m},
       z: {value: 0.1, unit: m}}}
)";

// N^T u of the model with every parameter as the file has it, plus the columns times `unknown`.
MatrixXd model_forces(RigidRobotModel robot, const MatrixXd& motion, const std::string& load,
                      const VectorXd& unknown = {}) {
  for (std::size_t e = 0; e < robot.elements.size(); ++e) {
    for (std::size_t p = 0; p < robot.elements[e].parameters.size(); ++p) {
      robot.known.push_back({e, p});
    }
  }
  TorqueColumns columns(robot);
  columns.carry(load);
  const Index n = robot.size();
  MatrixXd forces(motion.rows(), n);
  for (Index k = 0; k < motion.rows(); ++k) {
    const VectorXd state = motion.row(k);
    columns.evaluate(state.head(n), state.segment(n, n), state.tail(n));
    forces.row(k) = columns.known().transpose();
    if (unknown.size() > 0) forces.row(k) += (columns.matrix() * unknown).transpose();
  }
  return forces;
}

TEST_F(Export, ARigidRobotsForcesAreTheModels) {
  const std::string file = write("arm.yaml", kArm);
  const RigidRobotModel robot = load_rigid_robot(file);
  const MatrixXd motion = random_motion(3, 200, 2.0);
  for (const std::string load : {"", "part"}) {
    const ExportedModel exported = read_exported_model(file, {.load = load});
    expect_equal(forces_of(exported, motion), model_forces(robot, motion, load));
  }
  const MatrixXd forces = model_forces(robot, motion, "");
  const MatrixXd motors =
      run_c(c_function(read_exported_model(file, {}), "m"), "m_motors(x, y);", forces, 3);
  expect_equal(motors * robot.transmission, forces);
  expect_refused([&] { (void)read_exported_model(file, {.load = "parts"}); },
                 "no payload of the load 'parts'; there are part");
}

// A robot without bodies and without rotors: tests what is left out of the text then.
TEST_F(Export, AnAxisOfFrictionAloneNeedsNoBodies) {
  const std::string file = write("axis.yaml", R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: carriage, type: prismatic, alpha: 90, a: 0, d: 0, gear_ratio: 1, rotor_inertia: 0}
elements:
  - {name: dry, location: {kind: element, joint: carriage, axis: arm}, law: coulomb,
     parameters: {level: {value: 20, unit: N}, transition_velocity: {value: 0.01, unit: m/s}}}
base_parameters:
  - {name: M1, value: 95.1, standard_error: 0.1, unit: kg}
)");
  const MatrixXd motion = random_motion(1, 20, 0.01);
  MatrixXd own(motion.rows(), 1);
  for (Index k = 0; k < motion.rows(); ++k) {
    own(k, 0) = 95.1 * motion(k, 2) + 20.0 * std::tanh(motion(k, 1) / 0.01);
  }
  expect_equal(forces_of(read_exported_model(file, {}), motion), own);
}

std::string list_of_base_parameters(const BaseParameters& base, const VectorXd& values) {
  std::string list = "base_parameters:\n";
  for (Index k = 0; k < base.size(); ++k) {
    list += fmt::format("  - {{name: {}, value: {}, standard_error: 0, unit: kg}}\n",
                        base.names[static_cast<std::size_t>(k)], values(k));
  }
  return list;
}

// The arm with its second body and all rotors unknown, and its base parameters from random bodies.
TEST_F(Export, BaseParametersMakeTheForcesOfTheBodiesThatHaveThem) {
  std::string text = kArm;
  const std::size_t from = text.find("\n     body: {mass: 12"), to = text.find("}}}", from) + 2;
  text.replace(from, to - from, "");
  text = testing::replaced(text, "rotor_inertia: 2e-3,", "rotor_inertia: unknown");
  text = testing::replaced(text, "rotor_inertia: 1e-3", "rotor_inertia: unknown");
  const std::string bare = write("bare.yaml", text);
  RigidRobotModel robot = load_rigid_robot(bare);
  for (std::size_t e = 0; e < robot.elements.size(); ++e) {
    for (std::size_t p = 0; p < robot.elements[e].parameters.size(); ++p) {
      robot.known.push_back({e, p});
    }
  }
  TorqueColumns columns(robot);
  ASSERT_EQ(columns.size(), 12);
  Random random(5);
  VectorXd unknown(columns.size());
  for (double& value : unknown) value = random.normal();
  const BaseParameters base = structural_base_parameters(columns, 3);
  ASSERT_LT(base.size(), columns.size());  // some are regrouped
  const std::string file =
      write("arm.yaml", text + list_of_base_parameters(base, base.regrouping * unknown));
  const MatrixXd motion = random_motion(3, 100, 2.0);
  expect_equal(forces_of(read_exported_model(file, {}), motion),
               model_forces(robot, motion, "", unknown));
  expect_refused([&] { (void)read_exported_model(bare, {}); },
                 "the rotor inertia of waist, the body of slide, the rotor inertia of slide are "
                 "unknown");
  const std::string wrong = write("wrong.yaml", text +
                                                    "base_parameters:\n  - {name: XX9, value: "
                                                    "1, standard_error: 0, unit: kg m^2}\n");
  expect_refused([&] { (void)read_exported_model(wrong, {}); }, "'XX9' is no unknown parameter");
}

TEST_F(Export, BodiesThatADiagnosisHasFreedAreMovedByTheirDepartures) {
  const std::string file = write("arm.yaml", kArm + R"(base_parameters:
  - {name: MX departure of slide, value: -0.7, standard_error: 0.1, unit: kg m}
  - {name: ZZ departure of waist, value: 0.4, standard_error: 0.1, unit: kg m^2}
)");
  const RigidRobotModel robot = load_rigid_robot(file);
  const MatrixXd motion = random_motion(3, 50, 2.0);
  VectorXd departure = VectorXd::Zero(30);
  departure(10 + 6) = -0.7;
  departure(5) = 0.4;
  MatrixXd own = model_forces(robot, motion, "");
  RigidBodyRegressor regressor(robot);
  for (Index k = 0; k < motion.rows(); ++k) {
    const VectorXd state = motion.row(k);
    own.row(k) +=
        (regressor.evaluate(state.head(3), state.segment(3, 3), state.tail(3)) * departure)
            .transpose();
  }
  expect_equal(forces_of(read_exported_model(file, {}), motion), own);
}

// ---- URDF ---------------------------------------------------------------------------------------

const std::string kUrdf = std::string(GRAYBOX_SOURCE_DIR) + "/problems/robot/three_axis.urdf";

std::string urdf_model(const std::string& urdf, const std::string& elements) {
  return "format: graybox-rigid-robot/1\ngravity: [0, 0, -9.81]\nurdf: " + urdf +
         "\nbase: base_link\ntip: flange\njoints:\n"
         "  - {name: joint_1, gear_ratio: 1, rotor_inertia: 0}\n"
         "  - {name: joint_2, gear_ratio: -50, rotor_inertia: 0}\n"
         "  - {name: joint_3, gear_ratio: 1, rotor_inertia: 0}\n" +
         elements;
}

const std::string kFound = R"(elements:
  - {name: oil, location: {kind: element, joint: joint_1, axis: arm}, law: viscous,
     parameters: {damping: {value: 4.5, unit: N m s/rad}}}
  - {name: grease, location: {kind: element, joint: joint_2, axis: motor}, law: viscous,
     parameters: {damping: {value: 0.002, unit: N m s/rad}}}
  - {name: seal, location: {kind: element, joint: joint_2, axis: motor}, law: coulomb,
     parameters: {level: {value: 0.1, unit: N m}, transition_velocity: {value: 1e-6, unit: rad/s}}}
  - {name: flywheel, location: {kind: element, joint: joint_1, axis: arm}, law: inertia,
     parameters: {inertia: {value: 0.3, unit: kg m^2}}}
  - {name: tool, location: {kind: element, axis: flange}, law: payload,
     parameters: {mass: {value: 2, unit: kg}, x: {value: 0.3, unit: m}, y: {value: 0.1, unit: m},
       z: {value: -0.2, unit: m}}}
)";

// urdfdom reads bodies, damping and friction; what they make is the model's force. Coulomb friction
// is compared well beyond its transition velocity.
TEST_F(Export, AUrdfHoldsWhatWasFound) {
  const std::string file = write("arm.yaml", urdf_model(kUrdf, kFound));
  const UrdfExport exported = urdf_with_findings(read_exported_model(file, {}));
  const std::string urdf = write("found.urdf", exported.text);
  const urdf::ModelInterfaceSharedPtr read = urdf::parseURDF(exported.text);
  ASSERT_NE(read, nullptr);
  const std::string bare = write("bare.yaml", urdf_model(urdf, ""));
  const MatrixXd motion = random_motion(3, 100, 2.0);
  MatrixXd forces = model_forces(load_rigid_robot(bare), motion, "");
  for (Index j = 0; j < 3; ++j) {
    const auto joint = read->getJoint(fmt::format("joint_{}", j + 1));
    ASSERT_NE(joint, nullptr);
    if (joint->dynamics == nullptr) continue;
    for (Index k = 0; k < motion.rows(); ++k) {
      const double velocity = motion(k, 3 + j);
      forces(k, j) += joint->dynamics->damping * velocity +
                      joint->dynamics->friction * (velocity > 0.0 ? 1.0 : -1.0);
    }
  }
  EXPECT_DOUBLE_EQ(read->getJoint("joint_1")->dynamics->damping, 4.5);
  EXPECT_DOUBLE_EQ(read->getJoint("joint_2")->dynamics->damping, 0.002 * 2500.0);
  EXPECT_DOUBLE_EQ(read->getJoint("joint_2")->dynamics->friction, 5.0);
  EXPECT_EQ(read->getJoint("joint_3")->dynamics, nullptr);
  expect_equal(forces, model_forces(load_rigid_robot(file), motion, ""));
  EXPECT_NE(exported.text.find("ASSUMED"), std::string::npos);  // the file's own comment
  EXPECT_NE(exported.text.find("velocity=\"3.0\""), std::string::npos);
}

TEST_F(Export, AUrdfRefusesWhatItHasNoPlaceFor) {
  const auto refused = [&](const std::string& text, const std::string& words) {
    const std::string file = write("arm.yaml", text);
    expect_refused([&] { (void)urdf_with_findings(read_exported_model(file, {})); }, words);
  };
  refused(urdf_model(kUrdf, testing::replaced(kFound, "joint: joint_1, axis: arm}, law: inertia",
                                              "joint: joint_3, axis: arm}, law: inertia")),
          "element 'flywheel' (inertia at joint_3.arm) would turn with the joints before, too");
  refused(urdf_model(kUrdf, testing::replaced(kFound, "joint: joint_1, axis: arm}, law: viscous",
                                              "deflection: {joint_1: 1, joint_2: 1}}, law: "
                                              "viscous")),
          "no place for element 'oil' (viscous at joint_1-joint_2)");
  refused(urdf_model(kUrdf, testing::replaced(kFound,
                                              "law: viscous,\n     parameters: {damping: "
                                              "{value: 4.5, unit: N m s/rad}}",
                                              "law: offset,\n     parameters: {value: {value: 1, "
                                              "unit: N m}}")),
          "no place for element 'oil' (offset at joint_1.arm)");
  refused(kArm, "has no URDF");
  refused(urdf_model(kUrdf, testing::replaced(kFound, "value: 0.3, unit: kg m^2",
                                              "value: -3, unit: kg m^2")),
          "link 'link_1' has a mass or a moment of inertia below zero");
  std::string freed = urdf_model(kUrdf, kFound) +
                      "base_parameters:\n  - {name: MX departure of joint_2, value: 1, "
                      "standard_error: 0, unit: kg m}\n";
  refused(freed, "base parameters alone");
}

TEST_F(Export, AUrdfThatHasDynamicsSaysWhatBecomesOfThem) {
  const std::string urdf =
      write("own.urdf",
            testing::replaced(testing::replaced(read_text(kUrdf), "<axis xyz=\"0 0 1\"/>",
                                                "<axis xyz=\"0 0 1\"/><dynamics damping=\"9\"/>"),
                              "<child link=\"flange\"/>",
                              "<child link=\"flange\"/><dynamics friction=\"8\"/>"));
  const std::string file = write("arm.yaml", urdf_model(urdf, kFound));
  const UrdfExport exported = urdf_with_findings(read_exported_model(file, {}));
  const urdf::ModelInterfaceSharedPtr read = urdf::parseURDF(exported.text);
  EXPECT_DOUBLE_EQ(read->getJoint("joint_1")->dynamics->damping, 4.5);
  EXPECT_DOUBLE_EQ(read->getJoint("joint_3")->dynamics->friction, 8.0);
  ASSERT_EQ(exported.notes.size(), 2U);
  EXPECT_NE(exported.notes[0].find("joint_1 had damping 9"), std::string::npos);
  EXPECT_NE(exported.notes[0].find("replaced"), std::string::npos);
  EXPECT_NE(exported.notes[1].find("they stay"), std::string::npos);
}

// ---- tables -------------------------------------------------------------------------------------

std::vector<std::vector<double>> rows_of(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(lines, line)) {
    rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

TEST_F(Export, TablesHoldTheForcesOfTheLaws) {
  const std::string extra =
      R"(  - {name: "oil, cold", location: {kind: element, mass: motor}, law: viscous,
     parameters: {damping: {value: 0.7, unit: N m s/rad}}}
  - {name: thick, location: {kind: element, mass: load}, law: deflection_damping,
     parameters: {coefficient: {value: 0.7, unit: N m s/rad^3}}}
inputs:
)";
  const std::string file = write("drive.yaml", testing::replaced(kDrive, "inputs:\n", extra));
  const std::vector<ModelTable> tables =
      model_tables(read_exported_model(file, {}), {.velocity = 3.0, .points = 21});
  std::vector<std::string> names;
  for (const ModelTable& table : tables) names.push_back(table.file);
  const std::vector<std::string> expected = {
      "parameters.csv",    "spring_motor-load.csv", "spring_motor-load_2.csv",
      "friction_load.csv", "friction_motor.csv",    "spring_load_driven_by_motor.csv",
      "damping_load.csv"};
  EXPECT_EQ(names, expected);
  EXPECT_NE(tables[0].text.find("motor,,,inertia,0.0021,kg m^2\n"), std::string::npos);
  EXPECT_NE(tables[0].text.find("\"oil, cold\",viscous,motor,damping,0.7,N m s/rad\n"),
            std::string::npos);
  EXPECT_NE(tables[0].text.find("limit,saturation,actuator torque,corner,0.5,N m\n"),
            std::string::npos);
  EXPECT_EQ(tables[4].text.substr(0, tables[4].text.find('\n')),
            "velocity [rad/s],seal */ of the motor [N m],\"oil, cold [N m]\",force [N m]");
  const auto friction = rows_of(tables[4].text);
  ASSERT_EQ(friction.size(), 21U);
  EXPECT_DOUBLE_EQ(friction.front()[0], -3.0);
  EXPECT_DOUBLE_EQ(friction[10][0], 0.0);
  for (const std::vector<double>& row : friction) {
    const double v = row[0];
    const double dry = (0.1 + 0.1 * std::exp(-v * v / 0.16)) * std::tanh(v / 0.1);
    EXPECT_NEAR(row[1], dry, 1e-14);
    EXPECT_NEAR(row[2], 0.7 * v, 1e-14);
    EXPECT_NEAR(row[3], row[1] + row[2], 1e-14);
  }
  const auto spring = rows_of(tables[1].text);  // shaft and play; ten times the half gap
  EXPECT_DOUBLE_EQ(spring.back()[0], 3.0);
  for (const std::vector<double>& row : spring) {
    const double beyond = std::max(std::abs(row[0]) - 0.3, 0.0);
    EXPECT_NEAR(row[3], std::copysign(45.0 * beyond, row[0]), 1e-12);
  }
  const auto damping = rows_of(tables[6].text);
  ASSERT_EQ(damping.size(), 441U);
  for (const std::vector<double>& row : damping) {
    EXPECT_NEAR(row[2], 0.7 * row[0] * row[0] * row[1], 1e-13);
  }
}

}  // namespace
}  // namespace graybox
