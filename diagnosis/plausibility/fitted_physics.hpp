// What physical sanity is judged by (plausibility.hpp): the parameters of a fitted model and of its
// laws, and the laws along the recorded motion. Plain lists, so that every kind of model and laws
// of users pass through one gate.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace graybox {

// What a parameter measures, and so which values it can have.
enum class QuantityKind : std::int8_t {
  kOther,       // any value may be right
  kMass,        // positive
  kInertia,     // positive
  kStiffness,   // not negative in a machine that stands by itself
  kDamping,     // not negative
  kFriction,    // the level of a friction: not negative
  kGain,        // of a drive, or one over it: positive
  kForce,       // any sign; no larger than what the channel carried
  kDeflection,  // a threshold (gap, clearance): the motion must pass it
  kRate,        // likewise, of the velocity
};
[[nodiscard]] const char* words_of(QuantityKind kind);

// By its unit at its place ("N m s/rad", "kg") and by its name, which tells a friction's level from
// another force. Thresholds are not told by a unit: kOther.
[[nodiscard]] QuantityKind quantity_kind(const std::string& name, const std::string& unit);

struct PhysicalQuantity {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::size_t kOfTheModel = static_cast<std::size_t>(-1);

  std::string name;  // "damping of viscous at load"
  std::string unit;
  QuantityKind kind = QuantityKind::kOther;
  double value = 0.0;
  double standard_error = kNone;  // NaN: none
  // What the model states at the same place and the value comes on top of; NaN: something, but not
  // how much, so that the sign tells nothing.
  double stated = 0.0;
  // Where the search for the value began, or its bounds; NaN: none.
  double start = kNone, lowest = kNone, highest = kNone;
  std::size_t law = kOfTheModel;  // index into FittedPhysics::laws
};

// A law along the recorded motion, sample by sample.
struct LawTrace {
  std::string name;   // "viscous at load"
  std::string place;  // laws at one place act on one motion
  // Empty where the force along the motion is not known.
  std::vector<double> deflection, rate, force;
  // The part of the force that the deflection alone sets and gives back, likewise; empty: none.
  std::vector<double> conservative;
  bool has_memory =
      false;  // the force depends on more than the motion now: only its sum over all samples tells
  // The force in all coordinates, one after another; empty: only laws of one place are compared.
  std::vector<double> acting;
  double carried = std::numeric_limits<
      double>::quiet_NaN();  // largest force of the channel there; NaN: not known
  double fed_in =
      std::numeric_limits<double>::quiet_NaN();  // mean power fed in there; NaN: not known
};

// A body with all its parameters: inertia about the origin of its frame.
struct PhysicalBody {
  std::string name;
  double mass = 0.0;
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  // By how many of their standard errors its parameters must change until it can exist; infinite:
  // they have none.
  double errors_from_possible = std::numeric_limits<double>::infinity();
};

// A direction of the parameters that the data do not see: relative changes, the largest 1, one for
// each quantity.
struct UnseenDirection {
  Eigen::VectorXd change;
};

struct FittedPhysics {
  std::vector<PhysicalQuantity> quantities;
  std::vector<LawTrace> laws;
  std::vector<PhysicalBody> bodies;
  std::vector<UnseenDirection> unseen;
  Eigen::MatrixXd correlation;  // of the quantities' errors; empty or NaN: not known
};

}  // namespace graybox
