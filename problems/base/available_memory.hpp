// Foreseeing that a large set does not fit, before hours or the machine's peace are lost.
#pragma once

#include <cstddef>
#include <string>

namespace graybox {

// Bytes that this process may still take: the least of what the system calls available, what is
// left of the control group's limit and of the process's address space (ulimit -v). Where none of
// these can be read, the largest number.
[[nodiscard]] std::size_t available_memory();

// Throws InputError with `fix`, what the user can do, if `bytes` for `what` are not available.
void require_memory(std::size_t bytes, const std::string& what, const std::string& fix);

// The same for `count` float64 numbers that `source`, a file or one of its fields, claims to hold:
// "source: needs 1.6e+12 bytes of memory, 2.3e+10 are there; use a part of it or a larger machine".
// The count may be beyond 64 bits.
void require_memory_for_numbers(long double count, const std::string& source);

// Bytes of address space that this process takes now; 0 where the system does not say.
[[nodiscard]] std::size_t used_address_space();

}  // namespace graybox
