#include "bench/challenge/case_experiment.hpp"

#include "diagnosis/signals/multisine.hpp"

namespace graybox::bench {

Recording simulate_experiment(const CaseSystem& system, const std::vector<Element>& elements,
                              const ExperimentSet& set, Eigen::Index sub_experiment,
                              bool with_noise, std::uint64_t seed,
                              const std::function<bool()>& keep_going) {
  const ChallengePlan& plan = system.plan();
  const std::uint64_t set_seed = derived_seed(seed, {2, set.position, set.level, set.realisation});
  const Multisine signal({.period = plan.period,
                          .lines = plan.lines,
                          .relative_amplitude = {},
                          .inputs = system.input_count(),
                          .rms = plan.levels[set.level],
                          .phase_draws = 5},
                         set_seed);
  ClosedLoopOptions options;
  options.settling_periods = plan.settling_periods;
  options.periods = plan.periods;
  options.seed = derived_seed(set_seed, {3, static_cast<std::uint64_t>(sub_experiment)});
  if (with_noise) {
    options.noise_psd_slope = system.noise_psd_slope();
    options.white_noise = system.white_noise();
  }
  const auto plant = system.plant(elements, set.position);
  return simulate_closed_loop(*plant, system.controller(), plan.sample_time,
                              signal.reference(sub_experiment), options, keep_going);
}

}  // namespace graybox::bench
