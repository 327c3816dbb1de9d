#include "diagnosis/design_page/stored_design_story.hpp"

#include <optional>

#include "diagnosis/design_page/design_stories.hpp"
#include "solvers/constrained/constrained_design_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

// Why the sensitivities of one set say nothing of a design; empty where they do.
std::string reason_for_none(const DesignFile& file) {
  if (!file.floors.empty()) return "it was made under floors (--floor)";
  if (file.limits.any()) return "it was made under a limit of concentration or of positions";
  if (!file.objective.empty()) return "it was made for the objective " + file.objective;
  return "";
}

// The gradients of E and G need what their solvers write beside the weights.
std::string reason_for_no_gradient(const DesignFile& file) {
  const CriterionKind kind = file.criterion.value_or(Criterion()).kind();
  const bool needs_dual =
      kind == CriterionKind::kE || kind == CriterionKind::kG || kind == CriterionKind::kCompound;
  return needs_dual ? "its information matrix is singular, or the file lacks the dual matrix or "
                      "weights of its criterion"
                    : "its information matrix is singular";
}

DesignStory story_of_request(const InformationSet& set, const std::string& path,
                             const DesignFile& file, const ConstrainedClaim& claim) {
  DesignConstraints constraints = resolve(claim, set, path);
  SolveOptions options;
  options.criterion = file.criterion.value_or(Criterion());
  ConstrainedSolution solution;
  solution.efforts = claimed_efforts(file.design, claim, constraints);
  return constrained_story(set, judge_constrained(set, file.solver, options, std::move(solution),
                                                  claim.request, std::move(constraints)));
}

}  // namespace

DesignStory stored_design_story(const InformationSet& set, const std::string& path) {
  const DesignFile file = read_design(path, set, WeightCheck::kRepaired);
  const std::optional<ConstrainedClaim> claim = read_constrained_claim(path);
  DesignStory story;
  story.set = &set;
  if (claim.has_value()) {
    story = story_of_request(set, path, file, *claim);
  } else {
    story.sensitivity_words = reason_for_none(file);
    story.schedule = design_schedule(set, file.design.weights);
    if (story.sensitivity_words.empty()) {
      story.sensitivities =
          criterion_sensitivities(set, file.design, file.criterion.value_or(Criterion()));
    }
  }
  const std::optional<ExactClaim> exact = read_exact_claim(path, set, file.design);
  if (exact.has_value()) story.schedule = design_schedule(set, exact->design.counts);
  if (story.sensitivities.empty() && reason_for_none(file).empty()) {
    story.sensitivity_words = reason_for_no_gradient(file);
  }
  return story;
}

}  // namespace graybox
