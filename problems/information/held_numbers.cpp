#include "problems/information/held_numbers.hpp"

#include <utility>

namespace graybox {

std::size_t numbers_each(const InformationSet& set) {
  return set.has_factors() ? set.rank() * set.dimension() : set.packed_size();
}

std::span<const double> held_numbers(const InformationSet& set) {
  return {set.has_factors() ? set.factors() : set.data(),
          set.candidate_count() * numbers_each(set)};
}

InformationSet of_same_form(const InformationSet& set, AlignedArray numbers) {
  if (!set.has_factors()) {
    return InformationSet(set.dimension(), std::move(numbers), {}, set.parameters(), set.name());
  }
  return InformationSet::of_factors(set.dimension(), set.rank(), std::move(numbers), {},
                                    set.parameters(), set.name());
}

}  // namespace graybox
