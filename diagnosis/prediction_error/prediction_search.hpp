// The search for missing physics by prediction errors.
//
// The ladder: horizons of 10, 30, 100, 300, ... samples (first_horizon() where few), short ones
// first. Over a long horizon a model that lacks friction predicts best by ignoring its own input;
// over a short one it can't. A plant that forgets (springs and dampers on every coordinate), and
// imposed motion, are searched in free run, from where a fit ten samples ahead led. On each rung:
//
//   1. fit the model of the rung before; skip the rung where its errors are what the sensors' noise
//      leaves by itself, stop where they exceed 95 % of the signal
//   2. rank all laws (extension_scores.hpp), take a shortlist, refit each from this fit
//   3. where no law was found yet, also groups at once (law_groups.hpp): viscous and Coulomb
//      friction at all masses, Coulomb friction and drag, a curved gain or, where nothing drives,
//      a weight at one, or a spring and where it rests; taken if they leave less than 80 % of what
//      the best single law does
//   4. accept if z > 3 (left_out_blocks.hpp; late channels by z_of_law), the cost falls by more
//      than 3 %, 10 % by a law that few machines have, 15 % near the noise (or a chi-square of 25
//      of white residuals, where nothing is rounded; late channels a quarter of what may be
//      rounding), and the frictions do not feed energy in (friction_energy.hpp); among those not
//      told from the best, the plainest
//   5. prune: drop every law found that is not missed (is_idle); again from 2
//
// Where errors grow with the horizon (the plant does not forget) a disturbance hides small laws. So
// after the ladder, the force that remains is taken for one (latent_force.hpp), the filter follows
// it, and the rungs of 10 and 30 samples are searched again.
//
// It begins where search_start.hpp says; masses and springs move by 10 about that.
//
//   PredictionSearch search(data, hypotheses, options);
//   const PredictionFindings findings = search.run(model);
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/prediction_error/extension_scores.hpp"
#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

// Of the cost, and of the squared error of recordings kept out.
inline constexpr double kRareGain = 0.1;
// One sample ahead, beside a disturbance: of the cost, z, and chi-square.
inline constexpr double kInnovationGain = 0.01, kInnovationErrors = 1.0,
                        kInnovationEvidence = 200.0;

// Whether a law takes most of the cost, white residuals say so, too, and other blocks gain. Dry
// friction and late channels need no large z then: they may act in few blocks only, as where the
// machine comes to rest, or its drive steps. `gain` of the cost, `evidence` a chi-square.
[[nodiscard]] inline bool takes_most(double gain, double evidence, double z) {
  constexpr double kMost = 0.5, kSure = 25.0, kGains = 1.0;
  return gain > kMost && evidence > kSure && z > kGains;
}

struct PredictionSearchOptions {
  double errors_of_gain = 3.0;         // z
  double least_gain = 0.03;            // of the cost
  double least_gain_rare = kRareGain;  // of the cost, by a law that few machines have
  double least_gain_mode = 0.3;        // by something that swings: it imitates much
  double equal_errors = 2.5;           // z within which another law is no better
  double equal_gain = 0.85;            // share of the best one's gain
  double rival_errors = 2.0;           // z within which a law is not excluded
  double at_noise = 0.05;              // beyond the sensors' noise, of it: nothing to see
  double at_rounding = 1.3;            // times the noise, where that may be rounding
  double noise_multiple = 4.0;  // times it: what is left may be rounding, and a law must take
  double least_gain_near_noise = 0.15;   // so much of the cost
  double least_gain_of_rounding = 0.25;  // a late channel: of the share that may be rounding
  double least_evidence = 0.0;           // chi-square of what the law takes of white residuals
  double no_skill = 0.95;                // of the signal
  double fed_in = 0.02;                  // of the energy, at a place
  double group_gain = 0.2;               // of the cost that the best single law leaves
  std::size_t shortlist = 5, whitened_shortlist = 3;
  std::size_t most_laws = 8;
  int threads = 1;
  // Called with what is being done; false: stop with what has been found.
  std::function<bool(const std::string&)> proceed;
};

// One law's fit against the others of its shortlist.
struct TriedLaw {
  std::size_t hypothesis = 0;
  PredictionFit fit;
  double z = 0.0;         // over the poorer model
  double gain = 0.0;      // of its cost
  double evidence = 0.0;  // chi-square of what it takes, the residuals made white
  double behind = 0.0;    // z of the law taken over this one
  bool feeds_energy = false;
  bool ran_away = false;  // a parameter of the law ended at a bound, or what no machine has
  [[nodiscard]] bool is_possible() const { return !feeds_energy && !ran_away; }
};

struct AcceptedLaw {
  std::size_t hypothesis = 0;
  Eigen::Index horizon = 0;
  double z = 0.0, gain = 0.0;
  std::vector<TriedLaw> rivals, excluded;  // fits without their derivatives
};

struct Rung {
  Eigen::Index horizon = 0;
  bool was_searched = false;
  // The model's errors over what the sensors' noise leaves, the most of the outputs.
  double over_noise = 0.0;
};

// Whether a fit does as well without a law: the cost rises by less than 0.3 %, or by less than 3 %
// without being told (z < 1.5), or other blocks are better predicted without it.
[[nodiscard]] bool is_idle(const PredictionFit& without, const PredictionFit& with);

struct PredictionFindings {
  bool usable = false;
  bool stopped = false;
  ExtendedLumpedModel started;          // where the search began
  ExtendedLumpedModel as_given, found;  // fitted
  Eigen::Index first_horizon = 0;
  std::vector<AcceptedLaw> laws;
  std::vector<Rung> rungs;
  double sample_time = 0.0;             // s, of the samples that horizons count
  double intensity = 0.0;               // of the force noise, on the last rung
  std::vector<ExtensionScore> ranking;  // of the first search, and what it ranked
  std::vector<LawExtension> ranked;
  bool has_free_run = false;  // whether it was searched in free run
  // Of laws found one sample ahead: the disturbance that the filter followed, the only force noise
  // that it knew.
  std::optional<DisturbanceForce> followed;
  Eigen::VectorXd left;  // rms by output on the last rung, of the signal
  // Of the white force noise at every mass that a filter reckons with. Beside a disturbance that
  // was followed there is next to none.
  [[nodiscard]] double filter_intensity() const {
    constexpr double kNextToNone = 1e-3;
    return followed ? kNextToNone * intensity : intensity;
  }
  // A horizon of the search in samples of `data`, which may be sampled faster.
  [[nodiscard]] Eigen::Index samples_of(const PredictionData& data, Eigen::Index horizon) const {
    return std::lround(sample_time / data.sample_time() * static_cast<double>(horizon));
  }
};

class PredictionSearch {
 public:
  PredictionSearch(const PredictionData& data, const PredictionHypotheses& hypotheses,
                   PredictionSearchOptions options);
  [[nodiscard]] PredictionFindings run(const LumpedModel& model);
  // One sample ahead, beside the likeliest disturbance: laws that longer predictions hide beneath
  // what a disturbance adds up to. `without`: the model without laws as the ladder fitted it. No
  // laws, and nothing followed, where no force is recorded.
  [[nodiscard]] PredictionFindings search_innovations(const LumpedModel& stated,
                                                      const PredictionFindings& ladder,
                                                      const ExtendedLumpedModel& without);

  // Whole recordings in free run, from where a last fit of what the ladder found ended. Small
  // forces add up there, and so does a disturbance: recordings kept out must confirm what is found.
  [[nodiscard]] PredictionFindings search_whole(const LumpedModel& stated,
                                                const PredictionFindings& ladder,
                                                const ExtendedLumpedModel& from);

 private:
  struct State {  // on one rung
    PredictionTask task;
    Eigen::VectorXd weights;
    PredictionFit fit;
    Eigen::VectorXd error, by_noise;  // rms by output: what is left, and what noise alone leaves
  };
  [[nodiscard]] PredictionFindings search_over(const std::vector<Eigen::Index>& horizons,
                                               const LumpedModel& model);
  [[nodiscard]] PredictionFitter fitter(const State& state) const;
  [[nodiscard]] bool climb(Eigen::Index horizon, const ExtendedLumpedModel& from, State& state);
  [[nodiscard]] ExtendedLumpedModel as_started(const ExtendedLumpedModel& model) const;
  void weigh(State& state) const;
  void search_rung(State& state);
  void look_at_free_run();
  void search_beside_disturbance();
  [[nodiscard]] bool add_law(State& state);
  [[nodiscard]] std::vector<LatentForce> latent_forces(const ExtendedLumpedModel& model) const;
  [[nodiscard]] std::vector<RippleTrial> ripples(const State& state) const;
  [[nodiscard]] double fed_in_by(const State& state, const PredictionFit& fit) const;
  [[nodiscard]] bool is_group_better(const State& state, const PredictionFit& best_single,
                                     const PredictionFit& group) const;
  [[nodiscard]] bool add_group(State& state, const std::optional<PredictionFit>& stated,
                               const std::vector<LawExtension>& extensions,
                               const PredictionFit& best_single);
  // A model to extend, with what each law would take of what it leaves.
  struct ScoredStart {
    const PredictionFit* fit;
    std::vector<ExtensionScore> scores;
  };
  // The laws of all shortlists, each refitted for a few iterations from each start; the best is
  // kept.
  static void add_weights(const std::vector<ExtensionScore>& scores,
                          const std::vector<LawExtension>& extensions,
                          std::vector<std::size_t>& list);
  static void add_sharp_friction(const std::vector<LawExtension>& extensions,
                                 std::vector<std::size_t>& list);
  [[nodiscard]] std::vector<TriedLaw> start_race(const State& state,
                                                 const std::vector<LawExtension>& extensions,
                                                 std::span<const ScoredStart> starts) const;
  [[nodiscard]] static double evidence_of(const TriedLaw& law, const State& state,
                                          const std::vector<LawExtension>& extensions,
                                          const std::vector<ExtensionScore>& scores);
  // The best to their ends; sorted by their costs.
  void end_race(const State& state, std::vector<TriedLaw>& tried) const;
  [[nodiscard]] PredictionFit refit(const State& state, const PredictionFit& from,
                                    const LawExtension& law, double amplitude) const;
  // The poorer model with its own parameters as they are stated, before the first law is found;
  // none where it ended near them.
  // Far from there they made up for what it lacks, and the law that it lacks gains little.
  [[nodiscard]] std::optional<PredictionFit> as_stated(const State& state) const;
  [[nodiscard]] bool has_wandered(const ExtendedLumpedModel& model) const;
  [[nodiscard]] std::size_t plainest(const std::vector<TriedLaw>& good,
                                     const std::vector<LawExtension>& extensions,
                                     const State& state) const;
  void accept(std::vector<TriedLaw> tried, std::size_t taken, State& state);
  void prune(State& state);
  [[nodiscard]] bool is_idle_here(const PredictionFit& without, const PredictionFit& with) const;
  [[nodiscard]] bool is_noise(const State& state) const;
  [[nodiscard]] bool follow_disturbance();
  [[nodiscard]] bool fit_one_ahead(State& state) const;
  [[nodiscard]] bool proceed(const std::string& step);
  // 10, 30, 100, ... samples, as long as there are enough windows.
  [[nodiscard]] std::vector<Eigen::Index> window_ladder() const;

  const PredictionData* data_;
  const PredictionHypotheses* hypotheses_;
  PredictionSearchOptions options_;
  PredictionFindings findings_;
  std::vector<double> intensities_;
  const LumpedModel* stated_ = nullptr;
  ExtendedLumpedModel start_;
  DisturbanceForce disturbance_;  // that the filter follows; none on the ladder
};

// Springs and dampers hold every free coordinate, and what happened is forgotten in a fifth of the
// shortest recording; or no coordinate is free.
[[nodiscard]] bool forgets(const LumpedModel& model, double duration);

}  // namespace graybox
