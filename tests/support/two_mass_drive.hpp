// A motor that turns a load through a shaft.
#pragma once

#include <string>

namespace graybox::testing {

// N m/rad and N m s/rad, as text.
inline std::string two_mass_drive(const std::string& stiffness, const std::string& shaft_damping) {
  return R"(format: graybox-lumped/1
sample_time: 0.002
motion: rotation
masses: {motor: 0.0021, load: 0.01}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: )" +
         stiffness + R"(, unit: N m/rad}}
  - name: shaft damping
    location: {kind: element, between: [motor, load]}
    law: viscous
    parameters: {damping: {value: )" +
         shaft_damping + R"(, unit: N m s/rad}}
  - name: bearing
    location: {kind: element, mass: load}
    law: viscous
    parameters: {damping: {value: 0.05, unit: N m s/rad}}
inputs:
  - {name: torque, mass: motor}
outputs:
  - {name: speed, mass: motor, quantity: velocity}
  - {name: load_speed, mass: load, quantity: velocity}
noise: {speed: 0.005, load_speed: 0.005}
)";
}

// Its shaft hardly damps: recorded from rest, its free motion is in all of the recording.
inline const std::string kRingingDrive = two_mass_drive("30", "0.005");

}  // namespace graybox::testing
