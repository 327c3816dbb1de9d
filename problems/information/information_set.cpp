#include "problems/information/information_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/sha256.hpp"
#include "problems/information/set_validation.hpp"

namespace graybox {
namespace {

std::string subject(const std::string& name) { return name.empty() ? "information set" : name; }

}  // namespace

InformationSet::InformationSet(std::size_t dimension, AlignedArray information,
                               CandidateTable candidates, std::vector<std::string> parameters,
                               std::string name)
    : dimension_(dimension),
      packed_size_(graybox::packed_size(dimension)),
      candidate_count_(dimension == 0 ? 0 : information.size() / packed_size_),
      information_(std::move(information)),
      candidates_(std::move(candidates)),
      parameters_(std::move(parameters)),
      name_(std::move(name)) {
  const std::string who = subject(name_);
  if (dimension_ == 0) throw InputError(who + ": the number of parameters d must be at least 1");
  if (candidate_count_ == 0) throw InputError(who + ": there are no candidates");
  if (candidate_count_ * packed_size_ != information_.size()) {
    throw InputError(fmt::format("{}: {} numbers do not divide into packed matrices of {} (d = {})",
                                 who, information_.size(), packed_size_, dimension_));
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

std::span<const double> InformationSet::coordinates(std::size_t candidate) const {
  const std::size_t n = candidates_.names.size();
  return std::span<const double>(candidates_.values).subspan(candidate * n, n);
}

std::string InformationSet::content_hash() const {
  const std::uint64_t shape[2] = {candidate_count_, dimension_};  // little-endian on x86-64
  Sha256 hash;
  hash.update(shape, sizeof shape);
  hash.update(information_.data(), bytes());
  return hash.hexadecimal();
}

InformationSet InformationSet::subset(std::span<const std::size_t> indices) const {
  const std::size_t n = candidates_.names.size();
  AlignedArray information(indices.size() * packed_size_);
  CandidateTable table{candidates_.names, candidates_.units, {}};
  table.values.reserve(indices.size() * n);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const std::size_t i = indices[k];
    if (i >= candidate_count_) {
      throw InputError(fmt::format("{}: subset index {} is not below the {} candidates",
                                   subject(name_), i, candidate_count_));
    }
    std::ranges::copy(this->information(i), information.begin() + k * packed_size_);
    const auto row = coordinates(i);
    table.values.insert(table.values.end(), row.begin(), row.end());
  }
  return InformationSet(dimension_, std::move(information), std::move(table), parameters_, name_);
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
