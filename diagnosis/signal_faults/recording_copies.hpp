// Recordings that are copies of each other, wholly or in part, also shifted in time.
//
// Rule: windows of 64 samples of a measured channel are compared by the bits of their values. Every
// window whose hash is a multiple of 64 is kept (chosen by content, so a shift doesn't matter); two
// recordings that share at least four of them are copies. Windows with fewer than 48 changes of
// value are left out: standstill repeats itself. Inputs and references are left out: a plan may be
// run twice. Repetitions of one experiment differ by their noise and never share a window;
// noiseless simulations of one experiment are copies, rightly. Correlation won't do: repeated
// references of real drives reach 0.9998. Copies that were scaled or rounded are not found.
// Memory: an eighth of a byte a sample. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>

namespace graybox {

// What remains of one channel of one recording.
class SampleFingerprint {
 public:
  explicit SampleFingerprint(const Eigen::Ref<const Eigen::VectorXd>& values);

  struct Copy {
    std::size_t windows;      // shared
    std::size_t first;        // sample here
    std::size_t first_there;  // the same in the other
  };
  // None if fewer than four windows are shared.
  [[nodiscard]] std::optional<Copy> shared_with(const SampleFingerprint& other) const;

 private:
  std::unordered_map<std::uint64_t, std::size_t> windows_;  // first sample by hash
};

}  // namespace graybox
