#include "diagnosis/second_looks/late_drive.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/signals/drive_lateness.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr double kBetter = 0.6;  // of the error without moving it

bool leaves_something(const Diagnosis& diagnosis) {
  const bool is_settled =
      diagnosis.verdict == Verdict::kNone || diagnosis.verdict == Verdict::kExplained;
  return !is_settled && !diagnosis.interrupted && diagnosis.channel_faults.empty();
}

// The drive and its motion in the recordings of the fit; empty where one of them is not there.
std::vector<LoggedDrive> logs_of(const RigidRobotModel& drive, const Campaign& campaign,
                                 double& sample_time) {
  const bool is_velocity = drive.channels.position.empty();
  const auto& motions = is_velocity ? drive.channels.velocity : drive.channels.position;
  if (drive.channels.torque.size() != 1 || motions.size() != 1) return {};
  std::vector<LoggedDrive> logs;
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    if (campaign.experiments[i].role != ExperimentRole::kEstimation) continue;
    const ExperimentRecording run = load_experiment(campaign, i);
    if (!run.data.sample_time) return {};
    sample_time = *run.data.sample_time;
    const Eigen::Index force = run.index_of(drive.channels.torque.front()),
                       motion = run.index_of(motions.front());
    for (const SignalPiece& piece : run.data.pieces) {
      logs.push_back({piece.values.col(force), piece.values.col(motion), is_velocity});
    }
  }
  return logs;
}

double error_of(const Diagnosis& diagnosis) {
  return diagnosis.validation_after.value_or(diagnosis.after.estimation).nrmse;
}

// Where nothing is missing once the drive is in time, that it is late explains all.
void explain_by_lateness(Diagnosis& diagnosis) {
  diagnosis.verdict = Verdict::kExplained;
  std::erase_if(diagnosis.reasons, has_failed);
  VerdictReason reason;
  reason.test = "laws and late channels found";
  reason.value = reason.limit = 1.0;
  reason.is_lower_limit = true;
  diagnosis.reasons.insert(diagnosis.reasons.begin(), std::move(reason));
}

// Whether the answer with the drive in time is to be taken for the first one.
bool is_better(const MethodAnswer& moved, const MethodAnswer& first) {
  const Diagnosis &after = moved.answer.diagnosis, &before = first.answer.diagnosis;
  if (after.interrupted || !after.channel_faults.empty()) return false;
  if (moved.method.name != first.method.name) {  // their errors are of other things
    return after.verdict != Verdict::kUnknown && before.verdict == Verdict::kUnknown;
  }
  return error_of(after) < kBetter * error_of(before);
}

}  // namespace

CampaignLook look_at_late_drive(const MethodAnswer& first, const DiagnosisRequest& request,
                                const Campaign& campaign) {
  const MethodChoice& method = first.method;
  const bool is_asked = method.takes_any_motion() && method.drive && !stop_requested() &&
                        !request.search.ignore_channel_faults &&
                        leaves_something(first.answer.diagnosis);
  if (!is_asked) return {};
  double sample_time = 0.0;
  const std::vector<LoggedDrive> logs = logs_of(*method.drive, campaign, sample_time);
  const std::optional<Eigen::Index> samples = drive_lateness(logs);
  if (!samples) return {};
  const std::string& name = method.drive->channels.torque.front();
  const double late = static_cast<double>(*samples) * sample_time;
  Campaign changed = campaign;
  changed.preprocess.emplace_back(Advance{{name}, late});
  MethodAnswer found = answer_by(choose_method(request, changed), request, changed);
  CampaignLook look;
  look.was_stopped = found.answer.diagnosis.interrupted;
  if (!is_better(found, first)) return look;
  Diagnosis& diagnosis = found.answer.diagnosis;
  diagnosis.late_channels.push_back(
      {{name, late}, error_of(first.answer.diagnosis), error_of(diagnosis)});
  if (diagnosis.verdict == Verdict::kNone) explain_by_lateness(diagnosis);
  look.answer = {std::move(changed), std::move(found)};
  return look;
}

}  // namespace graybox
