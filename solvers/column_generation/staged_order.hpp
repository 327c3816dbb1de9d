// StagedOrder: a set in runs of neighbours, dealt out to a few stages, each a sample of the whole.
//
// Stage 0 has every 2^b-th run. Each later stage has as many as all before it together. These are
// every 2^b-th again (those in the middle), every 2^(b-1)-th, and so on to every second run. A pass
// in this order reads each candidate once. Yet it begins with a small sample from the whole order.
// Within a run the hardware's prefetcher follows. Single rows take two to three times as long.
//
//   const StagedOrder order(set.candidate_count(), random);
//   for (std::size_t stage = 0; stage < order.stages(); ++stage) {
//     for (std::size_t k = 0; k < order.runs(stage); ++k) price(order.run(stage, k));
//   }
//
// b is the smallest for which stage 0 has at most 65 536 candidates. Sets that are no larger have
// b = 0 and one stage.
//
// Stage of run r: with c = (r + shift) mod 2^b and z its number of trailing zero bits, 0 for c = 0,
// else b - z.
#pragma once

#include <cstddef>

#include "problems/base/random.hpp"

namespace graybox {

struct CandidateRun {
  std::size_t from = 0;
  std::size_t to = 0;  // one past the last
};

class StagedOrder {
 public:
  static constexpr std::size_t kUsualRun = 64;

  // The shift is drawn at random, for sets may have a period. A run has at most `longest_run`
  // candidates: more than usual where one is few bytes, for memory wants runs of some 40 kB.
  StagedOrder(std::size_t candidates, Random& random, std::size_t longest_run = kUsualRun);

  [[nodiscard]] std::size_t stages() const { return bits_ + 1; }
  [[nodiscard]] std::size_t runs(std::size_t stage) const;
  [[nodiscard]] CandidateRun run(std::size_t stage, std::size_t k) const;

  [[nodiscard]] std::size_t run_count() const { return run_count_; }
  [[nodiscard]] CandidateRun run(std::size_t r) const;
  [[nodiscard]] std::size_t stage_of_run(std::size_t r) const;

 private:
  [[nodiscard]] std::size_t stride(std::size_t stage) const;
  [[nodiscard]] std::size_t first_run(std::size_t stage) const;

  std::size_t candidates_;
  std::size_t length_;  // of a run; the last may be shorter
  std::size_t run_count_;
  std::size_t bits_;  // b
  std::size_t shift_;
};

}  // namespace graybox
