// Laws that users define, by their formulas:
//
//   format: graybox-laws/1
//   laws:
//     - name: magnet
//       description: repelling magnets
//       force: k * z^5 + c * z^2 * v        # of deflection z, rate v, parameters (expression.hpp)
//       parameters:
//         k: {unit: F/x^5, range: positive}
//         c: {unit: F*s/x^3}
//     - name: fading_friction
//       description: friction with one state s
//       states: {s: v * (1 - s * sign(v) / reach)}       # its rate; it starts and rests at 0
//       force: level * s / reach
//       parameters:
//         level: {unit: F, range: positive}
//         reach: {unit: x, range: positive, tried: deflection}
//
// Units are written with F, x and I (law_catalogue.hpp) and checked where an element uses the law.
// `at` is element (the default) or signal (then z is the signal). Parameters in which the force is
// linear are found by evaluating the formula; the search for missing physics estimates them without
// a start. For each other one, `tried` says what the search starts from: `deflection` (quantiles of
// the recorded |z|), `rate` (of |v|), or a list of numbers.
//
// The same list may stand under the key `laws` in a model or physics file, so that the file needs
// no other to be read.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

class YamlField;

// Adds all laws of a file to the catalogue; their names. Throws InputError.
std::vector<std::string> add_law_file(const std::filesystem::path& file);

// The same laws without adding them.
[[nodiscard]] std::vector<LawEntry> read_law_file(const std::filesystem::path& file);

// The value of the key `laws`.
std::vector<std::string> add_laws(const YamlField& list);

}  // namespace graybox
