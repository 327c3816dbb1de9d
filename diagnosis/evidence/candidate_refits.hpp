// Refits of a problem with candidate laws, each done once. Rivals of an effect are often what was
// tried when it was found. Each law is left out more than once, to see whether it is missed and to
// weigh its rivals.
//
// Where recordings are many, candidates race on the few that tell most first
// (MismatchProblem::fit_to_few), and only those that are not far behind there are fitted to all.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/fit_comparison.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// What was fitted, and where the laws started.
struct Refit {
  std::vector<LawStart> laws;
  ExtendedFit fit;
};

// A refit with one more law, or with one law in the place of another.
struct Trial {
  std::size_t hypothesis = 0;
  ExtendedFit fit;
};

[[nodiscard]] std::vector<std::vector<LawStart>> each_beside(
    const std::vector<LawStart>& kept, const std::vector<LawStart>& candidates);

// "coulomb at load"
[[nodiscard]] std::string name_of(const Hypothesis& hypothesis);

class CandidateRefits {
 public:
  // Says what comes next; false: no more.
  using Proceed = std::function<bool(const std::string& step)>;

  // Keeps references to problem and options.
  CandidateRefits(const MismatchProblem& problem, const SearchOptions& options, Proceed proceed)
      : problem_(&problem), options_(&options), proceed_(std::move(proceed)) {}

  // The same recordings, freed of more: nothing of before is known of them.
  void start_anew(const MismatchProblem& problem);
  // A fit nearby is another now.
  void forget();

  // Stays valid until all are forgotten.
  const ExtendedFit& refit(const std::vector<LawStart>& laws, const ExtendedFit& nearby);
  // All of these at once; refit() has them then.
  void refit_all(const std::vector<std::vector<LawStart>>& asked, const ExtendedFit& nearby);

  // Each candidate beside the laws kept, the best first; those that can't be used are left out.
  // `pace`: a law that takes part in a race only. `outpaced`: becomes those that the race excluded.
  std::vector<Trial> refit_each(const std::vector<LawStart>& kept,
                                const std::vector<LawStart>& candidates, const ExtendedFit& nearby,
                                const LawStart* pace = nullptr,
                                std::vector<Rival>* outpaced = nullptr);
  // Likewise without a race.
  std::vector<Trial> refit_to_all(std::vector<std::vector<LawStart>> asked,
                                  const ExtendedFit& nearby);

  // To all recordings, since all were forgotten.
  [[nodiscard]] const std::deque<Refit>& known() const { return known_; }

 private:
  // What a race on few recordings came to: the laws that go on, each from its fit there, and the
  // others.
  struct Race {
    std::vector<Refit> standing;
    std::vector<Rival> outpaced;  // distances are of those recordings
  };

  std::optional<Race> race_on_few(std::vector<std::vector<LawStart>> asked,
                                  const ExtendedFit& nearby, const LawStart* pace);
  [[nodiscard]] Race divide(const std::vector<std::vector<LawStart>>& runners,
                            const std::vector<ExtendedFit>& fits, const ExtendedFit& best) const;
  std::optional<ExtendedFit> fit_to_few(const std::vector<LawStart>& laws,
                                        const ExtendedFit& nearby);
  void keep_usable_in_order(std::vector<Trial>& trials, const ExtendedFit& nearby) const;
  bool proceed_to(const std::string& what, const LawStart& law, const std::string& how = {}) const;
  [[nodiscard]] FitComparison compare() const { return {*problem_, *options_}; }

  const MismatchProblem* problem_;
  const SearchOptions* options_;
  Proceed proceed_;
  std::deque<Refit> known_;
  std::deque<Refit> known_of_few_;
};

}  // namespace graybox
