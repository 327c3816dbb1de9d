// A campaign: which files hold which experiments, what their channels are, and what is done to the
// signals before anything is computed from them. Read from campaign.yaml
// (docs/how_to/recordings.md has every field, and preprocess.md every step of `preprocess`):
//
//   format: graybox-campaign/1
//   sample_time: 0.001                       # s, or irregular, or unknown
//   channels:
//     - {name: torque, unit: A, gain: {value: 0.12, unit: N m/A}, is: input}
//     - {name: speed, unit: rpm, is: output}
//   experiments:
//     - {file: run_1.csv}
//     - {file: run_2.csv, role: validation}
//
//   const Campaign campaign = read_campaign("folder");           // folder/campaign.yaml
//   const ExperimentRecording run = load_experiment(campaign, 0);  // experiment_recording.hpp
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace graybox {

enum class ChannelRole { kInput, kOutput, kReference, kOther };
enum class InputHold { kZero, kFirst, kBandLimited };
enum class ExperimentRole { kEstimation, kValidation };

[[nodiscard]] const char* name_of(ChannelRole role);
[[nodiscard]] const char* name_of(ExperimentRole role);

// A column of a file and how its numbers become the channel: value = factor * recorded, in `unit`.
struct Channel {
  std::string name;
  ChannelRole role = ChannelRole::kOther;
  std::string recorded_unit;  // as in the file
  std::string unit;           // base unit (units.hpp), after the gain
  double factor = 1.0;
  std::string column;                              // in the file; the name unless stated
  std::string file;                                // key of the experiment's `files`, or empty
  std::optional<std::pair<double, double>> range;  // of the sensor or actuator, recorded unit
  double noise = 0.0;                              // standard deviation in `unit`; 0: not known

  // A whole turn in the recorded unit; 0 of what has no turns.
  [[nodiscard]] double turn() const;
};

struct TimeColumn {
  std::string column = "time";  // empty: the recorded times are ignored
  double factor = 1.0;          // to seconds
  bool required = false;        // stated in the campaign, so it must be there
  bool has_unit = false;        // stated in the campaign; else the file's own counts, if it has one
  // s: rows that follow a row within it, or with its time where it is 0, are the same sample,
  // written again, and left out (irregular only); below 0: no row is.
  double burst = -1.0;
};

// Zero phase: a Butterworth filter of this order runs forward and backward (preprocess.hpp).
struct LowPass {
  double frequency;  // Hz, where one pass has -3 dB
  int order;
  std::vector<std::string> channels;
};
struct Decimate {
  std::size_t factor;
};
struct Derivative {
  std::vector<std::string> of;
  std::vector<std::string> names;
  std::optional<ChannelRole> role;
  bool band_limited = false;  // else by the parabola through neighbours
};
// Motor angles = matrix * arm angles, so arm torques = matrix' * motor torques. A matrix of gear
// ratios alone is diagonal; ratios may be negative, rows may couple axes.
struct Transmission {
  Eigen::MatrixXd matrix;
  bool to_arm;  // else to the motors
  std::vector<std::string> of;
  std::vector<std::string> names;
  std::optional<ChannelRole> role;
};
struct Trim {
  double time;  // s, at either end of each piece
};
// These three mend numbers as they were recorded, before units and gains: they come first.
// Samples of `channel` that are not numbers or outside lowest to highest are missing. What is
// missing in one channel is missing in all: pieces are cut there.
struct ValidSamples {
  std::vector<std::string> channels;
  double lowest, highest;  // recorded unit
};
// Whole periods are added so that no step is longer than half a period.
struct Unwrap {
  std::vector<std::string> channels;
  double period;  // recorded unit
};

struct Resample {
  double sample_time;  // s
};
struct Scale {
  std::vector<std::string> channels;
  double factor;
};
// The channel is late by this time: its value of then is taken for now.
struct Advance {
  std::vector<std::string> channels;
  double time;  // s
};
struct Integral {
  std::vector<std::string> of;
  std::vector<std::string> names;
  std::optional<ChannelRole> role;
};
struct Product {
  std::vector<std::string> of;  // at least two
  std::string name;
  std::string unit;  // base unit
  std::optional<ChannelRole> role;
};
struct WeightedSum {
  std::vector<std::string> of;
  std::vector<double> weights;
  std::string name;
  std::string unit;  // base unit, which the weights lead to; empty: that of the channels
  std::optional<ChannelRole> role;
};
// One value throughout, as the force on a machine that nothing drives.
struct ConstantChannel {
  std::string name;
  double value;      // in `unit`
  std::string unit;  // base unit
  ChannelRole role;
};
// torque = torque_constant (voltage - back_emf speed) / resistance
struct MotorTorque {
  std::string voltage, speed;
  double torque_constant, back_emf, resistance;  // N m/A, V s/rad, ohm
  std::string name;
  ChannelRole role = ChannelRole::kInput;
};
using PreprocessStep =
    std::variant<LowPass, Decimate, Derivative, Transmission, Trim, ValidSamples, Unwrap, Resample,
                 Scale, Advance, Integral, Product, WeightedSum, MotorTorque, ConstantChannel>;

// Whether a step mends recorded numbers, before units and gains.
[[nodiscard]] bool mends_recorded(const PreprocessStep& step);

struct PeriodicExcitation {
  std::size_t period;              // samples
  std::size_t periods;             // recorded
  std::vector<std::size_t> lines;  // excited DFT lines of one period
};

// Samples first to last, both included, counted from 0 in the file.
struct Segment {
  std::size_t first;
  std::size_t last;
};

struct Experiment {
  std::string name;                                    // of its file, for messages
  std::map<std::string, std::filesystem::path> files;  // by key; one file has the key ""
  std::vector<double> position;                        // degrees
  double level = 0.0;                                  // rms of the reference; 0: not stated
  std::size_t realisation = 1;
  std::size_t sub_experiment = 1;
  std::optional<PeriodicExcitation> excitation;
  std::vector<Segment> segments;  // all samples if empty
  std::size_t every = 1,
              from = 0;  // of a segment's samples: from, from + every, ... (irregular only)
  ExperimentRole role = ExperimentRole::kEstimation;
  std::string load = {};  // what the machine carries, by a name of one's own; empty: not stated
};

struct Campaign {
  std::filesystem::path file;
  std::string model;                  // empty if none is named
  std::optional<double> sample_time;  // s; none: irregular, the times are in the files
  bool sample_time_known = true;      // false: it counts as 1 s, so that "s" stands for a sample
  std::vector<Channel> channels;
  TimeColumn time;
  InputHold hold = InputHold::kZero;
  bool mends_faulty_samples = true;  // fault_mending.hpp
  std::vector<PreprocessStep> preprocess;
  std::vector<Experiment> experiments;
};

// `path` is the file or its folder. ${NAME} in a data file's name is the environment variable.
// Throws InputError with one line (file, line, field, what is wrong and what to write) for a
// missing file, an unknown field or unit, an unknown channel, and data files that are not there.
[[nodiscard]] Campaign read_campaign(const std::filesystem::path& path);

}  // namespace graybox
