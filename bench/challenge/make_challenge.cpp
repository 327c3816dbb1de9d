#include "bench/challenge/make_challenge.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <fstream>
#include <iterator>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "bench/challenge/case_draw.hpp"
#include "bench/challenge/case_experiment.hpp"
#include "diagnosis/simulation/recording_writer.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/folder_lock.hpp"
#include "problems/files/json_file.hpp"
#include "problems/files/temporary_name.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::mutex& writing() {  // HDF5 is not safe among threads
  static std::mutex mutex;
  return mutex;
}

std::string recording_name(const ExperimentSet& set, Eigen::Index sub_experiment) {
  return fmt::format("p{}_l{}_r{}_e{}.h5", set.position + 1, set.level + 1, set.realisation + 1,
                     sub_experiment + 1);
}

void add_channels(std::vector<RecordedChannel>& channels, const std::vector<std::string>& names,
                  const std::vector<std::string>& units, const Eigen::MatrixXd& rows) {
  for (std::size_t k = 0; k < names.size(); ++k) {
    channels.push_back({names[k], units[k], rows.row(static_cast<Eigen::Index>(k)).transpose()});
  }
}

void write_case_recording(const CaseSystem& system, const Recording& recording,
                          const fs::path& file) {
  const ChannelNames& names = system.channels();
  std::vector<RecordedChannel> channels;
  add_channels(channels, names.references, names.output_units, recording.reference);
  add_channels(channels, names.inputs,
               std::vector<std::string>(names.inputs.size(), names.input_unit), recording.input);
  add_channels(channels, names.outputs, names.output_units, recording.output);
  const std::scoped_lock lock(writing());
  write_recording(file, system.plan().sample_time, channels);
}

// ---- campaign.yaml: numbers of fixed width, so that its size tells nothing ----------------------

void append_channels(std::string& text, const std::vector<std::string>& names,
                     const std::vector<std::string>& units, const char* is) {
  for (std::size_t k = 0; k < names.size(); ++k) {
    text += fmt::format("  - {{name: {}, unit: {}, is: {}}}\n", names[k], units[k], is);
  }
}

double noise_deviation(const CaseSystem& system, std::size_t output) {
  const double white = system.white_noise().size() > 0
                           ? system.white_noise()(static_cast<Eigen::Index>(output))
                           : 0.0;
  return std::hypot(std::sqrt(2.0 * system.noise_psd_slope()) / system.plan().sample_time, white);
}

std::string position_text(const Eigen::VectorXd& position) {
  std::vector<std::string> angles;
  for (const double angle : position) angles.push_back(fmt::format("{:6.1f}", angle));
  return fmt::format("    position: [{}]\n", fmt::join(angles, ", "));
}

std::string campaign_text(const CaseSystem& system) {
  const ChallengePlan& plan = system.plan();
  const ChannelNames& names = system.channels();
  std::string text =
      fmt::format("format: graybox-campaign/1\nmodel: ../model.yaml\nsample_time: {}\nchannels:\n",
                  plan.sample_time);
  append_channels(text, names.inputs,
                  std::vector<std::string>(names.inputs.size(), names.input_unit), "input");
  append_channels(text, names.outputs, names.output_units, "output");
  append_channels(text, names.references, names.output_units, "reference");
  text += "hold: zero\nnoise:\n";
  for (std::size_t k = 0; k < names.outputs.size(); ++k) {
    text += fmt::format("  {}: {:.6e}\n", names.outputs[k], noise_deviation(system, k));
  }
  text += "preprocess: []\nexperiments:\n";
  for (const ExperimentSet& set : plan.sets) {
    for (Eigen::Index e = 0; e < system.input_count(); ++e) {
      text += fmt::format("  - file: {}\n", recording_name(set, e));
      const Eigen::VectorXd& position = plan.positions[set.position];
      if (position.size() > 0) text += position_text(position);
      text += fmt::format(
          "    level: {:.6e}\n    realisation: {}\n    sub_experiment: {}\n"
          "    excitation: {{period: {}, periods: {}, lines: [{}]}}\n    segments: []\n"
          "    role: {}\n",
          plan.levels[set.level], set.realisation + 1, e + 1, plan.period, plan.periods,
          fmt::join(plan.lines, ", "), set.validation ? "validation" : "estimation");
    }
  }
  return text;
}

// ---- folders ------------------------------------------------------------------------------------

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(fmt::format("{}: can't be made: {}", folder.string(), error.message()));
  }
}

// One age for all, so that it tells nothing.
void make_ageless(const fs::path& path) {
  const std::chrono::sys_seconds day = std::chrono::sys_days{std::chrono::year{2000} / 1 / 1};
  const auto age = std::chrono::file_clock::from_sys(day);
  std::error_code ignored;
  fs::last_write_time(path, age, ignored);
}

void make_all_ageless(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) make_ageless(entry.path());
  make_ageless(folder);
}

bool lies_within(const fs::path& inner, const fs::path& outer) {
  const fs::path a = fs::weakly_canonical(fs::absolute(inner));
  const fs::path b = fs::weakly_canonical(fs::absolute(outer));
  return std::mismatch(b.begin(), b.end(), a.begin(), a.end()).first == b.end();
}

void require_apart(const MakeOptions& options) {
  if (lies_within(options.truth, options.cases) || lies_within(options.cases, options.truth)) {
    throw InputError("challenge make: --truth and -o must not lie in each other");
  }
}

// Nothing but what a run in the making leaves that is killed.
bool holds_nothing(const fs::path& folder) {
  return std::ranges::all_of(fs::directory_iterator(folder), [](const fs::directory_entry& entry) {
    return is_temporary_name(entry.path().filename().string());
  });
}

// The truth's folder is of this challenge, or becomes so.
void claim_folders(const MakeOptions& options) {
  const Json stamp{{"format", "graybox-challenge-plan/1"}, {"set", options.origin.set},
                   {"seed", options.origin.seed},          {"commit", options.origin.commit},
                   {"cases", options.origin.cases},        {"family", options.origin.family}};
  const fs::path file = options.truth / "plan.json";
  if (std::ifstream stream(file); stream) {
    if (Json::parse(stream, nullptr, false) == stamp) return;
    throw InputError(fmt::format("{}: holds the truth of another challenge; choose another folder",
                                 options.truth.string()));
  }
  for (const fs::path& folder : {options.truth, options.cases}) {
    if (!holds_nothing(folder)) {
      throw InputError(fmt::format("{}: is not empty; choose another folder", folder.string()));
    }
  }
  write_text_file(file.string(), stamp.dump(2) + "\n");
}

CaseTruth read_truth(const fs::path& file) {
  return truth_from_json(read_json_file<Json>(file.string()), file.string());
}

// ---- the two rounds: truths, then recordings ----------------------------------------------------

class Rounds {
 public:
  explicit Rounds(const MakeOptions& options)
      : options_(&options),
        outlines_(options.set->compose(options.origin.cases, options.origin.seed,
                                       family_named(options.origin.family))) {}

  // False where asked to stop.
  bool draw() {
    return for_each([&](const CaseOutline& outline) {
      const fs::path file = truth_file(options_->truth, outline.name);
      if (fs::exists(file)) return;
      const CaseTruth truth = options_->set->draw(outline, options_->keep_going);
      if (truth.name.empty()) {
        stopped_ = true;
        return;
      }
      write_text_file(file.string(), to_json(truth).dump(2) + "\n");
    });
  }

  std::string seal() {
    std::vector<std::string> names;
    for (const CaseOutline& outline : outlines_) names.push_back(outline.name);
    const std::string sha256 = seal_truth(options_->truth, options_->origin, names);
    make_folder(options_->cases);
    write_header(options_->cases, {outlines_.size(), sha256, options_->origin.set});
    return sha256;
  }

  bool record() {
    const bool complete = for_each([&](const CaseOutline& outline) {
      const fs::path folder = options_->cases / outline.name;
      if (fs::exists(folder)) return;
      if (!options_->set->write(read_truth(truth_file(options_->truth, outline.name)), folder,
                                options_->keep_going)) {
        stopped_ = true;
      }
    });
    if (complete) make_all_ageless(options_->cases);
    return complete;
  }

 private:
  // The next case goes to the next thread that is free.
  template <typename Work>
  bool for_each(const Work& work) {
    std::atomic<std::size_t> next = 0;
    const auto take_cases = [&] {
      for (std::size_t k = next++; k < outlines_.size() && !stopped_; k = next++) {
        take_case(work, outlines_[k]);
      }
    };
    {
      std::vector<std::jthread> others;
      for (int t = 1; t < options_->threads; ++t) others.emplace_back(take_cases);
      take_cases();
    }
    if (failure_) std::rethrow_exception(failure_);
    return !stopped_;
  }

  template <typename Work>
  void take_case(const Work& work, const CaseOutline& outline) {
    if (options_->keep_going && !options_->keep_going()) {
      stopped_ = true;
      return;
    }
    try {
      work(outline);
    } catch (...) {
      const std::scoped_lock lock(guard_);
      if (!failure_) failure_ = std::current_exception();
      stopped_ = true;
    }
    const std::scoped_lock lock(guard_);
    if (!stopped_ && options_->report) options_->report(++done_, 2 * outlines_.size());
  }

  const MakeOptions* options_;
  std::vector<CaseOutline> outlines_;
  std::atomic<bool> stopped_ = false;
  std::mutex guard_;  // of the two below
  std::exception_ptr failure_;
  std::size_t done_ = 0;
};

}  // namespace

bool write_whole_folder(const fs::path& folder, const std::function<bool(const fs::path&)>& fill) {
  const fs::path partial =
      folder.parent_path() / fmt::format(".{}.partial", folder.filename().string());
  std::error_code ignored;
  fs::remove_all(partial, ignored);
  make_folder(partial / "campaign");
  if (!fill(partial)) {
    fs::remove_all(partial, ignored);
    return false;
  }
  fs::rename(partial, folder);
  return true;
}

bool write_case(const CaseTruth& truth, const fs::path& folder,
                const std::function<bool()>& keep_going) {
  const auto system = draw_system(truth.family, truth.seed);
  const std::vector<Element> elements = elements_of(truth, system->places());
  return write_whole_folder(folder, [&](const fs::path& partial) {
    system->write_model(partial);
    write_text_file((partial / "campaign" / "campaign.yaml").string(), campaign_text(*system));
    for (const ExperimentSet& set : system->plan().sets) {
      for (Eigen::Index e = 0; e < system->input_count(); ++e) {
        const Recording recording =
            simulate_experiment(*system, elements, set, e, true, truth.seed, keep_going);
        if (recording.output.size() == 0) return false;
        write_case_recording(*system, recording, partial / "campaign" / recording_name(set, e));
      }
    }
    return true;
  });
}

MakeOutcome make_challenge(const MakeOptions& options) {
  require_apart(options);
  const FolderLock truth_lock(options.truth), cases_lock(options.cases);
  claim_folders(options);
  Rounds rounds(options);
  MakeOutcome outcome{options.origin.cases, false, {}};
  if (!rounds.draw()) return outcome;
  outcome.truth_sha256 = rounds.seal();
  outcome.complete = rounds.record();
  return outcome;
}

}  // namespace graybox::bench
