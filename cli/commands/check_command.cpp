#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/arguments/criterion_arguments.hpp"
#include "cli/arguments/design_output_arguments.hpp"
#include "cli/arguments/request_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/constrained_report_text.hpp"
#include "cli/output/design_output.hpp"
#include "cli/output/exact_report_text.hpp"
#include "cli/output/floor_text.hpp"
#include "cli/output/set_answer.hpp"
#include "diagnosis/design_page/design_stories.hpp"
#include "problems/base/error.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/exact_bounds/exact_screening.hpp"
#include "solvers/floors/efficiency_floor.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct CheckArguments {
  SetArguments set;
  std::string design;
  CriterionArguments criterion;
  RequestArguments request;
  DesignOutputArguments shown;
  std::optional<double> gap;
  bool json = false;
};

// What the file's author claimed; a file that claims nothing is only measured against the gap.
SolveStatus claimed_status(const std::string& status) {
  for (const SolveStatus known : {SolveStatus::kSolved, SolveStatus::kIterationLimit,
                                  SolveStatus::kTimeLimit, SolveStatus::kNumericalFailure}) {
    if (status == to_string(known)) return known;
  }
  return SolveStatus::kSolved;
}

std::vector<PageFile> files_of(const CheckArguments& arguments) {
  return {{arguments.set.path, "information set"}, {arguments.design, "design"}};
}

// An exact design is measured against all exact designs, by the relaxation's bound; a tree's bound
// can't be checked without growing the tree again, so it is only quoted.
int check_exact(const CheckArguments& arguments, const ProjectedSet& read, const DesignFile& file,
                const ExactClaim& claim, const DesignOutput& shown) {
  const InformationSet& set = read.set;
  ExactOptions options{.experiments = claim.experiments};
  options.gap = arguments.gap.value_or(file.asked_gap.value_or(options.gap));
  const Relaxation relaxation = solve_relaxation(set);
  ExactSolution solution{.design = claim.design};
  solution.seconds = file.counters.seconds;
  solution.iterations = file.counters.iterations;
  solution.survivors =
      screen_counts(relaxation, claim.experiments,
                    certify_exact(set, claim.design, claim.experiments, relaxation).log_det)
          .candidates.size();
  judge_exact(set, relaxation, options, solution);
  ExactReport report = report_exact(set, relaxation, file.solver, options, solution);
  report.share.problem_hash = set.content_hash();
  const double stated =
      claim.log_det_bound.has_value()
          ? certify_exact(set, claim.design, claim.experiments, relaxation, *claim.log_det_bound)
                .proven_efficiency
          : report.certificate.proven_efficiency;
  if (shown.has_page()) shown.write_page(exact_story(set, report), files_of(arguments));
  if (shown.has_table()) {
    shown.print_table(set, design_schedule(set, claim.design.counts));
  } else if (arguments.json) {
    nlohmann::ordered_json line = to_json(report);
    line["stated_efficiency"] = stated;
    print_line(read, std::move(line));
  } else {
    fmt::print("{}{}", set_headline(read), describe_exact(report));
    fmt::print("  by {:<10} at least {:.8f}, as the file states; proven here by the relaxation\n",
               claim.method, stated);
    fmt::print("{}", describe_counts(set, claim.design));
    shown.say_page();
  }
  const bool held = !arguments.gap.has_value() || solution.status == ExactStatus::kOptimal;
  return held && solution.status != ExactStatus::kSingular ? kDone : kShort;
}

// What the relaxed problem proves of an exact design.
struct ExactProof {
  bool is_exact = false;
  double efficiency = 0.0;  // at least this share of the best exact design's
};

void print_request_check(const CheckArguments& arguments, const ProjectedSet& read,
                         const ConstrainedReport& report, const ExactProof& proof,
                         CriterionKind criterion) {
  const InformationSet& set = read.set;
  if (arguments.json) {
    nlohmann::ordered_json line = to_json(report);
    if (proof.is_exact) {
      line["status"] = to_string(report.report.certificate.status);
      line["message"] = report.report.certificate.message;
      line["efficiency"] = line["proven_efficiency"] = proof.efficiency;
      line["duality_gap"] = 1.0 / proof.efficiency - 1.0;
    }
    print_line(read, std::move(line));
  } else if (proof.is_exact) {
    fmt::print(
        "{}design: {}\n  request       {}\n  {}-efficiency  at least {:.8f} of the "
        "best exact design, by the relaxed problem\n{}",
        set_headline(read), to_string(report.report.certificate.status), describe(report.request),
        to_string(criterion), proof.efficiency, describe_efforts(set, report));
  } else {
    fmt::print("{}{}{}", set_headline(read), describe_constrained(report),
               describe_efforts(set, report));
  }
}

// Against the request that is given, or the one that the design says it was made for.
int check_request(const CheckArguments& arguments, const ProjectedSet& read, const DesignFile& file,
                  const ConstrainedClaim& claim, const DesignOutput& shown) {
  const InformationSet& set = read.set;
  DesignRequest request = arguments.request.read();
  const bool given = request.any();
  DesignConstraints constraints =
      given ? resolve(request, set) : resolve(claim, set, arguments.design);
  SolveOptions options;
  options.criterion = arguments.criterion.read(set).value_or(file.criterion.value_or(Criterion()));
  options.duality_gap = arguments.gap.value_or(file.asked_gap.value_or(options.duality_gap));
  ConstrainedSolution solution;
  solution.efforts = claimed_efforts(file.design, claim, constraints);
  solution.status = claimed_status(file.status);
  solution.counters = file.counters;
  ConstrainedReport report =
      judge_constrained(set, file.solver, options, std::move(solution),
                        given ? request : claim.request, std::move(constraints));
  report.report.problem_hash = set.content_hash();
  const bool other = given || !arguments.criterion.name.empty();
  if (other && report.report.status == ReportStatus::kClaimedButWrong) {
    report.report.status = ReportStatus::kInaccurate;  // no claim was made for this request
    report.report.message = "made for another request";
  }
  // An exact design is compared with the best relaxed one, which no exact one exceeds.
  ExactProof proof{.is_exact = read_exact_claim(arguments.design, set, file.design).has_value(),
                   .efficiency = report.report.certificate.efficiency};
  if (proof.is_exact) {
    proof.efficiency = std::max(proof.efficiency, relaxed_efficiency(set, report));
  }
  if (shown.has_page()) shown.write_page(constrained_story(set, report), files_of(arguments));
  if (shown.has_table()) {
    shown.print_table(set, design_schedule(set, file.design.weights));
  } else {
    print_request_check(arguments, read, report, proof, options.criterion.kind());
  }
  if (!arguments.json && !shown.has_table()) shown.say_page();
  if (proof.is_exact) {
    const double least = 1.0 / (1.0 + arguments.gap.value_or(kInfinity));
    const bool sound = report.report.certificate.status == CertificateStatus::kCertified;
    return sound && proof.efficiency >= least ? kDone : kShort;
  }
  return report.report.status == ReportStatus::kSolved ? kDone : kShort;
}

// A design, judged with what its file says of floors, limits and objective.
struct JudgedDesign {
  SolveReport report;
  bool limited = false, floored = false;
  std::vector<double> efficiencies;  // under the floors
};

JudgedDesign judge_design(const CheckArguments& arguments, const InformationSet& set,
                          const DesignFile& file, bool with_page) {
  JudgedDesign judged;
  SolveReport& report = judged.report;
  SolveOptions options;
  const Criterion made_for = file.criterion.value_or(Criterion());
  options.criterion = arguments.criterion.read(set).value_or(made_for);
  options.duality_gap = arguments.gap.value_or(file.asked_gap.value_or(options.duality_gap));
  const Solution claim{.design = file.design,
                       .status = claimed_status(file.status),
                       .trace = {},
                       .counters = file.counters,
                       .message = {}};
  report = judge(set, file.solver, options, claim);
  report.problem_hash = set.content_hash();
  judged.floored = !file.floors.empty() && options.criterion == made_for;
  if (judged.floored && with_page) {
    throw InputError(arguments.design +
                     ": was made with --floor, and --report draws no such design");
  }
  if (judged.floored) {
    const FlooredCertificate proof =
        certify_floored(set, file.design, options.criterion, file.floors, options.duality_gap);
    judged.efficiencies = proof.efficiencies;
    report.certificate = proof.certificate;
    report.status = judge(claim.status, options.duality_gap, report.certificate);
    report.message = report.certificate.message;
  }
  judged.limited = file.limits.any() && options.criterion.kind() == CriterionKind::kD;
  if (judged.limited) {
    report.certificate = certify_limited(set, file.design, file.limits);
    report.status = judge(claim.status, options.duality_gap, report.certificate);
    report.message = report.certificate.message;
  }
  if (!(options.criterion == made_for) && report.status == ReportStatus::kClaimedButWrong) {
    report.status = ReportStatus::kInaccurate;  // no claim was made for this criterion
    report.message = fmt::format("made for criterion {}", to_string(made_for.kind()));
  }
  if (!judged.limited && !file.objective.empty() &&
      report.status == ReportStatus::kClaimedButWrong) {
    report.status = ReportStatus::kInaccurate;
    report.message = fmt::format("made for the objective {}", file.objective);
  }
  return judged;
}

void print_check(const ProjectedSet& read, const DesignFile& file, const JudgedDesign& judged,
                 bool json, const DesignOutput& shown) {
  const InformationSet& set = read.set;
  if (json) {
    nlohmann::ordered_json line = to_json(judged.report);
    if (judged.limited) line["limits"] = to_json(file.limits);
    if (judged.floored) line["floors"] = floors_json(set, file.floors);
    for (std::size_t k = 0; k < judged.efficiencies.size(); ++k) {
      line["floors"][k]["efficiency"] = judged.efficiencies[k];
    }
    print_line(read, std::move(line));
    return;
  }
  fmt::print("{}{}", set_headline(read), describe(judged.report));
  if (judged.limited) {
    fmt::print("  limits        {}; the gap is under them\n", describe(file.limits));
  }
  if (judged.floored) fmt::print("{}", describe_floors(file.floors, judged.efficiencies));
  fmt::print("{}", describe_support(set, file.design));
  if (file.problem_hash.empty()) fmt::print("note: the design does not say which set it is for\n");
  shown.say_page();
}

int check(const CheckArguments& arguments, const Invocation& invocation) {
  DesignOutput shown(arguments.shown, invocation.arguments);
  require_design_output(arguments.shown, arguments.json);
  arguments.criterion.require_consistent();
  std::optional<ConstrainedClaim> request = read_constrained_claim(arguments.design);
  if (!request.has_value() && arguments.request.read().any()) request.emplace();
  const bool has_prior =
      arguments.request.has_prior() || (request.has_value() && request->request.has_prior());
  const ProjectedSet read = read_set(
      arguments.set, has_prior ? SingularSum::kAllowed : SingularSum::kRefused, FactorForm::kKept);
  const InformationSet& set = read.set;
  shown.read_robot(set);
  const DesignFile file = read_design(arguments.design, set, WeightCheck::kForChecker);
  const bool other_criterion = arguments.criterion.read(set).has_value();
  if (request.has_value()) return check_request(arguments, read, file, *request, shown);
  const auto exact = read_exact_claim(arguments.design, set, file.design);
  if (exact.has_value() && !other_criterion) {
    return check_exact(arguments, read, file, *exact, shown);
  }
  const JudgedDesign judged = judge_design(arguments, set, file, shown.has_page());
  if (shown.has_page()) {
    shown.write_page(solve_story(set, file.design, judged.report), files_of(arguments));
  }
  if (shown.has_table()) {
    shown.print_table(set, design_schedule(set, file.design.weights));
  } else {
    print_check(read, file, judged, arguments.json, shown);
  }
  return judged.report.status == ReportStatus::kSolved ? kDone : kShort;
}

}  // namespace

void add_check_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("check", "Certify a design, whoever made it");
  auto arguments = std::make_shared<CheckArguments>();
  add_set_options(*command, arguments->set);
  add_factors_option(*command, arguments->set);
  command->add_option("design", arguments->design, "design: graybox-design/1 JSON")->required();
  add_criterion_options(*command, arguments->criterion);
  add_request_options(*command, arguments->request);
  command->add_option("--gap", arguments->gap,
                      "duality gap to hold it to (default: the one the design was asked for)");
  add_design_output_options(*command, arguments->shown);
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit code 0 if the duality gap is proven to be at most the gap asked, rounding included,\n"
      "else 1. An exact design is compared with the best of its number of experiments, and only\n"
      "held to a gap that is given. A design made under limits ('graybox design robust\n"
      "--largest-share', 'graybox design spectrum --position-limit') is held to them and compared\n"
      "with the best that obeys them; so is one made for a request, whose files are read again.\n"
      "Examples:\n"
      "  graybox check set.h5 design.json\n"
      "  graybox check set.h5 design.json --gap 1e-6 --json\n"
      "  graybox check set.h5 design.json --report design.html --format csv\n"
      "  graybox check set.h5 design.json --criterion A      (whatever it was made for)");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = check(*arguments, invocation); });
}

}  // namespace graybox::cli
