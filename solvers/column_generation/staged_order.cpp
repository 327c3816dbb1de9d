#include "solvers/column_generation/staged_order.hpp"

#include <algorithm>
#include <bit>

namespace graybox {
namespace {

constexpr std::size_t kShortestRun = 8;
constexpr std::size_t kWantedRuns = 4096;   // of the usual length
constexpr std::size_t kFirstStage = 65536;  // candidates at most, about

}  // namespace

StagedOrder::StagedOrder(std::size_t candidates, Random& random, std::size_t longest_run)
    : candidates_(candidates),
      length_(std::clamp(candidates * longest_run / (kWantedRuns * kUsualRun), kShortestRun,
                         longest_run)),
      run_count_((candidates + length_ - 1) / length_),
      bits_(static_cast<std::size_t>(std::bit_width(candidates / kFirstStage))),
      shift_(random.below(std::size_t{1} << bits_)) {}

std::size_t StagedOrder::stride(std::size_t stage) const {
  return std::size_t{1} << (stage == 0 ? bits_ : bits_ - stage + 1);
}

std::size_t StagedOrder::first_run(std::size_t stage) const {
  const std::size_t step = stride(stage);
  const std::size_t code = stage == 0 ? 0 : step / 2;
  return (code + step - shift_ % step) % step;
}

std::size_t StagedOrder::runs(std::size_t stage) const {
  const std::size_t first = first_run(stage), step = stride(stage);
  return first >= run_count_ ? 0 : (run_count_ - first + step - 1) / step;
}

CandidateRun StagedOrder::run(std::size_t stage, std::size_t k) const {
  return run(first_run(stage) + k * stride(stage));
}

CandidateRun StagedOrder::run(std::size_t r) const {
  return {r * length_, std::min(candidates_, (r + 1) * length_)};
}

std::size_t StagedOrder::stage_of_run(std::size_t r) const {
  const std::size_t code = (r + shift_) & ((std::size_t{1} << bits_) - 1);
  return code == 0 ? 0 : bits_ - static_cast<std::size_t>(std::countr_zero(code));
}

}  // namespace graybox
