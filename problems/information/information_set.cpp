#include "problems/information/information_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <numeric>
#include <utility>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/sha256.hpp"
#include "problems/base/stop.hpp"
#include "problems/information/factor_form.hpp"
#include "problems/information/set_validation.hpp"

namespace graybox {
namespace {

constexpr std::size_t kCandidatesBetweenStops = 65536;
constexpr std::size_t kCandidatesAtOnce = 256;  // whose matrices are made to be hashed

std::string subject(const std::string& name) { return name.empty() ? "information set" : name; }

}  // namespace

struct InformationSet::Derived {
  std::mutex mutex;
  std::atomic<const double*> data = nullptr;  // the matrices of a set in factor form
  AlignedArray packed;
  std::mutex hash_mutex;
  std::string hash;
};

InformationSet::InformationSet(std::size_t dimension, AlignedArray information,
                               CandidateTable candidates, std::vector<std::string> parameters,
                               std::string name)
    : InformationSet(dimension, 0, std::move(information), std::move(candidates),
                     std::move(parameters), std::move(name)) {}

InformationSet InformationSet::of_factors(std::size_t dimension, std::size_t rank,
                                          AlignedArray factors, CandidateTable candidates,
                                          std::vector<std::string> parameters, std::string name) {
  if (rank == 0) throw InputError(subject(name) + ": a factor must have at least one row");
  return {dimension,      rank, std::move(factors), std::move(candidates), std::move(parameters),
          std::move(name)};
}

InformationSet::InformationSet(std::size_t dimension, std::size_t rank, AlignedArray numbers,
                               CandidateTable candidates, std::vector<std::string> parameters,
                               std::string name)
    : dimension_(dimension),
      packed_size_(graybox::packed_size(dimension)),
      rank_(rank),
      candidate_count_(dimension == 0 ? 0 : numbers.size() / numbers_each()),
      numbers_(std::move(numbers)),
      derived_(std::make_shared<Derived>()),
      candidates_(std::move(candidates)),
      parameters_(std::move(parameters)),
      name_(std::move(name)) {
  const std::string who = subject(name_);
  if (dimension_ == 0) throw InputError(who + ": the number of parameters d must be at least 1");
  if (candidate_count_ == 0) throw InputError(who + ": there are no candidates");
  if (candidate_count_ * numbers_each() != numbers_.size()) {
    throw InputError(
        rank == 0 ? fmt::format("{}: {} numbers do not divide into packed matrices of {} (d = {})",
                                who, numbers_.size(), packed_size_, dimension_)
                  : fmt::format("{}: {} numbers do not divide into factors of {} x {}", who,
                                numbers_.size(), rank_, dimension_));
  }
  if (candidates_.units.size() != candidates_.names.size()) {
    throw InputError(fmt::format("{}: candidates: {} column names but {} units", who,
                                 candidates_.names.size(), candidates_.units.size()));
  }
  if (candidates_.values.size() != candidate_count_ * candidates_.names.size()) {
    throw InputError(fmt::format("{}: candidates: {} values, but {} candidates of {} columns", who,
                                 candidates_.values.size(), candidate_count_,
                                 candidates_.names.size()));
  }
  if (!parameters_.empty() && parameters_.size() != dimension_) {
    throw InputError(
        fmt::format("{}: parameters: {} names, but d = {}", who, parameters_.size(), dimension_));
  }
}

bool InformationSet::has_matrices() const {
  return rank_ == 0 || derived_->data.load(std::memory_order_acquire) != nullptr;
}

std::span<const double> InformationSet::packed(std::size_t candidate,
                                               std::span<double> buffer) const {
  if (has_matrices()) return information(candidate);
  pack_factor(factor(candidate).data(), rank_, dimension_, buffer.data());
  return buffer.first(packed_size_);
}

const double* InformationSet::expanded_data() const {
  const double* ready = derived_->data.load(std::memory_order_acquire);
  if (ready != nullptr) return ready;
  const std::scoped_lock lock(derived_->mutex);
  ready = derived_->data.load(std::memory_order_acquire);
  if (ready != nullptr) return ready;
  require_memory(candidate_count_ * packed_size_ * sizeof(double),
                 subject(name_) + ": what is asked works on matrices, not factors: all of them",
                 "use column_generation with criterion D, a part of the set or a larger machine");
  AlignedArray packed(candidate_count_ * packed_size_);
  for (std::size_t i = 0; i < candidate_count_; ++i) {
    if (i % kCandidatesBetweenStops == 0) stop_if_requested();
    pack_factor(factor(i).data(), rank_, dimension_, packed.data() + i * packed_size_);
  }
  derived_->packed = std::move(packed);
  derived_->data.store(derived_->packed.data(), std::memory_order_release);
  return derived_->packed.data();
}

std::span<const double> InformationSet::coordinates(std::size_t candidate) const {
  const std::size_t n = candidates_.names.size();
  return std::span<const double>(candidates_.values).subspan(candidate * n, n);
}

std::string InformationSet::content_hash() const {
  if (numbers_.is_borrowed()) return computed_hash();
  const std::scoped_lock lock(derived_->hash_mutex);
  if (derived_->hash.empty()) derived_->hash = computed_hash();
  return derived_->hash;
}

std::string InformationSet::computed_hash() const {
  const std::uint64_t shape[2] = {candidate_count_, dimension_};  // little-endian on x86-64
  Sha256 hash;
  hash.update(shape, sizeof shape);
  if (has_matrices()) {
    hash.update(data(), candidate_count_ * packed_size_ * sizeof(double));
    return hash.hexadecimal();
  }
  AlignedArray block(std::min(candidate_count_, kCandidatesAtOnce) * packed_size_);
  for (std::size_t from = 0; from < candidate_count_; from += kCandidatesAtOnce) {
    const std::size_t count = std::min(kCandidatesAtOnce, candidate_count_ - from);
    for (std::size_t k = 0; k < count; ++k) {
      pack_factor(factor(from + k).data(), rank_, dimension_, block.data() + k * packed_size_);
    }
    hash.update(block.data(), count * packed_size_ * sizeof(double));
  }
  return hash.hexadecimal();
}

InformationSet InformationSet::subset(std::span<const std::size_t> indices) const {
  const std::size_t n = candidates_.names.size();
  const std::size_t each = numbers_each();
  AlignedArray numbers(indices.size() * each);
  CandidateTable table{candidates_.names, candidates_.units, {}};
  table.values.reserve(indices.size() * n);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const std::size_t i = indices[k];
    if (i >= candidate_count_) {
      throw InputError(fmt::format("{}: subset index {} is not below the {} candidates",
                                   subject(name_), i, candidate_count_));
    }
    std::copy_n(numbers_.data() + i * each, each, numbers.begin() + k * each);
    const auto row = coordinates(i);
    table.values.insert(table.values.end(), row.begin(), row.end());
  }
  return {dimension_, rank_, std::move(numbers), std::move(table), parameters_, name_};
}

void InformationSet::validate() const {
  if (const auto indefinite = indefinite_candidates(*this); !indefinite.empty()) {
    throw InputError(
        fmt::format("{}: candidate {}: the information matrix is not positive semidefinite; check "
                    "how it was formed",
                    subject(name_), indefinite.front()));
  }
  require_regular_sum(*this);
}

std::vector<std::size_t> nested_subset(std::size_t total, std::size_t count, std::uint64_t seed) {
  if (count > total) {
    throw InputError(
        fmt::format("a subset of {} candidates was asked of a set of {}", count, total));
  }
  std::vector<std::size_t> order(total);
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random random(seed);
  for (std::size_t i = 0; i < count; ++i) {  // Fisher-Yates from the front: prefixes are nested
    std::swap(order[i], order[i + random.below(total - i)]);
  }
  order.resize(count);
  return order;
}

}  // namespace graybox
