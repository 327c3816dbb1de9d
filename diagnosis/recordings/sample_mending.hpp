// Steps that mend numbers as they were recorded: samples that are none, counters that wrap. Both
// leave a remark about what they changed (preprocess.hpp, campaign.hpp).
#pragma once

#include "diagnosis/recordings/preprocess_data.hpp"

namespace graybox {

// Cuts the pieces at samples outside the range or not finite. Throws InputError if nothing is left.
void keep_valid_samples(const PreprocessData& context, const ValidSamples& step);

// Each piece by itself.
void unwrap_channels(const PreprocessData& context, const Unwrap& step);

}  // namespace graybox
