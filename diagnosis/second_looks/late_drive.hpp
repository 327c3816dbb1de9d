// A second look at a drive that is recorded later than it acts (drive_lateness.hpp).
//
// No law of a machine moves it before its drive acts. So the drive is moved in time, and the
// machine is diagnosed once more. What that finds answers where it leaves at most 0.6 times the
// error kept out. The channel is named among those that were moved, with both errors.
#pragma once

#include <optional>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/answer_by_method.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"

namespace graybox {

struct LateDriveAnswer {
  Campaign campaign;  // with the drive moved
  MethodAnswer found;
};

struct LateDriveLook {
  std::optional<LateDriveAnswer> answer;  // none: the first one stands
  bool was_stopped = false;
};

// Of one mass with one drive, in any motion, whose first answer leaves something. Throws InputError
// as answer_by() does.
[[nodiscard]] LateDriveLook look_at_late_drive(const MethodAnswer& first,
                                               const DiagnosisRequest& request,
                                               const Campaign& campaign);

}  // namespace graybox
