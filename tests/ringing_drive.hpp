// A drive whose shaft hardly damps: recorded from rest, its free motion is in all of the recording.
#pragma once

namespace graybox::testing {

inline constexpr const char* kRingingDrive = R"(format: graybox-lumped/1
sample_time: 0.002
motion: rotation
masses: {motor: 0.0021, load: 0.01}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: 30, unit: N m/rad}}
  - name: shaft damping
    location: {kind: element, between: [motor, load]}
    law: viscous
    parameters: {damping: {value: 0.005, unit: N m s/rad}}
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

}  // namespace graybox::testing
