#include "bench/benchmark_sets.hpp"

#include <map>
#include <memory>
#include <string_view>
#include <utility>

#include "bench/study/study_sets.hpp"
#include "problems/families/families.hpp"

namespace graybox::bench {
namespace {

InformationSet make_set(const std::string& family, std::size_t count) {
  constexpr std::string_view kFactors = "_factors";
  if (!family.ends_with(kFactors)) return make_study_set(family, count);
  return make_family(family.substr(0, family.size() - kFactors.size()), count, 0, kStudySetSeed,
                     SetForm::kFactors);
}

}  // namespace

const InformationSet& benchmark_set(const std::string& family, std::size_t count) {
  static std::map<std::pair<std::string, std::size_t>, std::unique_ptr<InformationSet>> sets;
  const auto key = std::make_pair(family, count);
  if (const auto found = sets.find(key); found != sets.end()) return *found->second;
  if (count > kLargeSet) {  // make room first
    std::erase_if(sets, [](const auto& entry) { return entry.first.second > kLargeSet; });
  }
  auto set = std::make_unique<InformationSet>(make_set(family, count));
  return *sets.emplace(key, std::move(set)).first->second;
}

}  // namespace graybox::bench
