// A second look at a drive with its force counted the other way.
//
// Dry friction tells: turned, what a balance of forces then finds leaves less than half of the
// force that it leaves as recorded. Masses, springs and dampers alone leave as much either way.
#pragma once

#include <optional>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

struct ReversedLook {
  std::optional<ChannelFault> fault;  // none: nothing tells that the sign is wrong
  bool was_stopped = false;
};

// `error`: what the balance leaves as recorded, % of the force; none where it gave no answer, which
// counts as all of it. A machine with two drives is left as it is: nobody knows which to turn.
[[nodiscard]] ReversedLook look_at_reversed_drive(const RigidRobotModel& drive,
                                                  const DiagnosisRequest& request,
                                                  const Campaign& campaign,
                                                  std::optional<double> error);

// This look predicts instead: a balance of a log with few samples may tell nothing. `first` left
// more force than ever acted. A fault: turned, less than half of that is left. Of the forces that
// act it is less than three quarters. The laws must be a machine's.
[[nodiscard]] ReversedLook look_at_reversed_prediction(const DiagnosisRequest& request,
                                                       const Campaign& campaign,
                                                       const Diagnosis& first);

// Puts the fault in the place of the answer: nothing else is said of recordings that are not what
// the channels say.
void refuse(ChannelFault fault, const SearchOptions& options, Diagnosis& diagnosis);

}  // namespace graybox
