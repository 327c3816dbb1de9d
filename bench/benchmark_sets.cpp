#include "graybox/bench/benchmark_sets.hpp"

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/problems/random.hpp"

namespace graybox::bench {
namespace {

// Plain Wishart matrices H = G G', G standard normal, d = 12.
InformationSet wishart_set(std::size_t count) {
  constexpr std::size_t kDimension = 12;
  Random random(20070101);
  AlignedArray information(count * packed_size(kDimension));
  std::vector<double> factor(kDimension * kDimension);
  double* out = information.data();
  for (std::size_t i = 0; i < count; ++i) {
    for (double& x : factor) x = random.normal();
    for (std::size_t row = 0; row < kDimension; ++row) {
      for (std::size_t column = 0; column <= row; ++column) {
        double sum = 0.0;
        for (std::size_t k = 0; k < kDimension; ++k) {
          sum += factor[row * kDimension + k] * factor[column * kDimension + k];
        }
        *out++ = sum;
      }
    }
  }
  return InformationSet(kDimension, std::move(information), {}, {}, "wis");
}

}  // namespace

const InformationSet& benchmark_set(const std::string& family, std::size_t count) {
  static std::map<std::pair<std::string, std::size_t>, std::unique_ptr<InformationSet>> sets;
  const auto key = std::make_pair(family, count);
  if (const auto found = sets.find(key); found != sets.end()) return *found->second;
  if (family != "wis") throw InputError("unknown family '" + family + "'");
  if (count > kLargeSet) {
    std::erase_if(sets, [](const auto& entry) { return entry.first.second > kLargeSet; });
  }
  return *sets.emplace(key, std::make_unique<InformationSet>(wishart_set(count))).first->second;
}

}  // namespace graybox::bench
