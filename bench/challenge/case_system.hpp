// CaseSystem: the system of one challenge case, twice: as the user believes it to be (the model
// file) and as it is (fitted parameters off by up to 20 %), with the experiments made on it.
//
// Families are the full robot (irb6600_like), a three-axis robot (three_axis), and lumped systems.
// These are a speed-controlled rotor (one_mass), a speed-controlled drive with an elastic shaft
// (two_mass), a mass on a mount, driven open-loop (oscillator), and a chain of three masses with
// two forces (chain). Everything of one family has the same plan, so that files of its cases have
// the same sizes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench/challenge/hidden_laws.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "problems/base/random.hpp"
#include "problems/elements/element.hpp"

namespace graybox::bench {

// Those of the set `any_motion` (bench/any_motion_challenge) follow: single axes with an encoder or
// a tachometer, two-mass drives with both encoders, that of the motor, or a tachometer alone.
enum class Family : std::int8_t {
  kRobot,
  kThreeAxis,
  kOneMass,
  kTwoMass,
  kOscillator,
  kChain,
  kAxisEncoder,
  kAxisTachometer,
  kDriveEncoders,
  kDriveMotorEncoder,
  kDriveTachometer
};
inline constexpr int kPeriodicFamilies = 6;
inline constexpr int kFamilies = 11;
[[nodiscard]] std::string_view to_string(Family family);
[[nodiscard]] std::optional<Family> family_named(std::string_view name);

// Names of the sets of cases.
inline constexpr std::string_view kPeriodicSet = "periodic";
inline constexpr std::string_view kAnyMotionSet = "any_motion";
[[nodiscard]] std::string_view set_of(Family family);

// n_u recordings that make up one frequency response.
struct ExperimentSet {
  std::size_t position = 0;
  std::size_t level = 0;
  std::size_t realisation = 0;
  bool validation = false;
};

struct ChallengePlan {
  double sample_time = 0.0;
  std::size_t period = 0, settling_periods = 0, periods = 0;  // samples, counts
  std::vector<std::size_t> lines;                             // excited
  std::vector<Eigen::VectorXd> positions;  // joint angles, degrees; one of size 0 without joints
  std::vector<double> levels;              // rms of the reference or, open-loop, the input
  std::vector<ExperimentSet> sets;
};

// M q'' + C q' + K q = B u, y = S_0 q + S_1 q' about rest, and what each fitted parameter, relative
// to its value, adds to M, C and K.
struct LinearDynamics {
  struct Derivative {
    Eigen::MatrixXd mass, damping, stiffness;  // empty: none
  };
  Eigen::MatrixXd mass, damping, stiffness, input, position_output, velocity_output;
  Eigen::VectorXd rest;
  std::vector<Derivative> derivatives;
};

struct ChallengePlace {
  Location location;
  unsigned kinds = 0;  // bits of PlaceKind
  bool turns = false;
  bool inertia_is_fitted = false;
  double spring = 0.0;  // stiffness of the true system's spring here
};

struct ChannelNames {
  std::vector<std::string> references, inputs, outputs;
  std::string input_unit;                 // of each input
  std::vector<std::string> output_units;  // also those of the references
};

class CaseSystem {
 public:
  virtual ~CaseSystem() = default;

  [[nodiscard]] const ChallengePlan& plan() const { return plan_; }
  [[nodiscard]] const ChannelNames& channels() const { return channels_; }
  [[nodiscard]] const std::vector<ChallengePlace>& places() const { return places_; }
  [[nodiscard]] const std::optional<PiController>& controller() const { return controller_; }
  [[nodiscard]] double noise_psd_slope() const { return noise_psd_slope_; }          // C_v
  [[nodiscard]] const Eigen::VectorXd& white_noise() const { return white_noise_; }  // or empty
  // True over believed value of each fitted parameter.
  [[nodiscard]] const std::vector<double>& parameter_factors() const { return factors_; }
  [[nodiscard]] const std::vector<std::string>& parameter_names() const { return parameter_names_; }
  [[nodiscard]] Eigen::Index input_count() const {
    return static_cast<Eigen::Index>(channels_.inputs.size());
  }
  [[nodiscard]] Eigen::Index output_count() const {
    return static_cast<Eigen::Index>(channels_.outputs.size());
  }

  // The true system with further elements at a position of the plan. Throws InputError where it has
  // no rest.
  [[nodiscard]] virtual std::unique_ptr<Plant> plant(const std::vector<Element>& elements,
                                                     std::size_t position) const = 0;
  // The true system without further elements.
  [[nodiscard]] virtual LinearDynamics linear(std::size_t position) const = 0;
  // model.yaml, as the user believes, and what it names.
  virtual void write_model(const std::filesystem::path& folder) const = 0;

 protected:
  void perturb(std::size_t parameters, Random& random);

  ChallengePlan plan_;
  ChannelNames channels_;
  std::vector<ChallengePlace> places_;
  std::optional<PiController> controller_;
  double noise_psd_slope_ = 0.0;
  Eigen::VectorXd white_noise_;
  std::vector<double> factors_;
  std::vector<std::string> parameter_names_;
};

// Draws the system, of the periodic set. The model files of the robots are those beside
// default_robot_file().
[[nodiscard]] std::unique_ptr<CaseSystem> draw_system(Family family, std::uint64_t seed);

// A seed of its own for each purpose.
[[nodiscard]] std::uint64_t derived_seed(std::uint64_t seed,
                                         std::initializer_list<std::uint64_t> place);

}  // namespace graybox::bench
