// A diagnosis by the method chosen, with the second looks that another method allows.
//
// Where the prediction error comes to no answer, or finds late signals alone, and the drive is
// measured as a whole, its force balance is asked, too, and answers if it has found something
// (balance_beside.hpp). Where that can't be right either, the drive is counted the other way
// (reversed_drive.hpp).
#pragma once

#include <optional>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "diagnosis/second_looks/method_choice.hpp"

namespace graybox {

struct MethodAnswer {
  MethodChoice method;  // that which answers, and why
  DiagnosisAnswer answer;
};

// An answer to a campaign that was changed before it was asked: in its roles, or in its times.
struct CampaignAnswer {
  Campaign campaign;
  MethodAnswer found;
};

struct CampaignLook {
  std::optional<CampaignAnswer> answer;  // none: the first one stands
  bool was_stopped = false;
};

// Throws InputError for files that are missing, wrong or do not belong together. What was found
// until then is the answer once the work is to stop (stop.hpp).
[[nodiscard]] MethodAnswer answer_by(MethodChoice method, const DiagnosisRequest& request,
                                     const Campaign& campaign);

}  // namespace graybox
