// Laws that a user leaves out (--without) are laws that there are: a misspelt one is refused.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Throws InputError for a law that none of these hypotheses has.
void require_known_laws(const std::vector<std::string>& laws,
                        std::span<const Hypothesis> hypotheses);

// For a drive, whose two methods try different laws. Throws InputError for a law that the catalogue
// does not have.
void require_laws_of_the_catalogue(const std::vector<std::string>& laws);

}  // namespace graybox
