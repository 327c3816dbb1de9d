#include "bench/any_motion_challenge/any_motion_case.hpp"

#include <fmt/format.h>

#include <iterator>

#include "bench/any_motion_challenge/any_motion_laws.hpp"
#include "bench/any_motion_challenge/drive_simulation.hpp"
#include "bench/challenge/make_challenge.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::bench {
namespace {

using Eigen::Index;

// Of one width, whichever it is.
const char* chosen(bool condition, const char* yes, const char* no) { return condition ? yes : no; }

std::string recording_text(const AnyMotionSystem& system, const DriveRecording& recording) {
  std::string text = "time,torque";
  for (const DriveOutput& output : system.outputs()) text += "," + output.name;
  text += "\n";
  for (Index k = 0; k < recording.input.size(); ++k) {
    const double time =
        system.has_stamps() ? recording.time(k) : static_cast<double>(k) * kAnyMotionSampleTime;
    fmt::format_to(std::back_inserter(text), "{:09.6f},{:+.7e}", time, recording.input(k));
    for (Index i = 0; i < recording.output.cols(); ++i) {
      fmt::format_to(std::back_inserter(text), ",{:+.8e}", recording.output(k, i));
    }
    text += "\n";
  }
  return text;
}

}  // namespace

std::string any_motion_campaign_text(const AnyMotionSystem& system) {
  std::string text = fmt::format(
      "format: graybox-campaign/1\nmodel: ../model.yaml\nsample_time: {}\nchannels:\n"
      "  - {{name: torque, unit: N m, is: input}}\n",
      chosen(system.has_stamps(), "irregular", "0.002    "));
  for (const DriveOutput& output : system.outputs()) {
    text += fmt::format("  - {{name: {}, unit: {}, is: output}}\n", output.name,
                        output.is_velocity ? "rad/s" : "rad");
  }
  text += "hold: zero\nnoise:\n";
  for (const DriveOutput& output : system.outputs()) {
    text += fmt::format("  {}: {:.4e}\n", output.name, output.deviation());
  }
  text += fmt::format("preprocess: {}\nexperiments:\n",
                      chosen(system.has_stamps(), "[{kind: resample, sample_time: 0.002}]",
                             "[]                                    "));
  for (std::size_t k = 0; k < system.plan().size(); ++k) {
    text += fmt::format("  - {{file: run_{}.csv, role: {}}}\n", k + 1,
                        system.plan()[k].validation ? "validation" : "estimation");
  }
  return text;
}

bool write_any_motion_case(const CaseTruth& truth, const std::filesystem::path& folder,
                           const std::function<bool()>& keep_going) {
  const AnyMotionSystem system(truth.family, truth.seed);
  const auto elements = elements_of(truth, system.places(), find_any_motion_law);
  return write_whole_folder(folder, [&](const std::filesystem::path& partial) {
    write_text_file((partial / "model.yaml").string(), system.model_text());
    const auto campaign = partial / "campaign";
    write_text_file((campaign / "campaign.yaml").string(), any_motion_campaign_text(system));
    for (std::size_t k = 0; k < system.plan().size(); ++k) {
      const auto quiet = simulate_drive(system, {}, k, truth.seed, nullptr, keep_going);
      const DriveNoise noise{system.force_noise_share() * root_mean_square(quiet.input),
                             derived_seed(truth.seed, {3, k})};
      const auto recording = simulate_drive(system, elements, k, truth.seed, &noise, keep_going);
      if (quiet.input.size() == 0 || recording.input.size() == 0) return false;
      write_text_file((campaign / fmt::format("run_{}.csv", k + 1)).string(),
                      recording_text(system, recording));
    }
    return true;
  });
}

}  // namespace graybox::bench
