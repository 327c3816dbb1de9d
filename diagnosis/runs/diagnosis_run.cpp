#include "diagnosis/runs/diagnosis_run.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/runs/answer_advice.hpp"
#include "diagnosis/runs/diagnosis_report.hpp"
#include "diagnosis/runs/recording_warnings.hpp"
#include "diagnosis/runs/report_folder.hpp"
#include "diagnosis/second_looks/answer_by_method.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/late_drive.hpp"
#include "diagnosis/second_looks/method_choice.hpp"
#include "diagnosis/second_looks/other_roles.hpp"
#include "diagnosis/verdict/verdict_file.hpp"
#include "problems/base/stop.hpp"
#include "problems/laws/law_file.hpp"

namespace graybox {
namespace {

// The search ends where its caller says so, and where the work is to stop.
void end_when_stopped(SearchOptions& search) {
  search.proceed = [proceed = search.proceed](const std::string& step) {
    return (!proceed || proceed(step)) && !stop_requested();
  };
}

// By the method chosen, with the drive in time, and in other roles, where the recordings ask for
// that.
CampaignAnswer answer_with_second_looks(const DiagnosisRequest& request, Campaign campaign) {
  MethodAnswer first = answer_by(choose_method(request, campaign), request, campaign);
  CampaignLook late = look_at_late_drive(first, request, campaign);
  if (late.answer) {
    campaign = std::move(late.answer->campaign);
    first = std::move(late.answer->found);
  }
  if (late.was_stopped) tell_stopped(first.answer.diagnosis);
  CampaignLook look = look_at_other_roles(first, request, campaign);
  if (look.answer) return *std::move(look.answer);
  if (look.was_stopped) tell_stopped(first.answer.diagnosis);
  return {std::move(campaign), std::move(first)};
}

// What a reader is told beside the laws found.
void advise(const DiagnosisRequest& request, const Campaign& campaign, DiagnosisAnswer& answer) {
  if (!estimates_drive_gains(request.model)) {
    answer.drive_unit = drive_unit_of(campaign);
    tell_unknown_gains(campaign, answer.diagnosis);
  }
  mark_first_springs(request.model, answer.hypotheses(), answer.diagnosis);
  require_confirmed_laws(answer.diagnosis);
  advise_on_rivals(answer.hypotheses(), answer.diagnosis);
  tell_one_way_forces(answer.hypotheses(), answer.diagnosis);
}

// Of the recordings, and of the problem that was made of them. Files are added to `origin`.
std::vector<std::string> all_warnings(MethodAnswer& found, const Campaign& campaign,
                                      PageOrigin& origin) {
  ExaminedRecordings examined = examine_recordings(campaign);
  tell_clipped_inputs(examined.clipped, found.answer.diagnosis);
  std::ranges::move(examined.files, std::back_inserter(origin.files));
  std::vector<std::string> warnings = std::move(examined.warnings);
  if (found.method.is_lumped) {
    std::ranges::copy(warnings_of_loads(campaign), std::back_inserter(warnings));
  }
  if (found.answer.problem) {
    std::ranges::copy(found.answer.problem->remarks(), std::back_inserter(warnings));
  }
  return warnings;
}

}  // namespace

DiagnosisAnswer run_diagnosis(DiagnosisRequest request) {
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& file : request.law_files) add_law_file(file);
  Campaign as_recorded = read_campaign(request.campaign);
  std::optional<ReportFolder> folder;
  if (!request.report.empty()) folder.emplace(request.report, report_file_names());
  if (request.begin) request.begin();
  end_when_stopped(request.search);
  auto [campaign, found] = answer_with_second_looks(request, std::move(as_recorded));
  DiagnosisAnswer& answer = found.answer;
  advise(request, campaign, answer);
  answer.method = found.method.name;
  answer.method_line = method_line(found.method);
  PageOrigin origin{.command = request.command,
                    .files = {{request.model, "model"}, {campaign.file.string(), "campaign"}}};
  answer.warnings = all_warnings(found, campaign, origin);
  const DiagnosedFiles files{request.model, campaign.file.string(), answer.warnings};
  answer.verdict = verdict_json(answer.diagnosis, answer.hypotheses(), files);
  answer.verdict["method"] = answer.method;
  if (!answer.drive_unit.empty()) {
    answer.verdict["drive_unit"] = answer.drive_unit;
    answer.verdict["words"] = answer.words();
  }
  origin.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (folder) write_report(request, campaign, files, std::move(origin), *folder, answer);
  return std::move(found.answer);
}

}  // namespace graybox
