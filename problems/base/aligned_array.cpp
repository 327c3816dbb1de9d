#include "problems/base/aligned_array.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <new>
#include <utility>

#include "problems/base/available_memory.hpp"

namespace graybox {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{2} << 20;
constexpr std::size_t kLarge = std::size_t{64} << 20;  // filling it takes longer than to ask

// The system grants more than there is, and kills who uses it.
void require_room(std::size_t bytes) {
  if (bytes < kLarge) return;
  if (const std::size_t available = available_memory(); bytes > available) {
    throw NotEnoughMemory(bytes, available);
  }
}

double* allocate(std::size_t size) {
  if (size == 0) return nullptr;
  if (size > std::numeric_limits<std::size_t>::max() / sizeof(double) - kHugePage) {
    throw std::bad_alloc();
  }
  const std::size_t bytes = size * sizeof(double);
  require_room(bytes);
  const bool huge = bytes >= 2 * kHugePage;
  const std::size_t alignment = huge ? kHugePage : kCacheLine;
  const std::size_t rounded = (bytes + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, rounded);
  if (memory == nullptr) throw std::bad_alloc();
  if (huge) madvise(memory, rounded, MADV_HUGEPAGE);  // a hint: failure costs only speed
  return static_cast<double*>(memory);
}

}  // namespace

AlignedArray::AlignedArray(std::size_t size) : data_(allocate(size)), size_(size) {}

AlignedArray::AlignedArray(std::size_t size, double value) : AlignedArray(size) {
  std::fill(begin(), end(), value);
}

AlignedArray::AlignedArray(const AlignedArray& other) : AlignedArray(other.size_) {
  std::copy(other.begin(), other.end(), data_);
}

AlignedArray AlignedArray::borrowed(const double* data, std::size_t size) {
  AlignedArray array;
  array.data_ = const_cast<double*>(data);
  array.size_ = size;
  array.owns_ = false;
  return array;
}

AlignedArray AlignedArray::kept(std::shared_ptr<const double> data, std::size_t size) {
  AlignedArray array = borrowed(data.get(), size);
  array.keeper_ = std::move(data);
  return array;
}

AlignedArray::AlignedArray(AlignedArray&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)),
      owns_(std::exchange(other.owns_, true)),
      keeper_(std::move(other.keeper_)) {}

AlignedArray& AlignedArray::operator=(AlignedArray other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  std::swap(owns_, other.owns_);
  std::swap(keeper_, other.keeper_);
  return *this;
}

AlignedArray::~AlignedArray() {
  if (owns_) std::free(data_);
}

}  // namespace graybox
