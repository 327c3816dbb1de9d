#include "diagnosis/second_looks/single_method.hpp"

#include <optional>
#include <utility>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/second_looks/known_laws.hpp"
#include "diagnosis/second_looks/negative_damping.hpp"
#include "diagnosis/second_looks/requested_problem.hpp"
#include "diagnosis/second_looks/unseen_rotors.hpp"

namespace graybox {
namespace {

Diagnosis stopped_before_the_search(const SearchOptions& options) {
  Diagnosis diagnosis;
  diagnosis.interrupted = true;
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  return diagnosis;
}

// The answer of a second look takes the place of the first one.
void take_if_any(std::optional<DiagnosisAnswer> look, DiagnosisAnswer& answer) {
  if (look) answer = *std::move(look);
}

}  // namespace

DiagnosisAnswer answer_by_prediction(const DiagnosisRequest& request, const Campaign& campaign) {
  DiagnosisAnswer answer;
  answer.by_prediction =
      diagnose_by_prediction(request.model, campaign, request.search, request.threads);
  answer.diagnosis = answer.by_prediction.diagnosis;
  return answer;
}

DiagnosisAnswer answer_by_problem(const DiagnosisRequest& request, const Campaign& campaign) {
  DiagnosisAnswer answer;
  answer.problem = requested_problem(request, campaign);
  if (!answer.problem) {
    answer.diagnosis = stopped_before_the_search(request.search);
    return answer;
  }
  require_known_laws(request.search.excluded_laws, answer.problem->hypotheses());
  answer.diagnosis = diagnose(*answer.problem, request.search);
  take_if_any(answer_without_unseen_rotors(request, campaign, answer.diagnosis), answer);
  return answer;
}

DiagnosisAnswer answer_by_drive(const DiagnosisRequest& request, const Campaign& campaign,
                                const RigidRobotModel& drive) {
  DiagnosisAnswer answer;
  answer.problem = requested_drive_problem(request, campaign, drive);
  if (!answer.problem) {
    answer.diagnosis = stopped_before_the_search(request.search);
    return answer;
  }
  answer.diagnosis = diagnose(*answer.problem, request.search);
  take_if_any(answer_without_negative_damping(request, campaign, drive, answer), answer);
  return answer;
}

}  // namespace graybox
