// The `preprocess` list of campaign.yaml: the keys of each step and what they must hold.
// docs/how_to/preprocess.md describes every key.
#pragma once

#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {

// Throws InputError with one line (file, line, field, what is wrong and what to write).
[[nodiscard]] std::vector<PreprocessStep> preprocess_steps_in(const YamlField& field,
                                                              const std::vector<Channel>& channels);

// input, output, reference or other.
[[nodiscard]] ChannelRole channel_role_in(const YamlField& field);

}  // namespace graybox
