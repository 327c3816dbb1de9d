// Foreseeing that a large set does not fit, before hours or the machine's peace are lost.
#pragma once

#include <cstddef>
#include <new>
#include <string>

namespace graybox {

// A large array (aligned_array.hpp) that what is there can't hold. The system would grant it, and
// kill the process when it is filled.
class NotEnoughMemory : public std::bad_alloc {
 public:
  NotEnoughMemory(std::size_t bytes, std::size_t available);
  [[nodiscard]] const char* what() const noexcept override { return line_.c_str(); }

 private:
  std::string line_;
};

// One line for users: what was needed, where it is known, what is there, and what helps.
[[nodiscard]] std::string describe_shortage(const std::bad_alloc& error);

// Bytes that this process may still take. That is the least of what the system calls available and
// of what is left of three limits: those of control groups (control_group.hpp), of the process's
// address space (ulimit -v) and of its data (ulimit -d). Where none can be read, the largest
// number.
[[nodiscard]] std::size_t available_memory();

// The lesser of the limits of this process's address space and data, and what is left of them: what
// the system refuses, rather than kills for. The largest number where there is no limit.
[[nodiscard]] std::size_t process_limit();
[[nodiscard]] std::size_t room_in_process_limits();

// Throws InputError with `fix`, what the user can do, if `bytes` for `what` are not available.
void require_memory(std::size_t bytes, const std::string& what, const std::string& fix);

// The same for `count` float64 numbers that `source`, a file or one of its fields, claims to hold:
// "source: needs 1.6e+12 bytes of memory, 2.3e+10 are there; use a part of it or a larger machine".
// The count may be beyond 64 bits.
void require_memory_for_numbers(long double count, const std::string& source);

// Bytes of address space that this process takes now; 0 where the system does not say.
[[nodiscard]] std::size_t used_address_space();

}  // namespace graybox
