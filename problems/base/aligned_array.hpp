// A contiguous array of doubles that starts on a cache line and is not initialised on allocation.
// Large arrays ask the system for huge pages: one pass over a gigabyte is then not slowed by
// address translation.
//
// A large array asks first whether there is memory (available_memory.hpp): NotEnoughMemory, a
// std::bad_alloc, has the bytes.
//
// An array may also borrow somebody else's memory, read only, which has to stay for as long as the
// array lives; or keep it, such as a file that is mapped. A copy of such an array has memory of its
// own.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

namespace graybox {

class AlignedArray {
 public:
  AlignedArray() = default;
  explicit AlignedArray(std::size_t size);  // uninitialised; throws std::bad_alloc
  AlignedArray(std::size_t size, double value);
  // Not freed here, and not to be written to.
  [[nodiscard]] static AlignedArray borrowed(const double* data, std::size_t size);
  // Given back with the last array that keeps it, and not to be written to.
  [[nodiscard]] static AlignedArray kept(std::shared_ptr<const double> data, std::size_t size);
  AlignedArray(const AlignedArray& other);
  AlignedArray(AlignedArray&& other) noexcept;
  AlignedArray& operator=(AlignedArray other) noexcept;
  ~AlignedArray();

  // Somebody else's memory, who may change it.
  [[nodiscard]] bool is_borrowed() const { return !owns_ && keeper_ == nullptr; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] double* data() { return data_; }
  [[nodiscard]] const double* data() const { return data_; }
  [[nodiscard]] double& operator[](std::size_t i) { return data_[i]; }
  [[nodiscard]] double operator[](std::size_t i) const { return data_[i]; }
  [[nodiscard]] double* begin() { return data_; }
  [[nodiscard]] double* end() { return data_ + size_; }
  [[nodiscard]] const double* begin() const { return data_; }
  [[nodiscard]] const double* end() const { return data_ + size_; }
  [[nodiscard]] std::span<double> span() { return {data_, size_}; }
  [[nodiscard]] std::span<const double> span() const { return {data_, size_}; }

 private:
  double* data_ = nullptr;
  std::size_t size_ = 0;
  bool owns_ = true;
  std::shared_ptr<const double> keeper_;
};

}  // namespace graybox
