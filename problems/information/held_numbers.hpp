// What a set holds, for code that moves candidates about and does not care in which form they are:
// the packed matrices, or the factors.
//
//   const std::span<const double> all = held_numbers(set);          // Q times numbers_each(set)
//   AlignedArray part(3 * numbers_each(set));
//   std::copy_n(all.begin(), part.size(), part.begin());
//   const InformationSet first_three = of_same_form(set, std::move(part));
#pragma once

#include <cstddef>
#include <span>

#include "problems/base/aligned_array.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {

// Of a candidate: p, or k d in factor form.
[[nodiscard]] std::size_t numbers_each(const InformationSet& set);
[[nodiscard]] std::span<const double> held_numbers(const InformationSet& set);
// A set of these numbers with the form, the parameters' names and the name of `set`. Throws as the
// constructors of InformationSet.
[[nodiscard]] InformationSet of_same_form(const InformationSet& set, AlignedArray numbers);

}  // namespace graybox
