#include "diagnosis/second_looks/known_laws.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "problems/base/error.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

[[noreturn]] void refuse_law(const std::string& law) {
  throw InputError(fmt::format(
      "--without {}: no hypothesis has such a law; 'graybox simulate --laws' lists the laws", law));
}

}  // namespace

void require_known_laws(const std::vector<std::string>& laws,
                        std::span<const Hypothesis> hypotheses) {
  for (const std::string& law : laws) {
    const auto names_it = [&](const Hypothesis& hypothesis) { return hypothesis.law == law; };
    if (std::none_of(hypotheses.begin(), hypotheses.end(), names_it)) refuse_law(law);
  }
}

void require_laws_of_the_catalogue(const std::vector<std::string>& laws) {
  for (const std::string& law : laws) {
    if (find_law(law, false) == nullptr && find_law(law, true) == nullptr) refuse_law(law);
  }
}

}  // namespace graybox
