#include "diagnosis/runs/diagnosis_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/force_balance_data/measured_drive.hpp"
#include "diagnosis/hypotheses/fit_physics.hpp"
#include "diagnosis/load/load_mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/runs/answer_advice.hpp"
#include "diagnosis/runs/report_folder.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/next_plan.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "diagnosis/verdict/verdict_file.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/base/units.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "problems/laws/law_file.hpp"

namespace graybox {
namespace {

[[noreturn]] void refuse_law(const std::string& law) {
  throw InputError(fmt::format(
      "--without {}: no hypothesis has such a law; 'graybox simulate --laws' lists the laws", law));
}

void require_known_laws(const std::vector<std::string>& laws,
                        std::span<const Hypothesis> hypotheses) {
  for (const std::string& law : laws) {
    const auto names_it = [&](const Hypothesis& hypothesis) { return hypothesis.law == law; };
    if (std::none_of(hypotheses.begin(), hypotheses.end(), names_it)) refuse_law(law);
  }
}

// For a drive, whose two methods try different laws.
void require_laws_of_the_catalogue(const std::vector<std::string>& laws) {
  for (const std::string& law : laws) {
    if (find_law(law, false) == nullptr && find_law(law, true) == nullptr) refuse_law(law);
  }
}

// What every report may hold. Figures and plans have names of their own (report_folder.hpp).
const std::vector<std::string> kReportFiles{"report.html", "verdict.json", "model_extended.yaml",
                                            "physics.yaml"};

// What `graybox simulate` needs to carry out the next experiment.
void add_next_plans(const DiagnosisRequest& request, const Campaign& campaign,
                    const Diagnosis& diagnosis, std::map<std::string, std::string>& texts) {
  const NextQuestion question = next_question(diagnosis);
  if (question.rival == nullptr) return;
  const std::string format = YamlField::load(request.model).at("format").text();
  int number = 0;
  for (const std::string& motion : next_motions(*question.rival->next)) {
    texts[fmt::format("next_motion_{}.csv", ++number)] = motion;
  }
  if (number > 0) return;
  for (const std::string& plan :
       next_plans(*question.rival->next, campaign, format == "graybox-robot/1")) {
    texts[fmt::format("next_plan_{}.yaml", ++number)] = plan;
  }
}

// What a reader may save from the page.
ReportContext context_of(const std::map<std::string, std::string>& texts, PageOrigin origin) {
  ReportContext context{.origin = std::move(origin)};
  for (const auto& [name, text] : texts) {
    if (name.starts_with("next_plan_") || name.starts_with("next_motion_")) {
      context.plans.push_back({name, text, "the experiment to make"});
    } else if (name == "model_extended.yaml") {
      context.models.push_back({name, text, "the model with the laws found"});
    } else if (name == "physics.yaml") {
      context.models.push_back({name, text, "these laws alone, for --physics"});
    }
  }
  return context;
}

void write_report(const DiagnosisRequest& request, const Campaign& campaign,
                  const DiagnosedFiles& files, PageOrigin origin, ReportFolder& folder,
                  DiagnosisAnswer& answer) {
  std::map<std::string, std::string> texts;
  for (auto& [name, svg] : answer.figures()) texts["figures/" + name + ".svg"] = svg;
  if (answer.diagnosis.after.usable) {
    texts["model_extended.yaml"] =
        answer.extended_model(request.model, folder.file("model_extended.yaml"));
    texts["physics.yaml"] = physics_text(answer.diagnosis.after, answer.hypotheses());
  }
  add_next_plans(request, campaign, answer.diagnosis, texts);
  const ReportContext context = context_of(texts, std::move(origin));
  texts["report.html"] = report_page(answer.diagnosis, answer.hypotheses(), files, context);
  folder.write(texts, answer.verdict);
}

// Clipped, constant or jittering channels: a saturated sensor looks like missing physics, too.
// Files are added to `origin`. Those that there is no time to read are counted in a warning.
std::vector<std::string> warnings_of(const Campaign& campaign, PageOrigin& origin) {
  constexpr std::size_t kMost = 12;
  std::vector<std::string> warnings;
  CopyFinder copies;
  for (const Finding& finding : examine_campaign(campaign)) warnings.push_back(finding.message);
  std::size_t unread = 0;
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    const Experiment& experiment = campaign.experiments[i];
    origin.files.push_back({experiment.name, name_of(experiment.role)});
    if (stop_requested()) {
      ++unread;
      continue;
    }
    ExperimentRecording recording = load_experiment(campaign, i);
    copies.examine(experiment, recording);
    origin.files.back().samples = recording.samples;
    for (const Finding& finding : recording.findings) {  // of two parts of a file said once
      if (std::ranges::find(warnings, finding.message) != warnings.end()) continue;
      warnings.push_back(finding.message);
    }
  }
  if (warnings.size() > kMost) {
    const std::size_t more = warnings.size() - kMost;
    warnings.resize(kMost);
    warnings.push_back(
        fmt::format("{} more; 'graybox recordings {}' lists all", more, campaign.file.string()));
  }
  if (unread > 0) {
    warnings.push_back(fmt::format(
        "{} of {} were not looked at for faults: there was no time; 'graybox recordings "
        "{}' does",
        unread, campaign.experiments.size(), campaign.file.string()));
  }
  return warnings;
}

// Null where it was stopped before there was a problem to search in.
std::unique_ptr<MismatchProblem> load(const DiagnosisRequest& request, const Campaign& campaign,
                                      const RigidRobotModel* drive,
                                      const std::vector<std::size_t>& without_rotors = {}) {
  try {
    if (drive != nullptr) {
      return drive_balance_problem(*drive, campaign, {.threads = request.threads, .keep_going = [] {
                                                        return !stop_requested();
                                                      }});
    }
    return load_mismatch_problem(
        request.model, campaign,
        {.threads = request.threads,
         .keep_going = [] { return !stop_requested(); },
         .place_files = {request.place_files.begin(), request.place_files.end()},
         .without_rotors = without_rotors});
  } catch (const Stopped&) {
    return nullptr;
  }
}

Diagnosis stopped_before_the_search(const SearchOptions& options) {
  Diagnosis diagnosis;
  diagnosis.interrupted = true;
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  return diagnosis;
}

// What a diagnosis goes by, and why, in one line.
struct Method {
  std::string name;  // periodic, force_balance, prediction_error
  std::string reason;
  bool is_lumped = false;                // the model's format, which leaves a choice
  std::optional<RigidRobotModel> drive;  // a lumped model that is measured as a whole
};

// Why a lumped model and its recordings are none for harmonic balance; empty if they are.
std::string why_not_periodic(const LumpedModel& model, const Campaign& campaign) {
  const bool is_periodic = std::ranges::all_of(
      campaign.experiments,
      [](const Experiment& experiment) { return experiment.excitation.has_value(); });
  if (!is_periodic) return "the recordings have no period ('excitation')";
  if (campaign.hold != InputHold::kZero) {
    return "the inputs are not held between samples ('hold')";
  }
  const bool has_accelerations = std::ranges::any_of(model.outputs, [](const LumpedOutput& output) {
    return output.quantity == LumpedOutput::Quantity::kAcceleration;
  });
  return has_accelerations ? "accelerations are measured" : "";
}

// Whether no channel and no step but constants is an input: a run-down or a free swing.
bool records_no_force(const Campaign& campaign) {
  const auto is_input = [](const Channel& channel) { return channel.role == ChannelRole::kInput; };
  bool has_constant = false, has_other = std::ranges::any_of(campaign.channels, is_input);
  for (const PreprocessStep& step : campaign.preprocess) {
    std::visit(
        [&](const auto& each) {
          if constexpr (requires { each.role; }) {
            using Role = std::optional<ChannelRole>;
            if (Role(each.role) != Role(ChannelRole::kInput)) return;
            constexpr bool kIsConstant =
                std::is_same_v<std::decay_t<decltype(each)>, ConstantChannel>;
            (kIsConstant ? has_constant : has_other) = true;
          }
        },
        step);
  }
  return has_constant && !has_other;
}

Method chosen_method(const DiagnosisRequest& request, const Campaign& campaign) {
  const std::string format = YamlField::load(request.model).at("format").text();
  Method method{"", "it was asked for", format == "graybox-lumped/1", {}};
  std::optional<LumpedModel> lumped;
  if (method.is_lumped) {
    lumped = load_lumped_model(request.model);
    method.drive = measured_drive(*lumped);
  }
  if (request.method == "force_balance" && method.is_lumped && records_no_force(campaign)) {
    throw InputError(fmt::format(
        "--method force_balance: {} records no force (its inputs are constants), so there is no "
        "balance of forces: say --method prediction_error",
        campaign.file.string()));
  }
  if (request.method == "prediction_error" || (request.method == "force_balance" && method.drive)) {
    method.name = request.method;
    return method;
  }
  if (request.method == "force_balance" && method.is_lumped) {
    throw InputError(fmt::format(
        "--method force_balance: {} must be one mass whose only force and whose position or "
        "velocity are recorded, without laws other than viscous, stiffness and offset: leave these "
        "out, since they are looked for, or say prediction_error",
        request.model));
  }
  const bool is_rigid = format == "graybox-rigid-robot/1";
  method.name = is_rigid ? "force_balance" : "periodic";
  if (request.method != "auto" && request.method != method.name) {
    throw InputError(fmt::format("--method {}: {} is a {} model: say {}{}", request.method,
                                 request.model, format, method.name,
                                 method.is_lumped ? " or prediction_error" : ""));
  }
  if (request.method == "auto" && lumped) {
    const std::string why_not = why_not_periodic(*lumped, campaign);
    if (!why_not.empty()) {
      method.name = "prediction_error";
      method.reason = why_not;
    }
  }
  return method;
}

// Where a lumped model leaves a choice.
std::string method_line(const Method& method) {
  if (!method.is_lumped || method.name == "periodic") return "";
  const bool is_balance = method.name == "force_balance";
  return fmt::format("By {}, since {}.", is_balance ? "the balance of forces" : "prediction error",
                     method.reason);
}

DiagnosisAnswer answer_by_prediction(const DiagnosisRequest& request, const Campaign& campaign) {
  DiagnosisAnswer answer;
  answer.by_prediction =
      diagnose_by_prediction(request.model, campaign, request.search, request.threads);
  answer.diagnosis = answer.by_prediction.diagnosis;
  return answer;
}

// Diagnoses once more without rotor inertias that can't be seen, where nothing else is in doubt.
void leave_out_rotors(const DiagnosisRequest& request, const Campaign& campaign,
                      DiagnosisAnswer& answer) {
  const std::vector<std::size_t> rotors = rotors_to_leave_out(answer.diagnosis);
  if (rotors.empty() || stop_requested()) return;
  std::unique_ptr<MismatchProblem> problem = load(request, campaign, nullptr, rotors);
  if (!problem) return;
  Diagnosis diagnosis = diagnose(*problem, request.search);
  if (diagnosis.interrupted || diagnosis.verdict > answer.diagnosis.verdict) return;
  std::string names;
  for (const std::size_t j : rotors) {
    names += fmt::format("{}rotor_inertia_{}", names.empty() ? "" : ", ", j + 1);
  }
  diagnosis.assumptions.push_back(fmt::format(
      "{}: unknown in the model and not seen in these recordings, so left out.", names));
  answer.problem = std::move(problem);
  answer.diagnosis = std::move(diagnosis);
}

// What the balance leaves, in % of the force: on recordings kept out where there are any.
double error_of(const Diagnosis& diagnosis) {
  return diagnosis.validation_after ? diagnosis.validation_after->nrmse
                                    : diagnosis.after.estimation.nrmse;
}

// The damping of the drive's model that came out below zero beside dry friction; none: it did not.
std::optional<std::size_t> negative_damping(const RigidRobotModel& drive,
                                            const DiagnosisAnswer& answer) {
  constexpr std::array<std::string_view, 4> kDry{"coulomb", "asymmetric_coulomb", "stribeck",
                                                 "sublinear_friction"};
  const bool has_dry_friction =
      std::ranges::any_of(answer.diagnosis.after.laws, [&](const FittedLaw& law) {
        return std::ranges::count(kDry, answer.hypotheses()[law.hypothesis].law) > 0;
      });
  for (std::size_t i = 0; has_dry_friction && i < drive.elements.size(); ++i) {
    const bool is_negative =
        std::ranges::any_of(answer.diagnosis.implausible, [&](const Implausibility& flaw) {
          return flaw.value < 0.0 && flaw.quantity == drive.elements[i].name + ".damping";
        });
    if (is_negative && drive.elements[i].law_name == "viscous") return i;
  }
  return {};
}

void leave_out_element(RigidRobotModel& robot, std::size_t element) {
  robot.elements.erase(robot.elements.begin() + static_cast<std::ptrdiff_t>(element));
  for (std::vector<ElementParameter>* list : {&robot.known, &robot.refined}) {
    std::erase_if(*list, [&](const ElementParameter& each) { return each.element == element; });
    for (ElementParameter& each : *list) each.element -= each.element > element ? 1 : 0;
  }
}

// At about one speed damping and dry friction are one number, and the fit may split it into a
// damping below zero and a friction that is too large. Where the model does about as well without
// its damping, that is held at zero.
void leave_out_negative_damping(const DiagnosisRequest& request, const Campaign& campaign,
                                const RigidRobotModel& drive, DiagnosisAnswer& answer) {
  constexpr double kAsWell = 1.5, kSmall = 15.0;  // of the error; % of the force
  const std::optional<std::size_t> damping = negative_damping(drive, answer);
  if (!damping || stop_requested()) return;
  RigidRobotModel undamped = drive;
  const std::string name = drive.elements[*damping].name + ".damping";
  leave_out_element(undamped, *damping);
  std::unique_ptr<MismatchProblem> problem = load(request, campaign, &undamped);
  if (!problem) return;
  Diagnosis diagnosis = diagnose(*problem, request.search);
  const double before = error_of(answer.diagnosis), after = error_of(diagnosis);
  const bool does_as_well = after <= kAsWell * before && after <= std::max(kSmall, before);
  if (diagnosis.interrupted || diagnosis.effects.empty() || !does_as_well ||
      excluding(diagnosis.implausible) > 0) {
    return;
  }
  const auto keep = [&](const ExtendedFit& from, ExtendedFit& to, bool is_held) {
    for (LawParameterEstimate estimate : from.model_parameters) {
      if (estimate.name != name) continue;
      if (is_held) estimate.value = 0.0;
      estimate.standard_error = std::numeric_limits<double>::quiet_NaN();
      to.model_parameters.push_back(std::move(estimate));
    }
  };
  keep(answer.diagnosis.before, diagnosis.before, false);
  keep(answer.diagnosis.after, diagnosis.after, true);
  diagnosis.assumptions.push_back(fmt::format(
      "{} was held at zero: fitted, it comes out below zero beside dry friction. The error is "
      "{:.3g} % so, and {:.3g} % with it. At about one speed the two are one number.",
      name, after, before));
  answer.problem = std::move(problem);
  answer.diagnosis = std::move(diagnosis);
}

// `drive`, if not null: a lumped model as the force balance of its one mass.
DiagnosisAnswer answer_by_problem(DiagnosisRequest& request, const Campaign& campaign,
                                  const RigidRobotModel* drive = nullptr) {
  DiagnosisAnswer answer;
  answer.problem = load(request, campaign, drive);
  if (!answer.problem) {
    answer.diagnosis = stopped_before_the_search(request.search);
    return answer;
  }
  // Laws of signals, which the other method of a drive may leave out, are none of its balance.
  if (drive == nullptr) {
    require_known_laws(request.search.excluded_laws, answer.problem->hypotheses());
  }
  answer.diagnosis = diagnose(*answer.problem, request.search);
  leave_out_rotors(request, campaign, answer);
  if (drive != nullptr) leave_out_negative_damping(request, campaign, *drive, answer);
  return answer;
}

// Whether a friction is as large as the largest force that ever acted: it would have held the
// machine. At one level of drive and one speed it takes all, and nothing is left for an inertia.
bool is_all_friction(const DiagnosisAnswer& answer) {
  constexpr double kAll = 0.95;
  const FittedPhysics physics = fit_physics(*answer.problem, answer.diagnosis.after);
  return std::ranges::any_of(physics.quantities, [&](const PhysicalQuantity& quantity) {
    return quantity.kind == QuantityKind::kFriction && quantity.law < physics.laws.size() &&
           physics.laws[quantity.law].carried > 0.0 &&
           quantity.value > kAll * physics.laws[quantity.law].carried;
  });
}

// A second look that came to no end: what it would have found is not known.
void tell_stopped(Diagnosis& diagnosis) {
  VerdictReason reason;
  reason.test = "the search came to its end (a second look, after the first had ended)";
  reason.passed = false;
  reason.next = "give it more time (--time-limit) or more threads";
  reason.otherwise = Verdict::kUnknown;
  diagnosis.reasons.insert(diagnosis.reasons.begin(), std::move(reason));
  diagnosis.interrupted = true;
  diagnosis.verdict = Verdict::kUnknown;
}

// None where the balance finds nothing, or can't be set up: the drive stands still, say. Nor where
// positions were differentiated and no machine can be what came of it, unless the prediction error
// is farther from an answer still.
std::optional<DiagnosisAnswer> found_by_balance(const RigidRobotModel& drive,
                                                DiagnosisRequest& request, const Campaign& campaign,
                                                const DiagnosisAnswer& predicted, bool& was_stopped,
                                                std::optional<double>& left) {
  constexpr double kFar = 10.0;  // times the limit of a test
  try {
    DiagnosisAnswer answer = answer_by_problem(request, campaign, &drive);
    const Diagnosis& diagnosis = answer.diagnosis;
    if (!diagnosis.channel_faults.empty()) return answer;
    was_stopped = diagnosis.interrupted;
    if (!was_stopped) left = error_of(diagnosis);
    if (diagnosis.effects.empty()) return {};
    if (is_all_friction(answer)) return {};
    const double short_of = shortfall_of(predicted.diagnosis);
    const bool may_be = is_of_a_machine(diagnosis) || !drive.channels.velocity.empty();
    if (predicted.diagnosis.verdict != Verdict::kUnknown) return answer;  // another asks more
    const bool is_nearer = shortfall_of(diagnosis) < short_of;
    if (may_be && (!predicted.by_prediction.doubt.empty() || is_nearer)) return answer;
    if (is_nearer && short_of > kFar) return answer;
  } catch (const InputError&) {
  }
  return {};
}

// A drive that is counted the other way, or motion that is. Dry friction tells: turned, what a
// balance of forces then finds leaves less than half of the force that it leaves as recorded (all
// of it, where it can't be set up). Masses, springs and dampers alone leave as much either way.
std::optional<ChannelFault> reversed_drive(const RigidRobotModel& drive, DiagnosisRequest& request,
                                           const Campaign& campaign, std::optional<double> left,
                                           bool& was_stopped) {
  constexpr double kClearly = 0.5, kAll = 100.0, kWell = 50.0;  // of that error; % of the force
  Campaign turned = campaign;
  std::string name;
  for (Channel& channel : turned.channels) {
    if (channel.role != ChannelRole::kInput) continue;
    if (!name.empty()) return {};  // which of two?
    name = channel.name;
    channel.factor = -channel.factor;
  }
  try {
    const DiagnosisAnswer answer = answer_by_problem(request, turned, &drive);
    const Diagnosis& diagnosis = answer.diagnosis;
    was_stopped = diagnosis.interrupted;
    const bool is_found = !diagnosis.effects.empty() && diagnosis.channel_faults.empty() &&
                          !was_stopped && excluding(diagnosis.implausible) == 0 &&
                          !is_all_friction(answer);
    const double after = error_of(diagnosis), before = left.value_or(kAll);
    if (!is_found || !(after < kWell) || !(after < kClearly * before)) return {};
    ChannelFault fault;
    fault.channels = {name};
    fault.message = fmt::format(
        "{0} has the wrong sign, or the motion has: turned, a balance of forces with what it then "
        "finds leaves {1:.3g} % of the force instead of {2:.3g} % (preprocess: [{{kind: sign, of: "
        "[{0}]}}])",
        name, after, before);
    fault.measure = "force that the balance leaves over the force";
    fault.dissimilarity_before = before / kAll;
    fault.dissimilarity_after = after / kAll;
    return fault;
  } catch (const InputError&) {
    return {};
  }
}

// Nothing else is said of recordings that are not what the channels say.
void refuse(DiagnosisAnswer& answer, ChannelFault fault, const SearchOptions& options) {
  Diagnosis diagnosis;
  diagnosis.channel_faults = {std::move(fault)};
  diagnosis.channels_checked = true;
  diagnosis.trouble = "the recordings are not what the channels say";
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  answer.diagnosis = std::move(diagnosis);
}

// Whether what was foretold leaves more force than ever acted: the drive is not what moves it.
bool leaves_all_force(const Diagnosis& diagnosis) {
  constexpr double kAll = 100.0;  // % of the forces that act
  const std::optional<double> left = force_left(diagnosis);
  return diagnosis.verdict == Verdict::kUnknown && left && *left > kAll;
}

// A balance that tells forces where the prediction error tells late sensors and things that swing:
// what moves slowly is foretold nearly as well whatever pushes it. The balance answers where it is
// near an answer, and leaves about as little of the force.
std::optional<DiagnosisAnswer> found_for_signals(const RigidRobotModel& drive,
                                                 DiagnosisRequest& request,
                                                 const Campaign& campaign,
                                                 const DiagnosisAnswer& predicted,
                                                 bool& was_stopped) {
  constexpr double kAsMuch = 1.25;  // of the force that the prediction error leaves
  const std::optional<double> left = force_left(predicted.diagnosis);
  if (!left || !has_signal_laws_only(predicted.diagnosis, predicted.hypotheses())) return {};
  std::optional<double> unused;
  std::optional<DiagnosisAnswer> answer =
      found_by_balance(drive, request, campaign, predicted, was_stopped, unused);
  if (!answer || !answer->diagnosis.channel_faults.empty()) return {};
  const Diagnosis& found = answer->diagnosis;
  const bool is_near = found.verdict != Verdict::kUnknown && is_of_a_machine(found) &&
                       found.validation_after && found.validation_after->nrmse < kAsMuch * *left;
  if (!is_near) return {};
  return answer;
}

// Both methods come to an answer, and nobody knows which is right: the verdict of the balance is
// then `ambiguous` at best.
void weigh_against_prediction(const DiagnosisAnswer& predicted, Diagnosis& balanced) {
  std::string laws;
  for (const FoundEffect& effect : predicted.diagnosis.effects) {
    const Hypothesis& law = predicted.hypotheses()[effect.law.hypothesis];
    laws += fmt::format("{}{} at {}", laws.empty() ? "" : ", ", law.law, law.place);
  }
  VerdictReason reason;
  reason.test = fmt::format("a diagnosis by prediction error finds something else ({})",
                            laws.empty() ? "nothing" : laws);
  reason.passed = false;
  reason.otherwise = Verdict::kAmbiguous;
  reason.next =
      "look at its answer, too (--method prediction_error); larger and faster motion "
      "tells forces from late signals";
  balanced.reasons.push_back(std::move(reason));
  balanced.verdict = verdict_of(balanced.reasons);
}

// Why the balance answers, and not the prediction error.
std::string reason_for_balance(const DiagnosisAnswer& predicted) {
  if (predicted.diagnosis.verdict != Verdict::kUnknown) {
    return "a diagnosis by prediction error finds late signals alone, and leaves as much force";
  }
  const std::string& doubt = predicted.by_prediction.doubt;
  const auto failure = std::ranges::find_if(predicted.diagnosis.reasons, has_failed);
  return fmt::format("a diagnosis by prediction error is in doubt (failed: {})",
                     doubt.empty() ? failure->test : doubt);
}

// By the method chosen. Where the prediction error comes to no answer, and the drive is measured as
// a whole, its force balance is asked, too, and answers if it has found something.
DiagnosisAnswer answer_by(Method& method, DiagnosisRequest& request, const Campaign& campaign) {
  if (method.is_lumped && method.name != "periodic" && !request.place_files.empty()) {
    throw InputError("--places: a lumped model in any motion is diagnosed at its own places alone");
  }
  if (method.is_lumped && method.name != "periodic") {
    require_laws_of_the_catalogue(request.search.excluded_laws);
  }
  if (method.name != "prediction_error") {
    return answer_by_problem(
        request, campaign,
        method.name == "force_balance" && method.drive ? &*method.drive : nullptr);
  }
  DiagnosisAnswer predicted = answer_by_prediction(request, campaign);
  const Diagnosis& first = predicted.diagnosis;
  const bool is_over = first.interrupted || !first.channel_faults.empty();
  if (request.method != "auto" || is_over || !method.drive) return predicted;
  const bool has_answer = first.verdict != Verdict::kUnknown;
  bool was_stopped = false;
  std::optional<double> left;  // by the balance
  std::optional<DiagnosisAnswer> balanced =
      has_answer ? found_for_signals(*method.drive, request, campaign, predicted, was_stopped)
                 : found_by_balance(*method.drive, request, campaign, predicted, was_stopped, left);
  const bool is_absurd = balanced && excluding(balanced->diagnosis.implausible) > 0;
  const bool is_asked = is_absurd || (!balanced && leaves_all_force(first));
  if (is_asked && !request.search.ignore_channel_faults && !was_stopped) {
    if (auto fault = reversed_drive(*method.drive, request, campaign, left, was_stopped)) {
      refuse(predicted, *std::move(fault), request.search);
      return predicted;
    }
  }
  if (!balanced && was_stopped) tell_stopped(predicted.diagnosis);
  if (!balanced) return predicted;
  const bool may_be_right = predicted.by_prediction.doubt.empty() && !first.effects.empty();
  if (may_be_right) weigh_against_prediction(predicted, balanced->diagnosis);
  method.name = "force_balance";
  method.reason = reason_for_balance(predicted);
  return *std::move(balanced);
}

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

struct AnswerOfOthers {
  Method method;
  Campaign campaign;
  DiagnosisAnswer answer;
};

// A diagnosis once more with recordings in these roles; none where it finds nothing either.
std::optional<AnswerOfOthers> found_with_roles(
    const Method& method, DiagnosisRequest& request, const Campaign& campaign,
    const std::function<ExperimentRole(ExperimentRole)>& role, bool& was_stopped) {
  AnswerOfOthers others{method, campaign, {}};
  for (Experiment& experiment : others.campaign.experiments) {
    experiment.role = role(experiment.role);
  }
  others.answer = answer_by(others.method, request, others.campaign);
  const Diagnosis& diagnosis = others.answer.diagnosis;
  was_stopped = diagnosis.interrupted;
  const bool is_found = lack_of(diagnosis).empty() && diagnosis.channel_faults.empty() &&
                        !diagnosis.interrupted && !diagnosis.effects.empty() &&
                        is_of_a_machine(diagnosis) &&
                        !has_signal_laws_only(diagnosis, others.answer.hypotheses());
  if (!is_found) return {};
  return others;
}

// Which of two equal recordings is named first is chance. Where the first shows no law that holds
// on the other, they change places, and what the other shows is tested on the first.
std::optional<AnswerOfOthers> found_in_others(const Method& method, DiagnosisRequest& request,
                                              const Campaign& campaign, const std::string& lack,
                                              bool& was_stopped) {
  const auto exchanged = [](ExperimentRole role) {
    if (role == ExperimentRole::kEstimation) return ExperimentRole::kValidation;
    return role == ExperimentRole::kValidation ? ExperimentRole::kEstimation : role;
  };
  auto others = found_with_roles(method, request, campaign, exchanged, was_stopped);
  if (!others) return {};
  Diagnosis& diagnosis = others->answer.diagnosis;
  if (diagnosis.verdict == Verdict::kUnknown || diagnosis.verdict == Verdict::kNone) return {};
  diagnosis.assumptions.push_back(
      fmt::format("The recordings of the fit {}. So the two changed places: those kept out were "
                  "fitted, and what they show was tested on the others.",
                  lack));
  return others;
}

// A short log that is cut in two may show in neither part what it shows as a whole. Where no law
// was found that holds on both, or no mass, all recordings are fitted. Nothing is left to test what
// is found then, so its verdict is `ambiguous` at best.
std::optional<AnswerOfOthers> found_in_all(const Method& method, DiagnosisRequest& request,
                                           const Campaign& campaign, const std::string& lack,
                                           bool& was_stopped) {
  const auto fitted = [](ExperimentRole role) {
    return role == ExperimentRole::kValidation ? ExperimentRole::kEstimation : role;
  };
  auto all = found_with_roles(method, request, campaign, fitted, was_stopped);
  if (!all) return {};
  Diagnosis& diagnosis = all->answer.diagnosis;
  diagnosis.assumptions.push_back(
      fmt::format("The recordings of the fit alone {}. So those kept out were fitted, too, and "
                  "nothing has tested what was found.",
                  lack));
  for (VerdictReason& reason : diagnosis.reasons) {
    if (reason.test != kKeptOutTest) continue;
    reason.next = "record more: these are too few to find a law in some and test it on the others";
  }
  return all;
}

std::set<std::pair<std::string, std::string>> laws_of(const DiagnosisAnswer& answer) {
  std::set<std::pair<std::string, std::string>> laws;
  for (const FoundEffect& effect : answer.diagnosis.effects) {
    const Hypothesis& hypothesis = answer.hypotheses()[effect.law.hypothesis];
    laws.emplace(hypothesis.law, hypothesis.place);
  }
  return laws;
}

// What few recordings show where those of the fit alone do not. What those kept out show by
// themselves and all together do not is another law that happens to hold on the others.
std::optional<AnswerOfOthers> found_otherwise(const Method& method, DiagnosisRequest& request,
                                              const Campaign& campaign, const Diagnosis& first,
                                              bool& was_stopped) {
  const std::string lack = lack_of(first);
  const bool is_asked = method.is_lumped && method.name != "periodic" && !lack.empty();
  if (!is_asked || stop_requested() || !are_few_with_some_kept_out(campaign)) return {};
  auto others = found_in_others(method, request, campaign, lack, was_stopped);
  if (was_stopped) return {};
  auto all = found_in_all(method, request, campaign, lack, was_stopped);
  if (was_stopped || !others) return all;
  return !all || laws_of(all->answer) == laws_of(others->answer) ? std::move(others)
                                                                 : std::move(all);
}

// Drives of which one recorded unit stands for 1 N m or 1 N, because their gain is not known: a
// sentence for those in one unit, by the columns that the user knows.
void tell_unknown_gains(const Campaign& campaign, Diagnosis& diagnosis) {
  constexpr std::size_t kFew = 2;
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> columns;
  for (const Channel& channel : campaign.channels) {
    const Unit* recorded = find_unit(channel.recorded_unit);
    const bool is_converted = recorded != nullptr && recorded->base != channel.unit;
    if (channel.role != ChannelRole::kInput || !is_converted || channel.factor != 1.0) continue;
    columns[{channel.unit, channel.recorded_unit}].push_back(
        channel.column.empty() ? channel.name : channel.column);
  }
  for (const auto& [units, names] : columns) {
    const auto& [unit, recorded] = units;
    std::string of;
    for (std::size_t k = 0; k < std::min(kFew, names.size()); ++k) {
      of += (k == 0 ? "'" : ", '") + names[k] + "'";
    }
    if (names.size() > kFew) of += fmt::format(" and {} more", names.size() - kFew);
    diagnosis.assumptions.push_back(fmt::format(
        "Sizes are in units of the drive{}: 1 {} stands for one {} of {}. With {} true gain (gain: "
        "in campaign.yaml) masses and forces scale.",
        names.size() > 1 ? "s" : "", unit, recorded != "1" ? recorded : "recorded unit", of,
        names.size() > 1 ? "each" : "its"));
  }
}

// What a reader should know of the recordings.
std::vector<std::string> all_warnings(const DiagnosisAnswer& answer, const Method& method,
                                      const Campaign& campaign, PageOrigin& origin) {
  std::vector<std::string> warnings = warnings_of(campaign, origin);
  const bool has_load = std::ranges::any_of(
      campaign.experiments, [](const Experiment& each) { return !each.load.empty(); });
  if (method.is_lumped && has_load) {
    warnings.push_back(
        "load: models of masses know no loads, so all recordings were taken for one machine: "
        "state it as a robot of one joint (graybox-rigid-robot/1), or diagnose those with a load "
        "by themselves");
  }
  if (answer.problem) std::ranges::copy(answer.problem->remarks(), std::back_inserter(warnings));
  return warnings;
}

}  // namespace

std::vector<std::string> DiagnosisAnswer::words() const {
  return verdict_words(diagnosis, hypotheses());
}

std::map<std::string, std::string> DiagnosisAnswer::figures() const {
  std::map<std::string, std::string> figures;
  for (ReportFigure& figure : report_figures(diagnosis, hypotheses())) {
    figures[figure.name] = std::move(figure.svg);
  }
  return figures;
}

std::string DiagnosisAnswer::extended_model(const std::string& model,
                                            const std::filesystem::path& target) const {
  if (!diagnosis.after.usable) return {};
  return extended_model_text(model, target, diagnosis.after, hypotheses(), diagnosis.late_channels);
}

DiagnosisAnswer run_diagnosis(DiagnosisRequest request) {
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& file : request.law_files) add_law_file(file);
  Campaign campaign = read_campaign(request.campaign);
  std::optional<ReportFolder> folder;
  if (!request.report.empty()) folder.emplace(request.report, kReportFiles);
  if (request.begin) request.begin();
  request.search.proceed = [proceed = request.search.proceed](const std::string& step) {
    return (!proceed || proceed(step)) && !stop_requested();
  };
  Method method = chosen_method(request, campaign);
  DiagnosisAnswer answer = answer_by(method, request, campaign);
  bool was_stopped = false;
  if (auto all = found_otherwise(method, request, campaign, answer.diagnosis, was_stopped)) {
    method = std::move(all->method);
    campaign = std::move(all->campaign);
    answer = std::move(all->answer);
  } else if (was_stopped) {
    tell_stopped(answer.diagnosis);
  }
  tell_unknown_gains(campaign, answer.diagnosis);
  mark_first_springs(request.model, answer.hypotheses(), answer.diagnosis);
  advise_on_rivals(answer.hypotheses(), answer.diagnosis);
  tell_one_way_forces(answer.hypotheses(), answer.diagnosis);
  answer.method = method.name;
  answer.method_line = method_line(method);
  PageOrigin origin{.command = request.command,
                    .files = {{request.model, "model"}, {campaign.file.string(), "campaign"}}};
  answer.warnings = all_warnings(answer, method, campaign, origin);
  const DiagnosedFiles files{request.model, campaign.file.string(), answer.warnings};
  answer.verdict = verdict_json(answer.diagnosis, answer.hypotheses(), files);
  answer.verdict["method"] = method.name;
  origin.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (folder) write_report(request, campaign, files, std::move(origin), *folder, answer);
  return answer;
}

}  // namespace graybox
