#include "diagnosis/design_page/design_stories.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

namespace graybox {
namespace {

constexpr const char* kOneExperiment =
    "Of one experiment's worth of information, spread over the design as weighted. Of n "
    "experiments they are smaller by the square root of n. Units are those of the set's "
    "parameters.";

std::string readable_status(std::string_view status) {
  std::string words(status);
  std::ranges::replace(words, '_', ' ');
  return words;
}

PageMark tone_of(bool is_proven, bool has_proof) {
  return is_proven ? PageMark::kPassed : has_proof ? PageMark::kOpen : PageMark::kFailed;
}

// What all stories begin with.
DesignStory begun(const InformationSet& set, const std::string& kind) {
  DesignStory story;
  story.set = &set;
  story.title = kind + (set.name().empty() ? "" : " of " + set.name());
  return story;
}

void add_size(const InformationSet& set, const char* amounts, DesignStory& story) {
  story.sentences.push_back(fmt::format("It {} {} of {} candidates, to determine {} parameters.",
                                        amounts, story.schedule.runs.size(), set.candidate_count(),
                                        set.dimension()));
}

std::string picture_words(const SolveReport& report) {
  const double largest = 1.0 + report.certificate.duality_gap;
  return fmt::format(
      "A design is optimal exactly where no candidate exceeds the bound of 1, and those in the "
      "design touch it. Here the largest value is {:.9g}. So at least {:.6f} % of the best "
      "efficiency is proven.",
      largest, 100.0 * report.certificate.efficiency);
}

std::string efficiency_sentence(double efficiency, const char* of_what) {
  return fmt::format("No {} could save more than {:.2g} % of the experiments.", of_what,
                     100.0 * std::max(0.0, 1.0 - efficiency));
}

// sum_j y_j a_ji.
std::vector<double> priced(const ConstrainedReport& report, std::vector<double> values) {
  const std::vector<double>& multipliers = report.proof.multipliers;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double price = 0.0;
    for (std::size_t j = 0; j < multipliers.size(); ++j) {
      price += multipliers[j] * report.constraints.rows[j].coefficients[i];
    }
    values[i] = price > 0.0 ? values[i] / price : std::nan("");
  }
  return values;
}

void add_constrained(const InformationSet& set, const ConstrainedReport& report,
                     DesignStory& story) {
  story.sensitivities = criterion_sensitivities(
      set, {.weights = report.efforts}, report.report.options.criterion, report.constraints.prior);
  if (!story.sensitivities.empty()) story.sensitivities = priced(report, story.sensitivities);
  story.standard_errors = standard_errors(set, report.efforts, report.constraints.prior);
  story.error_words = fmt::format(
      "After all {:.6g} experiments, with what was known before. Units are those of "
      "the set's parameters.",
      report.experiments());
}

}  // namespace

DesignStory solve_story(const InformationSet& set, const Design& design,
                        const SolveReport& report) {
  DesignStory story = begun(set, "Design");
  const bool has_proof = report.certificate.status == CertificateStatus::kCertified;
  story.verdict = report.status == ReportStatus::kSolved
                      ? std::string("Proven optimal, to the gap asked")
                      : readable_status(to_string(report.status));
  story.tone = tone_of(report.status == ReportStatus::kSolved, has_proof);
  story.schedule = design_schedule(set, design.weights);
  if (!report.message.empty()) story.sentences.push_back(report.message);
  if (has_proof) {
    story.sentences.push_back(efficiency_sentence(report.certificate.efficiency, "design"));
  }
  add_size(set, "spreads the experiments over", story);
  story.facts = facts_of(report);
  story.sensitivities = criterion_sensitivities(set, design, report.options.criterion);
  story.sensitivity_words = picture_words(report);
  story.standard_errors = standard_errors(set, design.weights);
  story.error_words = kOneExperiment;
  return story;
}

DesignStory constrained_story(const InformationSet& set, const ConstrainedReport& report) {
  DesignStory story = begun(set, "Design under limits");
  const SolveReport& solve = report.report;
  const bool has_proof = solve.certificate.status == CertificateStatus::kCertified;
  story.verdict = solve.status == ReportStatus::kSolved
                      ? std::string("Proven optimal under the limits")
                      : readable_status(to_string(solve.status));
  story.tone = tone_of(solve.status == ReportStatus::kSolved, has_proof);
  story.schedule = design_schedule(set, report.weights().weights);
  if (!solve.message.empty()) story.sentences.push_back(solve.message);
  add_size(set, "spreads the experiments over", story);
  story.facts = facts_of(solve);
  add_constrained(set, report, story);
  story.sensitivity_words =
      "Sensitivities over the price that the limits put on a candidate. Above the bound of 1 may "
      "stand only candidates at their own upper limit.";
  return story;
}

DesignStory exact_story(const InformationSet& set, const ExactReport& report) {
  DesignStory story = begun(set, "Exact design");
  const ExactDesign& design = report.solution.design;
  const bool is_optimal = report.solution.status == ExactStatus::kOptimal;
  story.verdict = is_optimal ? std::string("Proven best in whole numbers")
                             : readable_status(to_string(report.solution.status));
  story.tone = tone_of(is_optimal, report.solution.status != ExactStatus::kSingular);
  story.schedule = design_schedule(set, design.counts);
  if (!report.solution.message.empty()) story.sentences.push_back(report.solution.message);
  story.sentences.push_back(efficiency_sentence(report.certificate.proven_efficiency,
                                                "design of whole numbers of experiments"));
  add_size(set, "runs", story);
  story.facts = facts_of(report);
  const Design weights = design.weights();
  story.sensitivities = criterion_sensitivities(set, weights, Criterion());
  story.sensitivity_words =
      "The bound of 1 is that of designs that may run fractions of an experiment. Whole numbers "
      "can't follow it exactly, and how far they stand above it bounds what rounding costs.";
  story.standard_errors =
      standard_errors(set, std::vector<double>(design.counts.begin(), design.counts.end()));
  story.error_words = fmt::format(
      "After all {} experiments. Units are those of the set's parameters.", design.experiments());
  return story;
}

DesignStory constrained_exact_story(const InformationSet& set,
                                    const ConstrainedExactReport& report) {
  DesignStory story = begun(set, "Exact design under limits");
  const bool is_optimal = report.solution.status == ExactStatus::kOptimal;
  story.verdict = is_optimal ? std::string("Proven best in whole numbers under the limits")
                             : readable_status(to_string(report.solution.status));
  story.tone = tone_of(is_optimal, !report.solution.designs.empty());
  story.schedule = design_schedule(set, report.solution.designs.front().counts);
  if (!report.solution.message.empty()) story.sentences.push_back(report.solution.message);
  add_size(set, "runs", story);
  story.facts = facts_of(report);
  add_constrained(set, report.share, story);
  story.sensitivity_words =
      "Sensitivities over the price that the limits put on a candidate. Whole numbers can't follow "
      "the bound of 1 exactly, and candidates at their own limit may exceed it.";
  return story;
}

DesignStory robust_story(const std::vector<const InformationSet*>& samples, const Design& design,
                         const SolveReport& report, const std::vector<double>& prices,
                         std::vector<double> efficiencies, const std::string& objective) {
  const InformationSet& set = *samples.front();
  DesignStory story = solve_story(set, design, report);
  story.title =
      fmt::format("Design for {} samples ({})", samples.size(), readable_status(objective));
  std::ranges::sort(efficiencies);
  for (DesignFact& fact : story.facts) {
    if (fact.name != "log det M") continue;
    fact.name = "objective";
    fact.meaning = objective == "average"
                       ? "The mean of log det M over the samples."
                       : "The smallest log det M over the samples, each less its reference.";
  }
  if (!efficiencies.empty()) {
    story.facts.push_back({"D-efficiency under the samples",
                           fmt::format("{:.4f} to {:.4f}, median {:.4f}", efficiencies.front(),
                                       efficiencies.back(), efficiencies[efficiencies.size() / 2]),
                           "Under each sample against the best design for that sample alone."});
  }
  story.sensitivities = robust_sensitivities(samples, design, prices);
  std::vector<double> worst;
  for (const InformationSet* sample : samples) {
    const std::vector<double> own = standard_errors(*sample, design.weights);
    worst.resize(own.size(), 0.0);
    for (std::size_t k = 0; k < own.size(); ++k) worst[k] = std::max(worst[k], own[k]);
  }
  story.standard_errors = std::move(worst);
  story.error_words =
      fmt::format("The largest under any of the {} samples. ", samples.size()) + kOneExperiment;
  return story;
}

}  // namespace graybox
