// Two-mass drives in closed loop, simulated for diagnoses by prediction error: references that
// never repeat, rounded encoders, one law that the model does not have, the model's parameters 15 %
// off. Independent of the code under test: semi-implicit steps of a fortieth of a sample, friction
// that holds by itself.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace graybox {

struct DriveCase {
  std::string hidden;  // "coulomb at motor", or "nothing"
  bool both_encoders = true;
  unsigned seed = 1;
  double force_noise = 0.0;                 // N m rms, with a memory of 0.2 s, at the load
  double load_sign = 1.0, load_zero = 0.0;  // of the load's encoder
  double stated_stiffness = 1.0;            // of the model's shaft, times the true one
};

class SimulatedDrive {
 public:
  explicit SimulatedDrive(DriveCase drive) : case_(std::move(drive)), random_(case_.seed) {}

  // campaign.yaml, drive.yaml, run_1.csv, run_2.csv (kept out).
  void write(const std::filesystem::path& folder) {
    write_model(folder / "drive.yaml");
    write_campaign(folder / "campaign.yaml");
    write_run(folder / "run_1.csv", 3000);
    write_run(folder / "run_2.csv", 1500);
  }

 private:
  static constexpr double kSampleTime = 0.002, kMotor = 0.002, kLoad = 0.006, kStiffness = 60.0,
                          kDamping = 0.04, kBearing = 0.01;
  static constexpr int kSteps = 40;

  [[nodiscard]] bool hides(const char* law) const { return case_.hidden == law; }
  double normal() { return normal_(random_); }
  double off(double value) {
    return value * std::exp(std::uniform_real_distribution<double>(-0.15, 0.15)(random_));
  }

  void write_model(const std::filesystem::path& file) {
    std::ofstream out(file);
    out << fmt::format(
        "format: graybox-lumped/1\nsample_time: 0.002\nmotion: rotation\n"
        "masses: {{motor: {:.6g}, load: {:.6g}}}\nelements:\n"
        "  - {{name: shaft, location: {{kind: element, between: [motor, load]}}, law: stiffness, "
        "parameters: {{stiffness: {{value: {:.6g}, unit: N m/rad}}}}}}\n"
        "  - {{name: shaft_damping, location: {{kind: element, between: [motor, load]}}, law: "
        "viscous, parameters: {{damping: {{value: {:.6g}, unit: N m s/rad}}}}}}\n"
        "  - {{name: bearing, location: {{kind: element, mass: motor}}, law: viscous, parameters: "
        "{{damping: {{value: {:.6g}, unit: N m s/rad}}}}}}\n"
        "inputs:\n  - {{name: torque, mass: motor}}\noutputs:\n"
        "  - {{name: motor_angle, mass: motor, quantity: position}}\n{}",
        off(kMotor), off(kLoad), off(case_.stated_stiffness * kStiffness), off(kDamping),
        off(kBearing),
        case_.both_encoders ? "  - {name: load_angle, mass: load, quantity: position}\n" : "");
  }

  void write_campaign(const std::filesystem::path& file) const {
    std::ofstream out(file);
    out << "format: graybox-campaign/1\nsample_time: 0.002\nchannels:\n"
           "  - {name: torque, unit: N m, is: input}\n"
           "  - {name: motor_angle, unit: rad, is: output}\n";
    if (case_.both_encoders) out << "  - {name: load_angle, unit: rad, is: output}\n";
    out << "hold: zero\nexperiments:\n  - {file: run_1.csv}\n"
           "  - {file: run_2.csv, role: validation}\n";
  }

  std::vector<double> reference(int samples) {
    std::vector<double> r(static_cast<std::size_t>(samples), 0.0);
    std::uniform_int_distribution<int> move(100, 400), hold(20, 150);
    std::uniform_real_distribution<double> target(-1.5, 1.5);
    double from = 0.0;
    for (int k = 0; k < samples;) {
      const double to = target(random_);
      const int length = move(random_), rest = hold(random_);
      for (int i = 0; i < length + rest && k < samples; ++i, ++k) {
        const double s = std::min(1.0, static_cast<double>(i) / length);
        r[static_cast<std::size_t>(k)] = from + (to - from) * s * s * (3.0 - 2.0 * s);
      }
      from = to;
    }
    for (int k = 0; k < samples; ++k) {
      const double t = k * kSampleTime;
      r[static_cast<std::size_t>(k)] +=
          0.05 * std::sin(4.0 * std::numbers::pi * t * (1.0 + 3.0 * k / samples));
    }
    return r;
  }

  double actuator(double u, const std::vector<double>& commanded) const {
    const auto late = [&](std::size_t samples) {
      return commanded.size() > samples ? commanded[commanded.size() - 1 - samples] : 0.0;
    };
    if (hides("delay at actuator torque")) return late(2);
    if (hides("dead_zone at actuator torque")) {
      return std::copysign(std::max(std::abs(u) - 0.25, 0.0), u);
    }
    if (hides("saturation at actuator torque")) return std::clamp(u, -0.4, 0.4);
    return u;
  }

  [[nodiscard]] double shaft_force() const {
    const double z = x_[0] - x_[1];
    double force = kStiffness * z + kDamping * (v_[0] - v_[1]);
    if (hides("cubic_spring at motor-load")) force += 4e4 * z * z * z;
    if (hides("dead_zone at motor-load")) {
      force = kStiffness * std::copysign(std::max(std::abs(z) - 0.006, 0.0), z) +
              kDamping * (v_[0] - v_[1]);
    }
    return force;
  }

  static void brake(double impulse, double& v) {
    v = std::copysign(std::max(std::abs(v) - impulse, 0.0), v);
  }

  void step(double torque, double disturbance) {
    constexpr double h = kSampleTime / kSteps;
    if (hides("lag at actuator torque")) {
      lagged_ += (torque - lagged_) * (1.0 - std::exp(-h / 0.008));
      torque = lagged_;
    }
    const double shaft = shaft_force();
    double load = shaft + disturbance;
    if (hides("viscous at load")) load -= 0.04 * v_[1];
    if (hides("offset at load")) load -= 0.2;
    if (hides("ripple at load")) load -= 0.4 * std::sin(x_[1]);
    v_[0] += h * (torque - shaft - kBearing * v_[0]) / kMotor;
    v_[1] += h * load / kLoad;
    if (hides("coulomb at motor")) brake(h * 0.12 / kMotor, v_[0]);
    if (hides("coulomb at load")) brake(h * 0.12 / kLoad, v_[1]);
    x_[0] += h * v_[0];
    x_[1] += h * v_[1];
  }

  void write_run(const std::filesystem::path& file, int samples) {
    x_[0] = x_[1] = v_[0] = v_[1] = lagged_ = 0.0;
    const std::vector<double> wanted = reference(samples);
    std::vector<double> commanded, loads;
    double disturbance = 0.0;
    std::ofstream out(file);
    out << "torque,motor_angle,load_angle\n";
    const auto read = [&](double angle) {
      return std::round((angle + 5e-5 * normal()) / 1e-4) * 1e-4;
    };
    for (int k = 0; k < samples; ++k) {
      const double motor = read(x_[0]);
      loads.push_back(read(x_[1]));
      const bool is_late = hides("delay at sensor load_angle") && loads.size() > 3;
      const double load = is_late ? loads[loads.size() - 4] : loads.back();
      const double speed = v_[0] + 0.01 * normal();
      const double u = std::clamp(
          12.0 * (wanted[static_cast<std::size_t>(k)] - motor) - 0.35 * speed + 0.02 * normal(),
          -4.0, 4.0);
      commanded.push_back(u);
      out << fmt::format("{:.9g},{:.9g},{:.9g}\n", u, motor,
                         case_.load_zero + case_.load_sign * load);
      const double memory = std::exp(-kSampleTime / 0.2);
      disturbance =
          memory * disturbance + case_.force_noise * std::sqrt(1.0 - memory * memory) * normal();
      const double torque = actuator(u, commanded);
      for (int s = 0; s < kSteps; ++s) step(torque, disturbance);
    }
  }

  DriveCase case_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0.0, 1.0};
  double x_[2] = {0.0, 0.0}, v_[2] = {0.0, 0.0}, lagged_ = 0.0;
};

}  // namespace graybox
