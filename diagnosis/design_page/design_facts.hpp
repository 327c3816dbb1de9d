// Figures of a design that its page shows, from the set and the weights alone.
//
// With G the supergradient of log Phi at M (certificate.hpp), a design is optimal exactly where
// tr(G H_i) <= 1 for every candidate. So these numbers against 1 are the certificate as a picture.
#pragma once

#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox {

// A number with what it means, in one sentence.
struct DesignFact {
  std::string name, value, meaning;
};

// tr(G H_i) for every candidate, G at M = prior + sum_i weights_i H_i, in double precision. The
// prior is a packed lower triangle, or empty. The result is empty where M is singular, and for
// criterion E without a dual matrix, and for G over a region.
[[nodiscard]] std::vector<double> criterion_sensitivities(const InformationSet& set,
                                                          const Design& design,
                                                          const Criterion& criterion,
                                                          const std::vector<double>& prior = {});

// sum_s prices_s tr(M_s^-1 H_si) / d: the same for several samples of the set at once.
[[nodiscard]] std::vector<double> robust_sensitivities(
    const std::vector<const InformationSet*>& samples, const Design& design,
    const std::vector<double>& prices);

// sqrt((M^-1)_kk) with M = prior + sum_i efforts_i H_i: standard errors of the parameters. The
// prior is a packed lower triangle, or empty. Empty where M is singular.
[[nodiscard]] std::vector<double> standard_errors(const InformationSet& set,
                                                  const std::vector<double>& efforts,
                                                  const std::vector<double>& prior = {});

[[nodiscard]] std::vector<DesignFact> facts_of(const SolveReport& report);
[[nodiscard]] std::vector<DesignFact> facts_of(const ExactReport& report);
[[nodiscard]] std::vector<DesignFact> facts_of(const ConstrainedExactReport& report);

}  // namespace graybox
