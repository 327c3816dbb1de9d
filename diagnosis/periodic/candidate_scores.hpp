// Score tests of hypotheses beside a fitted model: each law at its place, in all its shapes, the
// best of them and where a refit with it may start (candidate_products.hpp has the columns,
// score_test.hpp the test).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

struct HypotheticalLaw {
  std::size_t hypothesis = 0;
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;
};

struct CandidateScoreOptions {
  // Whether columns are taken from the motion as measured. It holds noise of the residuals: only
  // where tests of single hypotheses no longer decide whether anything is missing.
  bool follows_data = false;
  int null_draws = 0;  // of pure noise, for the table's minima
  std::uint64_t seed = 1;
  double deviance = 0.0;  // of the fit
  int threads = 1;
};

// One score a law, in their order; those of one place must follow each other. Cost:
// candidate_products.hpp, a steady state for each recording, and two more passes over the
// recordings for the scales of motion.
[[nodiscard]] ScoreTable score_candidates(const PlantFamily& family, const PeriodicData& data,
                                          const ModelState& model,
                                          std::span<const HypotheticalLaw> laws,
                                          const CandidateScoreOptions& options);

}  // namespace graybox
