#include "diagnosis/signal_faults/recording_copies.hpp"

#include <algorithm>
#include <bit>

#include "problems/families/candidate_stream.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kWindow = 64;
constexpr Index kFewestChanges = 48;
constexpr std::uint64_t kKeptOneIn = 64;
constexpr std::size_t kFewestShared = 4;
constexpr std::uint64_t kBase = 0x9E3779B97F4A7C15ULL;  // odd, so that it has an inverse

std::uint64_t bits_of(double value) {
  return scatter_bits(std::bit_cast<std::uint64_t>(value + 0.0));
}

std::uint64_t power(std::uint64_t base, Index exponent) {
  std::uint64_t result = 1;
  for (Index k = 0; k < exponent; ++k) result *= base;
  return result;
}

}  // namespace

// A rolling hash: sum of bits(k) base^(last - k).
SampleFingerprint::SampleFingerprint(const Eigen::Ref<const Eigen::VectorXd>& values) {
  const std::uint64_t leaving = power(kBase, kWindow);
  std::uint64_t hash = 0;
  Index changes = 0;
  const auto changed = [&](Index k) { return k > 0 && values(k) != values(k - 1) ? 1 : 0; };
  for (Index k = 0; k < values.size(); ++k) {
    hash = hash * kBase + bits_of(values(k));
    changes += changed(k);
    if (k >= kWindow) {
      hash -= leaving * bits_of(values(k - kWindow));
      changes -= changed(k - kWindow);
    }
    if (k + 1 < kWindow || changes < kFewestChanges) continue;
    const std::uint64_t key = scatter_bits(hash);
    if (key % kKeptOneIn == 0) windows_.try_emplace(key, static_cast<std::size_t>(k + 1 - kWindow));
  }
}

std::optional<SampleFingerprint::Copy> SampleFingerprint::shared_with(
    const SampleFingerprint& other) const {
  Copy copy{0, 0, 0};
  for (const auto& [hash, sample] : windows_) {
    const auto there = other.windows_.find(hash);
    if (there == other.windows_.end()) continue;
    if (copy.windows == 0 || sample < copy.first) {
      copy.first = sample;
      copy.first_there = there->second;
    }
    ++copy.windows;
  }
  if (copy.windows < kFewestShared) return {};
  return copy;
}

}  // namespace graybox
