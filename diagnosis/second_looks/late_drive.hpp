// A second look at a drive that is recorded later than it acts (drive_lateness.hpp).
//
// No law of a machine moves it before its drive acts. So the drive is moved in time, and the
// machine is diagnosed once more. What that finds answers where it leaves at most 0.6 times the
// error kept out. The channel is named among those that were moved, with both errors.
#pragma once

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/answer_by_method.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"

namespace graybox {

// The look is made at one mass with one drive, in any motion, whose first answer leaves something.
// Throws InputError as answer_by() does.
[[nodiscard]] CampaignLook look_at_late_drive(const MethodAnswer& first,
                                              const DiagnosisRequest& request,
                                              const Campaign& campaign);

}  // namespace graybox
