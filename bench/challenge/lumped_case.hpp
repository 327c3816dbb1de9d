// The lumped systems of challenge cases (case_system.hpp).
#pragma once

#include <cstdint>
#include <memory>

#include "bench/challenge/case_system.hpp"

namespace graybox::bench {

[[nodiscard]] std::unique_ptr<CaseSystem> draw_lumped_case(Family family, std::uint64_t seed);

}  // namespace graybox::bench
