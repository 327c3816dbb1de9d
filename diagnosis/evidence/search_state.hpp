// What the steps of the search for missing physics share: the problem, what is known so far, and
// the refits done. A file a step: diagnosis_search.hpp has their numbers, its source file their
// order.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "diagnosis/evidence/candidate_refits.hpp"
#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/fit_comparison.hpp"
#include "diagnosis/evidence/search_options.hpp"

namespace graybox {

// A small law beside others must explain this share of what the largest explains: no law of a
// catalogue describes a real force to better than some three per cent, a thousandth in chi-square.
inline constexpr double kImperfection = 1e-3;

struct SearchState {
  // Keeps references to both.
  SearchState(const MismatchProblem& problem, const SearchOptions& options);
  SearchState(const SearchState&) = delete;  // refits report to this one
  SearchState& operator=(const SearchState&) = delete;

  // Says what comes next; false: no more.
  bool proceed(const std::string& step);

  [[nodiscard]] const Hypothesis& hypothesis(std::size_t index) const {
    return problem->hypotheses()[index];
  }
  [[nodiscard]] const std::string& place_of(std::size_t index) const {
    return hypothesis(index).place;
  }
  [[nodiscard]] std::string name_of(std::size_t index) const;
  // Laws that may be found.
  [[nodiscard]] std::size_t effect_limit() const;

  // Refines the shapes that the fits of candidates held, where these hold any.
  void settle_shapes();
  // Goes on with the same problem on recordings freed of more; the one before stays alive.
  void go_on_with(std::unique_ptr<MismatchProblem> freed);
  // What the model states as it is again.
  void go_back_to(const MismatchProblem& stated);
  // The fit without laws.
  [[nodiscard]] const ExtendedFit& without_laws() const {
    return freed_without_laws ? *freed_without_laws : result.before;
  }
  // What the report shows of the model without laws.
  void describe_fit_as_it_is();

  const MismatchProblem* problem;
  const SearchOptions& options;
  Diagnosis result;
  FitComparison compare;
  CandidateRefits refits;
  // Compound places are looked at when single ones explain no more.
  bool compounds_are_open = true;
  // Hypotheses of a higher rank come when those up to this one explain no more.
  int highest_rank = std::numeric_limits<int>::max();

  // Where what the model states was freed, of that model.
  std::optional<ExtendedFit> freed_without_laws;
  int first_fits = 0;           // after the first (first_fit.hpp)
  bool tried_to_renew = false;  // with laws (renewal.hpp)
  // Before recordings were freed of more: the single law found, and rivals far behind it.
  std::optional<std::size_t> ahead;
  std::vector<Rival> far_behind;
  // With a rival or generalisation in the place of a law found (explanation_class.hpp).
  std::vector<ExtendedFit> class_fits;
  std::set<std::string>
      departed_places;  // of laws that are not quite what is there (shape_check.hpp)

 private:
  std::vector<std::unique_ptr<MismatchProblem>> freed_;  // what `problem` was and is, but the first
};

}  // namespace graybox
