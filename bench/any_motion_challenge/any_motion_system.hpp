// AnyMotionSystem: the machine of one case in any motion, twice. Once it is as the user believes it
// to be (the model file), once as it is (each parameter off by up to 10 %). It comes with its
// sensors, the controller that the user is not told of, its noise and the plan of its recordings.
//
//   M q'' + C q' + K q = e_1 u + e_n w        u the torque at the motor, w a force noise at the
//                                             load
//
// Families: a single axis with an encoder or a tachometer, and a two-mass drive with both encoders,
// with that of the motor alone, or with a tachometer at the motor alone. With an encoder the
// position is controlled (PD, the rate by a filtered difference), else the speed (PI, no wind-up);
// both have a limit, and what is recorded is the torque after it. Axes with a tachometer have a
// bearing in the model; the others' models have no damping against the ground.
//
// Noise: w has a standard deviation of 1 to 3 % of the torque's rms in that recording without it,
// and a memory of 0.05 to 0.5 s. Encoders round to 0.05 to 0.5 mrad; tachometers have white noise
// of 0.2 to 1 % of the largest reference. Sample times are off even ones by a standard deviation of
// up to 1 % of a step; in one case of four by 4 %, and then the recording says when they were.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "bench/any_motion_challenge/motion_reference.hpp"
#include "bench/challenge/case_system.hpp"

namespace graybox::bench {

inline constexpr double kAnyMotionSampleTime = 0.002;  // s

struct DriveDynamics {
  Eigen::VectorXd masses;
  Eigen::MatrixXd damping, stiffness;
};

struct DriveOutput {
  std::string name;
  Eigen::Index mass = 0;
  bool is_velocity = false;
  double quantum = 0.0;      // of an encoder, rad
  double white_noise = 0.0;  // of a tachometer, rad/s

  // Standard deviation of its noise; rounding's is quantum / sqrt(12).
  [[nodiscard]] double deviation() const;
};

struct DriveController {
  bool of_speed = false;
  double proportional = 0.0;  // N m/rad, or N m s/rad
  double derivative = 0.0;    // N m s/rad; of the speed none
  double integral = 0.0;      // N m/rad; of the position none
  double limit = 0.0;         // N m
};

struct PlannedMotion {
  MotionKind kind = MotionKind::kSteps;
  double amplitude = 0.0;  // rad, or rad/s
  Eigen::Index samples = 0;
  bool validation = false;
};

struct DriveParameter {
  std::string name;
  double believed = 0.0, factor = 1.0;  // true over believed
};

class AnyMotionSystem {
 public:
  // Throws std::logic_error for a family of another set.
  AnyMotionSystem(Family family, std::uint64_t seed);

  // With these values of the parameters, or the true ones.
  [[nodiscard]] DriveDynamics dynamics(const Eigen::VectorXd& values) const;
  [[nodiscard]] Eigen::VectorXd true_values() const;
  [[nodiscard]] Eigen::Index mass_count() const { return is_drive_ ? 2 : 1; }
  [[nodiscard]] const std::vector<DriveParameter>& parameters() const { return parameters_; }
  [[nodiscard]] const std::vector<DriveOutput>& outputs() const { return outputs_; }
  [[nodiscard]] const DriveController& controller() const { return controller_; }
  [[nodiscard]] const std::vector<PlannedMotion>& plan() const { return plan_; }
  [[nodiscard]] const std::vector<ChallengePlace>& places() const { return places_; }
  [[nodiscard]] double force_noise_share() const { return force_noise_share_; }
  [[nodiscard]] double force_noise_memory() const { return force_noise_memory_; }  // s
  [[nodiscard]] double jitter() const { return jitter_; }        // standard deviation, of a step
  [[nodiscard]] bool has_stamps() const { return has_stamps_; }  // recorded with the true times
  // Places that what is measured can't tell apart, by the kinds of same_system.hpp. A shaft is
  // stiff where the load's frequency on it is above six times the loop's bandwidth.
  [[nodiscard]] std::map<std::string, std::vector<std::string>> same_places() const;

  // model.yaml, as the user believes; numbers of one width.
  [[nodiscard]] std::string model_text() const;

 private:
  void draw_axis(Random& random);
  void draw_drive(Random& random);
  void draw_sensors(Random& random);
  void draw_controller(Random& random);
  void draw_plan(Random& random);
  void list_places();
  void add_parameter(const std::string& name, double value, Random& random);
  [[nodiscard]] double total_inertia() const;  // believed
  [[nodiscard]] std::string mass_name(Eigen::Index mass) const;

  Family family_;
  bool is_drive_, has_tachometer_;
  std::vector<DriveParameter>
      parameters_;  // masses, shaft, shaft damping, bearing: those there are
  std::vector<DriveOutput> outputs_;
  DriveController controller_;
  double bandwidth_ = 0.0;  // rad/s
  std::vector<PlannedMotion> plan_;
  std::vector<ChallengePlace> places_;
  double force_noise_share_ = 0.0, force_noise_memory_ = 0.0;
  double jitter_ = 0.0;
  bool has_stamps_ = false;
};

}  // namespace graybox::bench
