#include "bench/challenge/challenge_set.hpp"

#include "bench/challenge/make_challenge.hpp"

namespace graybox::bench {

const ChallengeSet& periodic_set() {
  static const ChallengeSet set{.name = std::string(kPeriodicSet),
                                .all_cases = 400,
                                .quick_cases = 40,
                                .families = {Family::kRobot, Family::kThreeAxis, Family::kOneMass,
                                             Family::kTwoMass, Family::kOscillator, Family::kChain},
                                .compose = compose_challenge,
                                .draw = draw_case,
                                .write = write_case};
  return set;
}

}  // namespace graybox::bench
