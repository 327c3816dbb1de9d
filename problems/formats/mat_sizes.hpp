// Sizes that MAT files state, checked against what they store: matio believes them. Internal, as
// mat_handles.hpp.
#pragma once

#include <matio.h>

#include <cstddef>
#include <string>

namespace graybox {

// The product of the dimensions; the largest number if it is beyond 64 bits.
[[nodiscard]] std::size_t element_count(const matvar_t& variable);

// Whether `data` is there and as long as the dimensions say; for real numeric classes.
[[nodiscard]] bool holds_its_numbers(const matvar_t& variable);

// Throws InputError if the file is too short to hold so many elements, even compressed.
void require_plausible_size(const std::string& source, const std::string& path,
                            const matvar_t& variable);

}  // namespace graybox
