#include "solvers/robust/robust_problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/error.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/conditioning/extended_information.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string name_of(const RobustProblem& problem, std::size_t s) {
  const std::string& name = problem.samples[s]->name();
  return name.empty() ? fmt::format("sample {}", s) : name;
}

// 1/N for the average; the given ones, made fit, for the worst case.
std::vector<double> usable_prices(const RobustProblem& problem, const std::vector<double>& given) {
  const std::size_t count = problem.samples.size();
  const std::vector<double> equal(count, 1.0 / static_cast<double>(count));
  if (problem.objective == RobustObjective::kAverage || given.size() != count) return equal;
  std::vector<double> prices(count);
  for (std::size_t s = 0; s < count; ++s) {
    prices[s] = given[s] > 0.0 && std::isfinite(given[s]) ? given[s] : 0.0;
  }
  const double sum = std::accumulate(prices.begin(), prices.end(), 0.0);
  if (!(sum > 0.0) || !std::isfinite(sum)) return equal;
  for (double& price : prices) price /= sum;
  return prices;
}

// The largest sum_s pi_s w_{s,i}, and a bound on its error.
struct Pricing {
  Extended largest = 0;
  Extended error = 0;
  std::size_t candidate = 0;
};

Pricing price(const RobustProblem& problem, const std::vector<double>& prices,
              const std::vector<ExtendedInformation>& information) {
  std::vector<Extended> sensitivity(problem.first().candidate_count(), Extended{0});
  Extended residual = 0;
  for (std::size_t s = 0; s < prices.size(); ++s) {
    if (prices[s] == 0.0) continue;
    residual = std::max(residual, information[s].residual());
    for (std::size_t i = 0; i < sensitivity.size(); ++i) {
      sensitivity[i] += prices[s] * information[s].sensitivity(problem.samples[s]->information(i));
    }
  }
  Pricing pricing;
  const auto largest = std::ranges::max_element(sensitivity);
  pricing.largest = *largest;
  pricing.candidate = static_cast<std::size_t>(largest - sensitivity.begin());
  Extended magnitude = 0;
  for (std::size_t s = 0; s < prices.size(); ++s) {
    if (prices[s] == 0.0) continue;
    magnitude +=
        prices[s] * information[s].magnitude(problem.samples[s]->information(pricing.candidate));
  }
  const Extended unit =
      information.front().trace_unit() +
      static_cast<Extended>(prices.size()) * std::numeric_limits<Extended>::epsilon();
  pricing.error = pricing.largest * residual / (1 - residual) + unit * magnitude;
  return pricing;
}

}  // namespace

std::string_view to_string(RobustObjective objective) {
  return objective == RobustObjective::kAverage ? "average" : "worst_case";
}

RobustObjective robust_objective(std::string_view name) {
  for (const auto objective : {RobustObjective::kAverage, RobustObjective::kWorstCase}) {
    if (name == to_string(objective)) return objective;
  }
  throw InputError(fmt::format("unknown objective '{}'; choose average or worst_case", name));
}

void require_shared_candidates(const RobustProblem& problem) {
  if (problem.samples.empty()) {
    throw InputError("a robust design needs at least one information set");
  }
  const InformationSet& first = problem.first();
  for (std::size_t s = 1; s < problem.samples.size(); ++s) {
    const InformationSet& set = *problem.samples[s];
    if (set.candidate_count() != first.candidate_count() || set.dimension() != first.dimension()) {
      throw InputError(fmt::format(
          "{} has {} candidates and {} parameters, but {} has {} and {}; samples must share them",
          name_of(problem, s), set.candidate_count(), set.dimension(), name_of(problem, 0),
          first.candidate_count(), first.dimension()));
    }
    const auto& ours = set.candidates().values;
    const auto& theirs = first.candidates().values;
    if (!ours.empty() && !theirs.empty() && ours != theirs) {
      throw InputError(fmt::format("{} lists other candidates than {}; samples must share them",
                                   name_of(problem, s), name_of(problem, 0)));
    }
  }
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!problem.references.empty() && (problem.references.size() != problem.samples.size() ||
                                      !std::ranges::all_of(problem.references, finite))) {
    throw InputError(fmt::format("{} references given for {} samples; one finite number each",
                                 problem.references.size(), problem.samples.size()));
  }
}

SampleOptima sample_optima(const std::vector<const InformationSet*>& samples,
                           const SolveOptions& options,
                           const std::function<void(std::size_t)>& on_sample) {
  SampleOptima optima;
  const ColumnGeneration solver;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    Solution solution = solver.solve(*samples[s], options);
    if (solution.status != SolveStatus::kSolved && optima.status == SolveStatus::kSolved) {
      optima.status = solution.status;
      optima.message =
          fmt::format("the optimum of sample {}: {}", s,
                      solution.message.empty() ? to_string(solution.status) : solution.message);
    }
    if (solution.status == SolveStatus::kUnsupported) return optima;
    const Certificate certificate = certify(*samples[s], solution.design);
    optima.duality_gap = std::max(optima.duality_gap, certificate.duality_gap);
    optima.log_det.push_back(certificate.log_det);
    optima.designs.push_back(std::move(solution.design));
    if (on_sample) on_sample(s + 1);
  }
  return optima;
}

RobustCertificate certify_robust(const RobustProblem& problem, const Design& design,
                                 const std::vector<double>& prices) {
  RobustCertificate answer;
  Certificate& certificate = answer.certificate;
  certificate.duality_gap = certificate.log_det_gap = certificate.rounding_bound = kInfinity;
  certificate.log_det = -kInfinity;
  const CheckedWeights checked(problem.first(), design);
  certificate.support_size = checked.support_size;
  certificate.clipped = checked.clipped;
  certificate.renormalised = checked.renormalised;
  certificate.message = checked.message;
  if (!certificate.message.empty()) return answer;

  std::vector<ExtendedInformation> information;
  const std::size_t count = problem.samples.size();
  for (std::size_t s = 0; s < count; ++s) {
    information.emplace_back(*problem.samples[s], checked.weights);
    if (information.back().regular()) continue;
    certificate.status = CertificateStatus::kSingular;
    certificate.message = fmt::format(
        "the design's information matrix is singular under {}: it can't estimate all parameters",
        name_of(problem, s));
    answer.worst_sample = s;
    return answer;
  }

  answer.prices = usable_prices(problem, prices);
  Extended mean = 0, smallest = kInfinity;
  for (std::size_t s = 0; s < count; ++s) {
    const Extended value = information[s].log_det() - problem.reference(s);
    answer.log_det.push_back(static_cast<double>(information[s].log_det()));
    mean += answer.prices[s] * value;
    if (value < smallest) {
      smallest = value;
      answer.worst_sample = s;
    }
  }
  const bool average = problem.objective == RobustObjective::kAverage;
  const Extended objective = average ? mean : smallest;
  const Pricing pricing = price(problem, answer.prices, information);
  const auto d = static_cast<Extended>(problem.first().dimension());
  const Extended spread = std::exp(std::max((mean - objective) / d, Extended{0}));
  const Extended gap = pricing.largest / d * spread - 1;

  certificate.status = CertificateStatus::kCertified;
  certificate.log_det = certificate.criterion_value = static_cast<double>(objective);
  certificate.worst_candidate = pricing.candidate;
  certificate.duality_gap = static_cast<double>(gap);
  // Prices sum to one, and log dets are known, to double precision at least.
  const Extended scale = 1 + std::abs(mean) + std::abs(objective);
  certificate.rounding_bound = static_cast<double>(
      pricing.error / d * spread +
      (1 + std::abs(gap)) * 4 * std::numeric_limits<double>::epsilon() * (average ? 1 : scale));
  state_bounds(static_cast<double>(d), certificate);
  return answer;
}

}  // namespace graybox
