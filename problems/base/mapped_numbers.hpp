// Numbers that stay in their file: the system brings what is read into memory and drops what it
// has no room for. So a set can be larger than memory; a pass over it costs a pass over the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "problems/base/aligned_array.hpp"

namespace graybox {

// The `count` float64 numbers at byte `offset` of an open file, to read only. The descriptor may be
// closed afterwards. Nothing where they don't lie on a cache line, as kernels want them, or where
// the system refuses. (A limit of address space counts mapped files, too.) Of all that is mapped at
// most about half a gigabyte is resident. A thread of its own drops the rest, which stays in the
// system's cache while there is room. A file that gets shorter meanwhile ends the process.
[[nodiscard]] std::optional<AlignedArray> map_numbers(int descriptor, std::uint64_t offset,
                                                      std::size_t count);

}  // namespace graybox
