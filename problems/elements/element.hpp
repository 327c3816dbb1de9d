// Element: a law at a place. Models and `physics.yaml` list elements, and all of them are read
// here:
//
//   - name: play in the second gearbox
//     location: {kind: element, joint: joint_2, axis: gearbox}
//     law: backlash
//     parameters:
//       half_gap: {value: 1e-5, unit: rad}
//       stiffness: {value: 3.07e6, unit: N m/rad, fixed: true}    # fits leave it as it is
//
// kind: element. A force law acts on the coordinates q by the force -b_out f(z, z', x) with
// z = b_in^T q; b_in = b_out unless the location says what drives it (cross-coupling, transmission
// error):
//     location: {kind: element, joint: j_5, axis: motor, driven_by: {joint: j_4, axis: arm}}
// A recorded input d may stand in the place of z, with the rate of the place itself: friction that
// grows with the load. So far this is for lumped models, fits and the prediction of any motion.
//     location: {kind: element, mass: motor, driven_by: {input: torque}}
//     law: load_dependent_friction
// kind: actuator and kind: sensor. A signal law turns the signal s into s + f(s); laws of one
// signal apply in the order of the list, delays last.
//
// A law of a signal may be driven by a recorded input d instead of the signal itself, s + f(d).
// Examples are an encoder that reads what the gear behind it yields under the torque, and a sensor
// that picks up a current:
//     location: {kind: sensor, output: angle, driven_by: {input: torque}}
//     law: feedthrough
//
// What names a place besides `kind` depends on the model: for robots see robot_elements.hpp, for
// lumped models lumped_model.hpp.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

class YamlField;

enum class LocationKind : std::int8_t { kElement, kActuator, kSensor };

struct Location {
  LocationKind kind = LocationKind::kElement;
  std::string name;            // "joint_2.gearbox", "actuator joint_1"
  Eigen::VectorXd input;       // b_in; empty at signals and at the flange
  Eigen::VectorXd output;      // b_out
  Eigen::Index channel = 0;    // of an actuator or sensor; elsewhere on a robot the joint
  Eigen::Index driver = -1;    // of a lumped model: the input that drives the law, if any
  bool takes_inertia = false;  // motors, arm axes, masses: inertia against the inertial frame
  bool is_flange = false;      // takes payloads alone
  std::string load;            // of a rigid robot: only in recordings with it; empty: in all
  PlaceUnits units;
};

// A robot's flange, where payloads are; `load`: in the recordings that carry this load
// (campaign.hpp), in all if empty.
[[nodiscard]] Location flange_location(const std::string& load = "");

// Whether they are one place of a model, whichever direction each calls positive.
[[nodiscard]] bool are_one_place(const Location& a, const Location& b);

struct Element {
  std::string name;
  Location location;
  std::string law_name;
  LawUse use = LawUse::kForce;
  std::vector<double> parameters;  // in the order of the catalogue
  std::vector<bool> fixed;         // of each: stated as `fixed: true`, so that no fit changes it
  std::shared_ptr<const Law> law;  // null for inertia, delay and payload
};

// How a model names its places.
class Places {
 public:
  virtual ~Places() = default;
  // Throws InputError through the field.
  [[nodiscard]] virtual Location resolve(const YamlField& location) const = 0;
};

// `list`: the value of the key `elements`. Throws InputError of one line for whatever is wrong:
// unknown law, place or parameter, a missing or wrong unit, a value out of range, two of one name.
[[nodiscard]] std::vector<Element> read_elements(const YamlField& list, const Places& places);

// The elements of a model: the keys `laws` (law_file.hpp), whose laws enter the catalogue, and
// `elements`; none where the model has neither.
[[nodiscard]] std::vector<Element> read_model_elements(const YamlField& root, const Places& places);

// Whether {value: ..., fixed: true} says so.
[[nodiscard]] bool read_fixed(const YamlField& parameter);

// The elements of a graybox-physics/1 file: {format: graybox-physics/1, elements: [...]}, `laws`
// with it where it uses laws of its own.
[[nodiscard]] std::vector<Element> read_physics(const std::filesystem::path& file,
                                                const Places& places);

}  // namespace graybox
