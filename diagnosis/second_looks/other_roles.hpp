// A second look at few recordings in other roles: those kept out are fitted, too, or instead.
//
// Which of two equal recordings is named first is chance. Where the first shows no law that holds
// on the other, they change places, and what the other shows is tested on the first. A short log
// that is cut in two may show in neither part what it shows as a whole. Then all recordings are
// fitted. So they are where laws are told that none kept out confirms, and the fit of all leaves at
// most 0.6 times what was left of those. Nothing is left to test what is found so, and its verdict
// is `ambiguous` at best. The same is done where the two ask for other sizes of the same laws:
// other laws may hold with one size for both.
#pragma once

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/second_looks/answer_by_method.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"

namespace graybox {

// What few recordings (5000 samples at most) of a lumped model in any motion show, where those of
// the fit alone show no law that holds, or do not determine the mass. What those kept out show by
// themselves and all together do not is another law that happens to hold on the others. Throws
// InputError as answer_by() does.
[[nodiscard]] CampaignLook look_at_other_roles(const MethodAnswer& first,
                                               const DiagnosisRequest& request,
                                               const Campaign& campaign);

}  // namespace graybox
