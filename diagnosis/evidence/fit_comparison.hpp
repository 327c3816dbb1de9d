// One fit against another, and against noise: the criteria by which the search for missing physics
// takes laws, drops them and excludes rivals (diagnosis_search.hpp, steps 3 to 5).
#pragma once

#include <cstddef>
#include <optional>

#include "diagnosis/evidence/search_options.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Standard errors of prediction that keep a law and exclude a rival, where the noise is not known:
// fewer than bring a law in, so that no law comes and goes.
inline constexpr double kExclusionErrors = 2.0;
// Those that bring a law in that every machine has (kExpectedRank).
inline constexpr double kExpectedErrors = 2.0;

// Twice the negative logarithm of the evidence, up to a constant that all fits of a problem share.
[[nodiscard]] double evidence(const ExtendedFit& fit);

// Of chi-square over its expectation.
[[nodiscard]] double excess(const ExtendedFit& fit);

// What a law gains on blocks kept out in turn: the logarithm of the squared error without it over
// that with it, summed over outputs; mean over blocks and its standard error. Where the noise is
// not known. (By logarithms, one block that the others predict badly does not outweigh all.)
struct HeldOutGain {
  double mean = 0.0;
  double standard_error = 0.0;
};
[[nodiscard]] HeldOutGain held_out_gain(const ExtendedFit& without, const ExtendedFit& with);

// The rest is larger than noise: p-value of chi-square against a noncentrality of tolerance x dof.
[[nodiscard]] double practical_size_p_value(const Assessment& assessment, double tolerance);

// Keeps references to both.
class FitComparison {
 public:
  FitComparison(const MismatchProblem& problem, const SearchOptions& options)
      : problem_(&problem), options_(&options) {}

  [[nodiscard]] double bic(const ExtendedFit& fit) const;
  // Less is better: BIC or, where the noise is not known, the error of blocks kept out relative to
  // that of `common`.
  [[nodiscard]] double criterion(const ExtendedFit& fit, const ExtendedFit& common) const;

  // Never where the noise is not known.
  [[nodiscard]] bool rest_is_noise(const ExtendedFit& fit) const;

  // By what of the rest still depends on the motion, and on its own past; none of both where there
  // is a test.
  [[nodiscard]] bool looks_like_noise(const std::optional<double>& structure,
                                      const std::optional<double>& autocorrelated_error) const;

  // Whether a law that is the last of `with` has an effect: more than chance allows for the best of
  // all hypotheses (Bonferroni).
  [[nodiscard]] bool significant(const ExtendedFit& without, const ExtendedFit& with) const;
  // Where the noise is known: whether BIC excludes the model without a law that `with` has, by
  // `exclusion_margin`; one without any law must only be worse.
  [[nodiscard]] bool is_missed(const ExtendedFit& without, const ExtendedFit& with) const;
  // Where the noise is not known: whether this law of `with` is there by its Wald test, and all
  // others still are.
  [[nodiscard]] bool stands_by_itself(const ExtendedFit& without, const ExtendedFit& with,
                                      std::size_t law) const;
  // Both: this law of `with` stands by itself, and `with` predicts better by `held_out_errors`.
  [[nodiscard]] bool is_borne_out(const ExtendedFit& without, const ExtendedFit& with,
                                  std::size_t law) const;
  // Laws that make up for each other have amplitudes that the data do not determine.
  [[nodiscard]] bool every_law_stands(const ExtendedFit& fit) const;
  // Where the noise is not known. A rare law that only `with` has must gain more
  // (SearchOptions::rare_gain); of laws that every machine has kExpectedErrors are enough.
  [[nodiscard]] bool predicts_better(const ExtendedFit& without, const ExtendedFit& with,
                                     double errors) const;

  // How much worse `fit` is than `reference`, so that `exclusion_margin` excludes it: by BIC or,
  // where the noise is not known, by the squared standard errors of what it loses on blocks kept
  // out.
  [[nodiscard]] double disadvantage(const ExtendedFit& fit, const ExtendedFit& reference) const;
  // What recordings kept out add to that; none where there are none, or where it is decided by far
  // without them.
  [[nodiscard]] std::optional<double> held_out_difference(const ExtendedFit& fit,
                                                          const ExtendedFit& reference) const;
  // Of the fit's recordings and those kept out, up to a constant of the reference.
  [[nodiscard]] double evidence_of_all(const ExtendedFit& fit, const ExtendedFit& reference) const;
  // Whether a law that `reference` has keeps its place before a plainer one in `fit`. Where the
  // noise is not known, a law with sizes that the recordings do not determine must predict better.
  // It must do so by as much as one that comes in.
  [[nodiscard]] bool keeps_its_place(const ExtendedFit& reference, std::size_t law,
                                     const ExtendedFit& fit) const;
  // Whether `reference` excludes `fit`.
  [[nodiscard]] bool excludes(const ExtendedFit& reference, const ExtendedFit& fit) const;
  // The gain on blocks kept out that the laws of `with` owe over `without`.
  [[nodiscard]] double least_gain(const ExtendedFit& without, const ExtendedFit& with) const;

  // By recordings kept out, where the noise is known: whatever the errors of the fitted parameters
  // do there.
  [[nodiscard]] bool is_contradicted(const ExtendedFit& fit) const;
  // Whether they do, and speak for another.
  [[nodiscard]] bool contradicts(const ExtendedFit& fit, const ExtendedFit& other) const;

 private:
  // The highest rank of a law that `with` has and `without` has not; below all ranks if none.
  [[nodiscard]] int highest_rank_added(const ExtendedFit& without, const ExtendedFit& with) const;

  const MismatchProblem* problem_;
  const SearchOptions* options_;
};

}  // namespace graybox
