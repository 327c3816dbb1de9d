// The experiments of a challenge case: its true system with hidden elements, simulated under the
// plan.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "bench/challenge/case_system.hpp"
#include "diagnosis/simulation/closed_loop.hpp"

namespace graybox::bench {

// One recording of a set. References depend on the seed and the set alone, the noise also on the
// sub-experiment. Empty where `keep_going` says no. Throws UnstableMotion, InputError.
[[nodiscard]] Recording simulate_experiment(const CaseSystem& system,
                                            const std::vector<Element>& elements,
                                            const ExperimentSet& set, Eigen::Index sub_experiment,
                                            bool with_noise, std::uint64_t seed,
                                            const std::function<bool()>& keep_going = {});

}  // namespace graybox::bench
