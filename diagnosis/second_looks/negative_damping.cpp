#include "diagnosis/second_looks/negative_damping.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/requested_problem.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

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

// Whether the model does about as well without its damping.
bool does_as_well(const Diagnosis& without, double before) {
  constexpr double kAsWell = 1.5, kSmall = 15.0;  // of the error; % of the force
  const double after = error_of_balance(without);
  return !without.interrupted && !without.effects.empty() && after <= kAsWell * before &&
         after <= std::max(kSmall, before) && excluding(without.implausible) == 0;
}

// Lists the damping among the parameters, as if it had been fitted: without an error.
void keep_damping(const std::string& name, const ExtendedFit& from, bool is_held, ExtendedFit& to) {
  for (LawParameterEstimate estimate : from.model_parameters) {
    if (estimate.name != name) continue;
    if (is_held) estimate.value = 0.0;
    estimate.standard_error = std::numeric_limits<double>::quiet_NaN();
    to.model_parameters.push_back(std::move(estimate));
  }
}

}  // namespace

std::optional<DiagnosisAnswer> answer_without_negative_damping(const DiagnosisRequest& request,
                                                               const Campaign& campaign,
                                                               const RigidRobotModel& drive,
                                                               const DiagnosisAnswer& first) {
  const std::optional<std::size_t> damping = negative_damping(drive, first);
  if (!damping || stop_requested()) return {};
  RigidRobotModel undamped = drive;
  const std::string name = drive.elements[*damping].name + ".damping";
  leave_out_element(undamped, *damping);
  DiagnosisAnswer answer;
  answer.problem = requested_drive_problem(request, campaign, undamped);
  if (!answer.problem) return {};
  answer.diagnosis = diagnose(*answer.problem, request.search);
  Diagnosis& diagnosis = answer.diagnosis;
  const double before = error_of_balance(first.diagnosis), after = error_of_balance(diagnosis);
  if (!does_as_well(diagnosis, before)) return {};
  keep_damping(name, first.diagnosis.before, false, diagnosis.before);
  keep_damping(name, first.diagnosis.after, true, diagnosis.after);
  diagnosis.assumptions.push_back(fmt::format(
      "{} was held at zero: fitted, it comes out below zero beside dry friction. The error is "
      "{:.3g} % so, and {:.3g} % with it. At about one speed the two are one number.",
      name, after, before));
  return answer;
}

}  // namespace graybox
