// A carriage of which force and motion are measured: files of a rigid robot of one joint.
#pragma once

namespace graybox::testing {

// Channels: force (N), x (m), v (m/s), a (m/s^2).
inline constexpr const char* kCarriageModel = R"(format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints:
  - {name: carriage, type: prismatic, alpha: 90, a: 0, d: 0, gear_ratio: 1, rotor_inertia: 0}
channels:
  torque: [force]
  torque_of: arm
  position: [x]
  position_of: arm
  velocity: [v]
  acceleration: [a]
)";

// The head of its campaign, up to the list of experiments; 100 Hz.
inline constexpr const char* kCarriageCampaign = R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: force, unit: N, is: input}
  - {name: x, unit: m, is: output}
  - {name: v, unit: m/s, is: output}
  - {name: a, unit: m/s^2, is: output}
experiments:
)";

}  // namespace graybox::testing
