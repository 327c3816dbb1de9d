#include "diagnosis/evidence/search_state.hpp"

#include <utility>

namespace graybox {
namespace {

constexpr std::size_t kLawsOfKnownNoise = 4;
constexpr std::size_t kLawsOfUnknownNoise = 24;

}  // namespace

SearchState::SearchState(const MismatchProblem& of, const SearchOptions& with)
    : problem(&of),
      options(with),
      compare(of, with),
      refits(of, with, [this](const std::string& step) { return proceed(step); }) {
  result.noise_is_known = of.noise_is_known();
}

bool SearchState::proceed(const std::string& step) {
  if (!result.interrupted && options.proceed && !options.proceed(step)) {
    result.interrupted = true;
  }
  return !result.interrupted;
}

std::string SearchState::name_of(std::size_t index) const {
  return graybox::name_of(hypothesis(index));
}

std::size_t SearchState::effect_limit() const {
  if (options.effect_limit > 0) return options.effect_limit;
  return problem->noise_is_known() ? kLawsOfKnownNoise : kLawsOfUnknownNoise;
}

void SearchState::settle_shapes() {
  ExtendedFit& after = result.after;
  if (!problem->holds_untouched_laws() || after.laws.empty()) return;
  const ExtendedFit& settled = refits.refit(starts_of(after), after);
  if (settled.usable && settled.deviance <= after.deviance) after = settled;
}

void SearchState::go_on_with(std::unique_ptr<MismatchProblem> freed) {
  compare = FitComparison(*freed, options);
  refits.start_anew(*freed);
  problem = freed.get();
  freed_.push_back(std::move(freed));
}

void SearchState::go_back_to(const MismatchProblem& stated) {
  compare = FitComparison(stated, options);
  refits.start_anew(stated);
  problem = &stated;
  freed_without_laws.reset();
}

void SearchState::describe_fit_as_it_is() {
  result.after = result.before;
  result.mismatch_before = problem->mismatch(result.before);
  result.channels_before = problem->channel_rests(result.before);
  result.curves_before = problem->residual_curves(result.before);
  result.validation_before = problem->validate(result.before);
}

}  // namespace graybox
