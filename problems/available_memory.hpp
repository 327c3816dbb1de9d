// Foreseeing that a large set does not fit, before hours or the machine's peace are lost.
#pragma once

#include <cstddef>
#include <string>

namespace graybox {

// Bytes that this process may still take: the least of what the system calls available, what is left
// of the control group's limit and of the process's address space (ulimit -v). Where none of these
// can be read, the largest number.
[[nodiscard]] std::size_t available_memory();

// Throws InputError with `fix`, what the user can do, if `bytes` for `what` are not available.
void require_memory(std::size_t bytes, const std::string& what, const std::string& fix);

}  // namespace graybox
