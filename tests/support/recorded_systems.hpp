// Systems whose physics is known, recorded by simulation, and the models that are to be diagnosed
// with the recordings: a drive of two masses, and a robot of three axes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/base/error.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/two_mass_drive.hpp"

namespace graybox::testing {

inline const std::string kDrive = two_mass_drive("STIFFNESS", "0.03");

inline constexpr const char* kDrivePlan = R"(format: graybox-plan/1
levels: [0.1, 0.3]
realisations: 3
validation_realisations: 1
period: 500
settling_periods: 6
periods: 3
frequencies: {from: 1, to: 60, count: 40, spacing: log}
detection_lines: 4
)";

inline std::string drive(const std::string& stiffness, std::string text = kDrive) {
  return text.replace(text.find("STIFFNESS"), 9, stiffness);
}

inline std::string element(const std::string& location, const std::string& law,
                           const std::string& parameters) {
  return "format: graybox-physics/1\nelements:\n  - {name: hidden, location: " + location +
         ", law: " + law + ", parameters: {" + parameters + "}}\n";
}

// A campaign simulated with hidden physics and the model, 10 % off in its stiffness, to diagnose
// it.
class HiddenPhysics {
 public:
  explicit HiddenPhysics(const std::string& physics, std::uint64_t seed = 1, int threads = 1)
      : HiddenPhysics(physics, kDrive, seed, threads) {}

  HiddenPhysics(const std::string& physics, const std::string& model, std::uint64_t seed = 1,
                int threads = 1) {
    write_text(folder_.file("truth.yaml"), drive("30", model));
    write_text(folder_.file("model.yaml"), drive("33", model));
    write_text(folder_.file("plan.yaml"), kDrivePlan);
    std::optional<std::filesystem::path> hidden;
    if (!physics.empty()) {
      hidden = folder_.file("physics.yaml");
      write_text(*hidden, physics);
    }
    const SimulatedSystem system = load_system(folder_.file("truth.yaml"), hidden);
    SimulationOptions options;
    options.seed = seed;
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), options);
    problem_ = problem(threads);
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> problem(int threads) const {
    PeriodicMismatchOptions options;
    options.threads = threads;
    return periodic_mismatch_problem(folder_.file("model.yaml"),
                                     read_campaign(folder_.file("campaign")), options);
  }
  [[nodiscard]] const MismatchProblem& operator*() const { return *problem_; }
  [[nodiscard]] const MismatchProblem* operator->() const { return problem_.get(); }

  [[nodiscard]] std::vector<std::size_t> all() const {
    std::vector<std::size_t> indices(problem_->hypotheses().size());
    for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = i;
    return indices;
  }

  [[nodiscard]] std::size_t index_of(const std::string& place, const std::string& law) const {
    for (const std::size_t i : all()) {
      const Hypothesis& hypothesis = problem_->hypotheses()[i];
      if (hypothesis.place == place && hypothesis.law == law) return i;
    }
    throw InputError("no such hypothesis");
  }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<MismatchProblem> problem_;
};

// The whole robot of three axes moves far beyond its linear model; its stiffnesses are off by up to
// 15 %.
class RecordedRobot {
 public:
  // `hidden`: elements of a graybox-physics/1 file, or nothing.
  explicit RecordedRobot(const std::string& hidden, const std::string& positions = "[[20, 30, 40]]",
                         const std::string& noise = "1e-13") {
    const std::filesystem::path robot =
        std::filesystem::path(GRAYBOX_SOURCE_DIR) / "problems/robot/three_axis.yaml";
    write_text(folder_.file("plan.yaml"), R"(format: graybox-plan/1
plant: robot
levels: [2.0]
realisations: 2
validation_realisations: 1
period: 1000
settling_periods: 5
periods: 2
frequencies: {from: 2, to: 60, count: 20, spacing: log}
positions: )" + positions + "\nnoise: " + noise +
                                              "\n");
    std::optional<std::filesystem::path> physics;
    if (!hidden.empty()) {
      physics = folder_.file("hidden.yaml");
      write_text(*physics, "format: graybox-physics/1\nelements:\n" + hidden);
    }
    const SimulatedSystem system = load_system(robot, physics);
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), {});
    std::string text = read_text(robot.string());
    for (const auto& [nominal, changed] :
         {std::pair{"4.0e4", "3.5e4"}, {"5.0e4", "5.6e4"}, {"1.5e4", "1.4e4"}}) {
      text.replace(text.find(nominal), 5, changed);
    }
    write_text(folder_.file("model.yaml"), text);
    std::filesystem::copy(robot.parent_path() / "three_axis.urdf", folder_.file("three_axis.urdf"));
  }

  // Another model, or other words of what was recorded.
  void change(const std::string& file, const std::string& from, const std::string& to) const {
    std::string text = read_text(folder_.file(file));
    const std::size_t at = text.find(from);
    if (at == std::string::npos) throw InputError(from + " is not in " + text);
    write_text(folder_.file(file), text.replace(at, from.size(), to));
  }

  // The model with elements of its own, or none.
  [[nodiscard]] std::unique_ptr<MismatchProblem> problem(const std::string& elements = "") const {
    const std::string file = folder_.file("believed.yaml");
    std::string text = read_text(folder_.file("model.yaml"));
    if (!elements.empty()) text += "\nelements:\n" + elements;
    write_text(file, text);
    return periodic_mismatch_problem(file, read_campaign(folder_.file("campaign")));
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace graybox::testing
