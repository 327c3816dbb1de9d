#include "diagnosis/second_looks/other_roles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

// Whether recordings were kept out of the fit, and all are few: a law may need them all to show.
bool are_few_with_some_kept_out(const Campaign& campaign) {
  constexpr std::size_t kFew = 5000;  // samples
  std::size_t samples = 0;
  for (std::size_t i = 0; i < campaign.experiments.size() && samples <= kFew; ++i) {
    samples += load_experiment(campaign, i).samples;
  }
  return samples <= kFew && std::ranges::count(campaign.experiments, ExperimentRole::kValidation,
                                               &Experiment::role) > 0;
}

// Whether those kept out are long enough to be searched by themselves.
bool can_be_searched_kept_out(const Campaign& campaign) {
  Eigen::Index windows = 0;
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    if (campaign.experiments[i].role != ExperimentRole::kValidation) continue;
    for (const SignalPiece& piece : load_experiment(campaign, i).data.pieces) {
      windows += whole_windows(piece.time.size(), kShortestHorizon);
    }
  }
  return windows >= kFewestHorizonWindows;
}

bool has_law_borne_out(const Diagnosis& diagnosis) {
  return std::ranges::any_of(diagnosis.effects, [](const FoundEffect& effect) {
    return !effect.held_out || !effect.held_out->misleads;
  });
}

// Whether a mass is not determined, and with it no force is.
bool has_loose_mass(const Diagnosis& diagnosis) {
  return std::ranges::any_of(diagnosis.implausible, [](const Implausibility& flaw) {
    return flaw.rule == PlausibilityRule::kZero &&
           (flaw.quantity.ends_with("inertia") || flaw.quantity.ends_with("mass"));
  });
}

// What the recordings of the fit lack that those kept out may have; empty: nothing.
std::string lack_of(const Diagnosis& diagnosis) {
  if (diagnosis.interrupted || !diagnosis.channel_faults.empty()) return "";
  const bool stands_in = std::ranges::any_of(diagnosis.implausible, [](const auto& flaw) {
    return flaw.rule == PlausibilityRule::kSize;  // beyond what was ever carried
  });
  if (diagnosis.verdict == Verdict::kUnknown && (stands_in || !has_law_borne_out(diagnosis))) {
    return "show no law that holds on those kept out";
  }
  const bool is_open = diagnosis.verdict != Verdict::kNone && has_loose_mass(diagnosis);
  return is_open ? "do not determine the mass that moves" : "";
}

// Whether laws were told, and none of them holds on the recordings kept out.
bool has_no_law_that_holds(const Diagnosis& diagnosis) {
  return diagnosis.verdict == Verdict::kUnknown && !diagnosis.interrupted &&
         diagnosis.channel_faults.empty() && diagnosis.validation_after.has_value() &&
         has_no_confirmed_law(diagnosis);
}

// Whether the recordings of the fit and those kept out ask for other sizes of the same laws. What
// both have in common may show in all of them.
bool asks_for_other_sizes(const Diagnosis& diagnosis) {
  return !diagnosis.interrupted && diagnosis.channel_faults.empty() &&
         diagnosis.verdict != Verdict::kNone && diagnosis.kept_out_change.has_value();
}

// Whether a machine's laws were found, and nothing is lacking any more.
bool is_found(const DiagnosisAnswer& answer) {
  const Diagnosis& diagnosis = answer.diagnosis;
  return lack_of(diagnosis).empty() && diagnosis.channel_faults.empty() && !diagnosis.interrupted &&
         !diagnosis.effects.empty() && is_of_a_machine(diagnosis) &&
         !has_signal_laws_only(diagnosis, answer.hypotheses());
}

// Whether the fit with laws leaves more of its recordings than the model as given.
bool leaves_more(const Diagnosis& diagnosis) {
  return diagnosis.after.estimation.nrmse > diagnosis.before.estimation.nrmse;
}

// A diagnosis once more with recordings in these roles; none where it finds nothing either.
CampaignLook look_with_roles(const MethodChoice& method, const DiagnosisRequest& request,
                             const Campaign& campaign,
                             const std::function<ExperimentRole(ExperimentRole)>& role) {
  Campaign changed = campaign;
  for (Experiment& experiment : changed.experiments) experiment.role = role(experiment.role);
  MethodAnswer found = answer_by(method, request, changed);
  CampaignLook look;
  look.was_stopped = found.answer.diagnosis.interrupted;
  if (is_found(found.answer) && !leaves_more(found.answer.diagnosis)) {
    look.answer = {std::move(changed), std::move(found)};
  }
  return look;
}

// The recordings of the fit and those kept out change places.
CampaignLook look_with_exchanged(const MethodChoice& method, const DiagnosisRequest& request,
                                 const Campaign& campaign, const std::string& lack) {
  const auto exchanged = [](ExperimentRole role) {
    if (role == ExperimentRole::kEstimation) return ExperimentRole::kValidation;
    return role == ExperimentRole::kValidation ? ExperimentRole::kEstimation : role;
  };
  CampaignLook look = look_with_roles(method, request, campaign, exchanged);
  if (!look.answer) return look;
  Diagnosis& diagnosis = look.answer->found.answer.diagnosis;
  if (diagnosis.verdict == Verdict::kUnknown || diagnosis.verdict == Verdict::kNone) {
    look.answer.reset();
    return look;
  }
  diagnosis.assumptions.push_back(
      fmt::format("The recordings of the fit {}. So the two changed places: those kept out were "
                  "fitted, and what they show was tested on the others.",
                  lack));
  return look;
}

// All recordings are fitted.
CampaignLook look_with_all(const MethodChoice& method, const DiagnosisRequest& request,
                           const Campaign& campaign, const std::string& lack) {
  const auto fitted = [](ExperimentRole role) {
    return role == ExperimentRole::kValidation ? ExperimentRole::kEstimation : role;
  };
  CampaignLook look = look_with_roles(method, request, campaign, fitted);
  if (!look.answer) return look;
  Diagnosis& diagnosis = look.answer->found.answer.diagnosis;
  diagnosis.assumptions.push_back(
      fmt::format("The recordings of the fit alone {}. So those kept out were fitted, too, and "
                  "nothing has tested what was found.",
                  lack));
  for (VerdictReason& reason : diagnosis.reasons) {
    if (reason.test != kKeptOutTest) continue;
    reason.next = "record more: these are too few to find a law in some and test it on the others";
  }
  return look;
}

std::set<std::pair<std::string, std::string>> laws_of(const DiagnosisAnswer& answer) {
  std::set<std::pair<std::string, std::string>> laws;
  for (const FoundEffect& effect : answer.diagnosis.effects) {
    const Hypothesis& hypothesis = answer.hypotheses()[effect.law.hypothesis];
    laws.emplace(hypothesis.law, hypothesis.place);
  }
  return laws;
}

// All recordings are fitted, and other laws found with one size for all: those answer if they leave
// less than what was found foretells of those kept out.
CampaignLook look_with_common_sizes(const MethodAnswer& first, const DiagnosisRequest& request,
                                    const Campaign& campaign) {
  CampaignLook all =
      look_with_all(first.method, request, campaign, "give other sizes than those kept out do");
  if (!all.answer) return all;
  const DiagnosisAnswer& answer = all.answer->found.answer;
  const double left = answer.diagnosis.after.estimation.nrmse;
  const bool is_new = laws_of(answer) != laws_of(first.answer) &&
                      left < first.answer.diagnosis.kept_out_change->error_predicted;
  if (!is_new) all.answer.reset();
  return all;
}

// All recordings are fitted, which must leave much less of them than was left of those kept out.
CampaignLook look_for_what_holds(const MethodAnswer& first, const DiagnosisRequest& request,
                                 const Campaign& campaign) {
  constexpr double kMuchLess = 0.6;
  CampaignLook all = look_with_all(first.method, request, campaign,
                                   "show no law that is confirmed on those kept out");
  if (!all.answer) return all;
  const double left = all.answer->found.answer.diagnosis.after.estimation.nrmse;
  if (!(left < kMuchLess * first.answer.diagnosis.validation_after->nrmse)) all.answer.reset();
  return all;
}

}  // namespace

CampaignLook look_at_other_roles(const MethodAnswer& first, const DiagnosisRequest& request,
                                 const Campaign& campaign) {
  const MethodChoice& method = first.method;
  const std::string lack = lack_of(first.answer.diagnosis);
  const bool is_changed = lack.empty() && asks_for_other_sizes(first.answer.diagnosis);
  const bool holds_nothing = lack.empty() && has_no_law_that_holds(first.answer.diagnosis);
  const bool is_asked = method.takes_any_motion() && (!lack.empty() || is_changed || holds_nothing);
  if (!is_asked || stop_requested() || !are_few_with_some_kept_out(campaign)) return {};
  if (holds_nothing) return look_for_what_holds(first, request, campaign);
  if (is_changed) return look_with_common_sizes(first, request, campaign);
  CampaignLook others;
  if (can_be_searched_kept_out(campaign)) {
    others = look_with_exchanged(method, request, campaign, lack);
  }
  if (others.was_stopped) return others;
  CampaignLook all = look_with_all(method, request, campaign, lack);
  if (all.was_stopped || !others.answer) return all;
  const bool are_the_same =
      all.answer && laws_of(all.answer->found.answer) == laws_of(others.answer->found.answer);
  return !all.answer || are_the_same ? std::move(others) : std::move(all);
}

}  // namespace graybox
