// What a design file shows without being judged: its amounts, and its sensitivities where they mean
// something on one set.
//
//   const DesignStory story = stored_design_story(set, "design.json");
//   if (story.sensitivities.empty()) note(story.sensitivity_words);
#pragma once

#include <string>

#include "diagnosis/design_page/design_page.hpp"

namespace graybox {

// The set must outlive the story. A design made under floors or limits, or for several sets, has no
// sensitivities: on one set alone they prove nothing. Neither has one whose information matrix is
// singular, or that lacks the dual matrix or weights of E and G. sensitivity_words say so. Those of
// a design made for a request are divided by the prices of its limits. Throws InputError as
// read_design().
[[nodiscard]] DesignStory stored_design_story(const InformationSet& set, const std::string& path);

}  // namespace graybox
