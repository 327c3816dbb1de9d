#include "diagnosis/runs/proposed_files.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/load/load_mismatch_problem.hpp"
#include "diagnosis/prediction_error/prediction_search.hpp"
#include "diagnosis/prediction_error/search_start.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {
namespace {

// The folder, made if it is not there; taken away again if nothing comes into it.
class NewFolder {
 public:
  explicit NewFolder(const std::filesystem::path& folder) : folder_(folder) {
    std::error_code error;
    made_ = std::filesystem::create_directories(folder, error);
    if (error)
      throw InputError(fmt::format("{}: can't be made: {}", folder.string(), error.message()));
  }
  ~NewFolder() {
    std::error_code ignored;
    if (made_) std::filesystem::remove(folder_, ignored);  // not if there is a file in it
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

 private:
  std::filesystem::path folder_;
  bool made_ = false;
};

constexpr const char* kError = "error: ";

bool has_errors(const std::vector<std::string>& findings) {
  return !findings.empty() && findings.front().starts_with(kError);
}

// What reading the recordings by the new campaign finds, worst first.
std::vector<std::string> findings_of(const std::string& campaign_file) {
  std::vector<std::string> errors, warnings;
  const Campaign campaign = read_campaign(campaign_file);
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    for (const Finding& finding : examine_experiment(campaign, k).findings) {
      (finding.severity == Severity::kError ? errors : warnings).push_back(finding.message);
    }
  }
  const std::size_t count = warnings.size();
  warnings = errors;
  for (std::string& error : warnings) error.insert(0, kError);
  if (count > 0) {
    warnings.push_back(fmt::format("{} warnings; graybox recordings lists them", count));
  }
  return warnings;
}

// The model without rotors: unknown ones may take up what a wrong sign does.
std::string without_rotors(std::string text) {
  const std::string unknown = "rotor_inertia: unknown", none = "rotor_inertia: 0";
  for (std::size_t at = text.find(unknown); at != std::string::npos; at = text.find(unknown, at)) {
    text.replace(at, unknown.size(), none);
  }
  return text;
}

// Forces of a robot against which joints would gain energy by friction are reversed, as the
// diagnosis would have it. Says so among the guesses.
void reverse_forces(const std::filesystem::path& model, const std::filesystem::path& campaign,
                    ProposalRequest& request, ModelProposal& proposal) {
  std::ofstream(model) << without_rotors(proposal.model_text);
  const auto problem = load_mismatch_problem(model, read_campaign(campaign),
                                             {.keep_going = [] { return !stop_requested(); }});
  std::vector<ProposedGuess> guesses;
  for (const ChannelFault& fault : problem->channel_faults()) {
    const auto column = fault.channels.empty() ? proposal.columns.end()
                                               : proposal.columns.find(fault.channels.front());
    const bool is_sign = fault.message.find("has the wrong sign") != std::string::npos;
    if (!is_sign || !fault.rivals.empty() || column == proposal.columns.end()) {
      proposal.notes.push_back(fault.statement());
      continue;
    }
    request.reversed.push_back(column->second);
    guesses.push_back({"sign", fmt::format("'{}' times -1", column->second),
                       "by friction its joint would gain energy else"});
  }
  if (guesses.empty()) return;
  const std::vector<std::string> notes = proposal.notes;
  proposal = propose_model(request);
  proposal.notes = notes;
  proposal.guesses.insert(proposal.guesses.end(), guesses.begin(), guesses.end());
}

// Whether a diagnosis by prediction error has enough samples in these files: it would refuse them.
bool has_enough_samples(const std::filesystem::path& model, const std::filesystem::path& campaign) {
  try {
    const PredictionData data(load_lumped_model(model), read_campaign(campaign), 1);
    return data.window_count(kShortestHorizon) >= kFewestHorizonWindows;
  } catch (const InputError&) {
    return false;
  }
}

// Reads both files as a diagnosis does. Throws InputError where it would refuse them, however long
// the recordings are.
void read_as_diagnosis(const std::filesystem::path& model, const std::filesystem::path& campaign) {
  (void)PredictionData(load_lumped_model(model), read_campaign(campaign), 1);
}

// The first plan of which a diagnosis has enough samples; the one that was there where none has.
void leave_enough_samples(ProposalRequest& request, ModelProposal& proposal,
                          const std::filesystem::path& model,
                          const std::filesystem::path& campaign) {
  const auto write = [&](const ModelProposal& each) {
    std::ofstream(model) << each.model_text;
    std::ofstream(campaign) << each.campaign_text;
  };
  if (has_enough_samples(model, campaign)) return;
  const SplitPlan first = request.split;
  for (const SplitPlan plan :
       {SplitPlan::kWholeHalves, SplitPlan::kMostInFit, SplitPlan::kNoValidation}) {
    request.split = plan;
    ModelProposal other = propose_model(request);
    write(other);
    if (!has_enough_samples(model, campaign)) continue;
    proposal = std::move(other);
    return;
  }
  request.split = first;
  proposal.is_too_short = true;
  proposal.notes.push_back(
      "a diagnosis by prediction error needs more samples than these logs have, however they are "
      "split: record longer, or try graybox fit");
  write(proposal);
  read_as_diagnosis(model, campaign);
}

// The message with the name that the file would have had.
std::string with_name(std::string message, const std::string& temporary, const std::string& name) {
  for (std::size_t at = message.find(temporary); at != std::string::npos;
       at = message.find(temporary, at + name.size())) {
    message.replace(at, temporary.size(), name);
  }
  return message;
}

}  // namespace

void refuse_existing_proposal(const ProposalRequest& request) {
  for (const char* name : {"model.yaml", "campaign.yaml"}) {
    const std::filesystem::path file = request.folder / name;
    if (!std::filesystem::exists(file)) continue;
    throw InputError(fmt::format(
        "{}: is there already; choose another folder by -o, or say --overwrite", file.string()));
  }
}

std::vector<std::string> write_proposal(ProposalRequest& request, ModelProposal& proposal) {
  const NewFolder folder(request.folder);
  AtomicFile model((request.folder / "model.yaml").string());
  AtomicFile campaign((request.folder / "campaign.yaml").string());
  const auto write = [&] {
    std::ofstream(model.temporary()) << proposal.model_text;
    std::ofstream(campaign.temporary()) << proposal.campaign_text;
  };
  write();
  std::vector<std::string> findings;
  try {
    if (proposal.questions.empty()) findings = findings_of(campaign.temporary());
    if (has_errors(findings)) {
      throw InputError(findings.front().substr(std::string(kError).size()));
    }
    const bool is_sound = proposal.questions.empty();
    if (is_sound && request.machine == ProposedMachine::kRobot) {
      reverse_forces(model.temporary(), campaign.temporary(), request, proposal);
      write();
    } else if (is_sound && !proposal.model_text.empty()) {
      leave_enough_samples(request, proposal, model.temporary(), campaign.temporary());
      findings = findings_of(campaign.temporary());
    }
  } catch (const InputError& error) {
    const std::string name = (request.folder / "campaign.yaml").lexically_normal().string();
    const std::string other = (request.folder / "model.yaml").lexically_normal().string();
    throw InputError(
        with_name(with_name(error.what(), campaign.temporary(), name), model.temporary(), other));
  }
  model.commit();
  campaign.commit();
  return findings;
}

}  // namespace graybox
