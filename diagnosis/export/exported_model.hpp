// ExportedModel: a model as other programs take it, with nothing unknown. The force along each
// coordinate (a mass of a lumped model, a joint of a robot) is
//
//   f = M q'' + h(q, q', q'') + sum over the laws of b_out f_law(b_in^T q, b_in^T q'),
//
// M constant (masses, rotors, added inertias), h what the bodies of a robot take, with their
// weight. A lumped model has no h.
//
//   const ExportedModel model = read_exported_model("report/model_extended.yaml", {});
//   write_text_file("model.c", c_function(model, "model"));               // c_function.hpp
//
// Recordings may have told a robot's bodies by their base parameters alone (`base_parameters` of an
// extended model). Equivalent bodies stand for them then. A base parameter has the place of the
// first parameter that is in it; those that are regrouped into it are zero. Forces are the same
// along every motion; no real body has these numbers.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct ExportOptions {
  std::vector<std::filesystem::path> physics = {};  // files with further elements
  std::vector<std::string> without = {};            // names of elements that are left out
  std::string load = {};  // payloads of this load are there; those of other loads are not
};

struct ExportedCoordinate {
  std::string name;
  PlaceUnits units;
};

// A number of the model with its unit, for tables: "motor", "inertia", 0.0021, "kg m^2".
struct ExportedNumber {
  std::string owner, name;
  double value = 0.0;
  std::string unit;
};

struct ExportedModel {
  std::filesystem::path file;
  std::vector<ExportedCoordinate> coordinates;
  Eigen::MatrixXd mass;                 // M
  std::vector<Element> forces;          // laws of forces between coordinates
  std::vector<Element> commands;        // laws of actuators of a lumped model, in their order
  std::vector<Element> senses;          // laws of sensors: they change no force
  std::vector<ExportedNumber> numbers;  // masses, bodies, rotors

  // A lumped model's inputs of kind force: their places among all inputs, and the masses that they
  // act on.
  std::vector<std::string> input_names;
  std::vector<Eigen::Index> input_channels, input_masses;

  // A robot's: its chain, what its bodies are (10 x n, rigid_body_regressor.hpp), and its URDF.
  std::optional<RigidRobotModel> robot;
  Eigen::MatrixXd bodies;
  bool has_base_parameters = false;  // so that no column of `bodies` need be a body
  std::vector<Element> payloads;     // those that are there; in `bodies`, too
  std::vector<Element> inertias;     // in `mass`, too
  std::filesystem::path urdf;        // empty: the model has none
  std::string base, tip;

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(coordinates.size()); }
};

// graybox-lumped/1 and graybox-rigid-robot/1. Throws InputError for other formats, for a robot of
// which something is unknown, and for names in `without` that no element has.
[[nodiscard]] ExportedModel read_exported_model(const std::filesystem::path& file,
                                                const ExportOptions& options);

// Throws InputError where an element's force is no function of position, velocity and acceleration
// (laws with memory, or driven by an input). So it does where an actuator's law can't be undone.
// The line names each element, why, and what could be done instead.
void require_closed_forces(const ExportedModel& model);

// The law of an element, and "found friction (coulomb at motor)".
[[nodiscard]] const LawEntry& law_entry(const Element& element);
[[nodiscard]] std::string element_words(const Element& element);

// The one line about what stands in the way, each part naming an element.
[[noreturn]] void refuse_export(const ExportedModel& model,
                                const std::vector<std::string>& obstacles);

}  // namespace graybox
