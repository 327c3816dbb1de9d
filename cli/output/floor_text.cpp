#include "cli/output/floor_text.hpp"

#include <fmt/format.h>

namespace graybox::cli {

std::string describe_floors(std::span<const EfficiencyFloor> floors,
                            std::span<const double> efficiencies) {
  std::string text;
  for (std::size_t k = 0; k < floors.size(); ++k) {
    text += fmt::format("  floor         {}-efficiency at least {:.6g}",
                        to_string(floors[k].criterion.kind()), floors[k].share);
    if (k < efficiencies.size()) text += fmt::format(", proven {:.8f}", efficiencies[k]);
    text += fmt::format("; multiplier {:.4g}\n", floors[k].multiplier);
  }
  return text;
}

}  // namespace graybox::cli
