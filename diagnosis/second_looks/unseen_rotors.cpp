#include "diagnosis/second_looks/unseen_rotors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/second_looks/requested_problem.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

constexpr std::string_view kName = "rotor_inertia_";

// Their names in the model, one after the other.
std::string names_of(const std::vector<std::size_t>& rotors) {
  std::string names;
  for (const std::size_t j : rotors) {
    names += fmt::format("{}rotor_inertia_{}", names.empty() ? "" : ", ", j + 1);
  }
  return names;
}

bool is_of_rotor(const Implausibility& flaw) { return flaw.quantity.starts_with(kName); }

std::size_t joint_of(const Implausibility& flaw) {
  return std::stoul(flaw.quantity.substr(kName.size())) - 1;
}

// Rotors with a negative inertia, and those that are not seen, where no other quantity is one that
// a machine can't have. A rotor that is negative makes up for bodies or gains that differ.
std::vector<std::size_t> negative_rotors(const Diagnosis& diagnosis) {
  std::vector<std::size_t> joints;
  for (const Implausibility& flaw : diagnosis.implausible) {
    if (flaw.excludes && (flaw.rule != PlausibilityRule::kSign || !is_of_rotor(flaw))) return {};
    if (is_of_rotor(flaw)) joints.push_back(joint_of(flaw));
  }
  return joints;
}

}  // namespace

std::vector<std::size_t> rotors_to_leave_out(const Diagnosis& diagnosis) {
  constexpr std::string_view kTest = "parameters that are not determined";
  if (excluding(diagnosis.implausible) > 0) return negative_rotors(diagnosis);
  if (diagnosis.verdict != Verdict::kAmbiguous) return {};
  const bool is_alone = std::ranges::all_of(diagnosis.reasons, [&](const VerdictReason& reason) {
    return reason.passed || !reason.not_tested.empty() || reason.test == kTest;
  });
  if (!is_alone) return {};
  std::vector<std::size_t> joints;
  for (const Implausibility& flaw : diagnosis.implausible) {
    if (flaw.rule != PlausibilityRule::kZero || !is_of_rotor(flaw)) return {};
    joints.push_back(joint_of(flaw));
  }
  return joints;
}

std::optional<DiagnosisAnswer> answer_without_unseen_rotors(const DiagnosisRequest& request,
                                                            const Campaign& campaign,
                                                            const Diagnosis& first) {
  constexpr int kTrials = 2;  // what one rotor took may make another negative
  const bool was_impossible = excluding(first.implausible) > 0;
  std::vector<std::size_t> rotors = rotors_to_leave_out(first);
  for (int trial = 0; trial < kTrials; ++trial) {
    if (rotors.empty() || stop_requested()) return {};
    DiagnosisAnswer answer;
    answer.problem = requested_problem(request, campaign, rotors);
    if (!answer.problem) return {};
    answer.diagnosis = diagnose(*answer.problem, request.search);
    Diagnosis& diagnosis = answer.diagnosis;
    if (diagnosis.interrupted || diagnosis.verdict > first.verdict) return {};
    if (!was_impossible || excluding(diagnosis.implausible) == 0) {
      diagnosis.assumptions.push_back(fmt::format(
          "{}: unknown in the model and {} these recordings, so left out.", names_of(rotors),
          was_impossible ? "negative or not told by a fit to" : "not seen in"));
      return answer;
    }
    const std::vector<std::size_t> more = negative_rotors(diagnosis);
    if (more.empty()) return {};
    rotors.insert(rotors.end(), more.begin(), more.end());
    std::ranges::sort(rotors);
  }
  return {};
}

}  // namespace graybox
