#include "problems/base/mapped_numbers.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <fstream>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>

namespace graybox {
namespace {

constexpr std::uint64_t kCacheLine = 64;
constexpr std::size_t kResident = std::size_t{512} << 20;  // bytes of files in this process
constexpr std::chrono::milliseconds kBetweenLooks(10);  // in which memory gives tens of megabytes

// Bytes of files that are resident, by the third number of statm (in pages).
std::size_t resident_file_bytes(std::size_t page) {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0, resident = 0, shared = 0;
  return statm >> size >> resident >> shared ? shared * page : 0;
}

class Mapping {
 public:
  Mapping(void* base, std::size_t bytes, std::size_t page)
      : base_(base), bytes_(bytes), page_(page) {
    if (bytes_ > kResident) {
      trimmer_ = std::jthread([this](const std::stop_token& stop) { trim(stop); });
    }
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping() {
    if (trimmer_.joinable()) {
      trimmer_.request_stop();
      trimmer_.join();
    }
    munmap(base_, bytes_);
  }

 private:
  void trim(const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any stopped;
    std::unique_lock lock(mutex);
    while (!stopped.wait_for(lock, stop, kBetweenLooks, [&] { return stop.stop_requested(); })) {
      if (resident_file_bytes(page_) > kResident) madvise(base_, bytes_, MADV_DONTNEED);
    }
  }

  void* base_;
  std::size_t bytes_, page_;
  std::jthread trimmer_;
};

}  // namespace

std::optional<AlignedArray> map_numbers(int descriptor, std::uint64_t offset, std::size_t count) {
  if (count == 0 || offset % kCacheLine != 0) return std::nullopt;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t before = offset % page;
  const std::size_t bytes = before + count * sizeof(double);
  void* base =
      mmap(nullptr, bytes, PROT_READ, MAP_SHARED, descriptor, static_cast<off_t>(offset - before));
  if (base == MAP_FAILED) return std::nullopt;
  auto mapping = std::make_shared<Mapping>(base, bytes, page);
  const auto* first = reinterpret_cast<const double*>(static_cast<const char*>(base) + before);
  return AlignedArray::kept(std::shared_ptr<const double>(std::move(mapping), first), count);
}

}  // namespace graybox
