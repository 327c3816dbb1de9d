#include "diagnosis/force_balance_data/law_sample_cache.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>

namespace graybox {
namespace {

constexpr std::size_t kMostBytes = std::size_t{128} << 20U, kMostEntries = 16384;

// FNV-1a over words, mixed once more.
std::size_t hash_of(const LawSampleCache::Key& key) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  const auto add = [&hash](std::uint64_t word) {
    hash ^= word;
    hash *= 0x100000001b3U;
    hash ^= hash >> 29U;
  };
  add(std::bit_cast<std::uintptr_t>(key.place));
  add(std::bit_cast<std::uintptr_t>(key.law));
  for (const double parameter : key.parameters) add(std::bit_cast<std::uint64_t>(parameter));
  return hash;
}

}  // namespace

LawSampleCache::LawSampleCache(Eigen::Index samples)
    : entries_(std::clamp(kMostBytes / (sizeof(double) * static_cast<std::size_t>(
                                                             std::max<Eigen::Index>(samples, 1))),
                          std::size_t{1}, kMostEntries)) {}

LawSampleCache::Samples LawSampleCache::get(Key key,
                                            const std::function<Eigen::VectorXd()>& compute) {
  Entry& entry = entries_[hash_of(key) % entries_.size()];
  {
    const std::lock_guard lock(mutex_);
    if (entry.samples && entry.key == key) return entry.samples;
  }
  auto samples = std::make_shared<const Eigen::VectorXd>(compute());
  const std::lock_guard lock(mutex_);
  entry = {std::move(key), samples};
  return samples;
}

}  // namespace graybox
