#include "diagnosis/second_looks/requested_problem.hpp"

#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/load/load_mismatch_problem.hpp"
#include "problems/base/stop.hpp"

namespace graybox {

std::unique_ptr<MismatchProblem> requested_problem(const DiagnosisRequest& request,
                                                   const Campaign& campaign,
                                                   const std::vector<std::size_t>& without_rotors) {
  try {
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

std::unique_ptr<MismatchProblem> requested_drive_problem(const DiagnosisRequest& request,
                                                         const Campaign& campaign,
                                                         const RigidRobotModel& drive) {
  try {
    return drive_balance_problem(drive, campaign, {.threads = request.threads, .keep_going = [] {
                                                     return !stop_requested();
                                                   }});
  } catch (const Stopped&) {
    return nullptr;
  }
}

}  // namespace graybox
