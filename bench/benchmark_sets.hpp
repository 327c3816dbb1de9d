// The information sets of the benchmarks, made on first use and kept: every set is made at most
// once while it is small, and at most one of more than kLargeSet candidates is in memory.
#pragma once

#include <cstddef>
#include <string>

#include "problems/information/information_set.hpp"

namespace graybox::bench {

inline constexpr std::size_t kLargeSet = 100'000;

// The set of a family with Q candidates; of FAMILY_factors the same in factor form (r1g, r1l). Cost
// of the first call: making it. The reference stays valid until another set of more than kLargeSet
// candidates is asked for. Throws InputError for an unknown family.
[[nodiscard]] const InformationSet& benchmark_set(const std::string& family, std::size_t count);

}  // namespace graybox::bench
