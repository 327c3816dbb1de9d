#include "diagnosis/periodic/cleared_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "diagnosis/free_motion/transients.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {
namespace {

constexpr int kRounds = 10;

// In standard errors of the second fit.
double largest_move(const PeriodicFit& from, const PeriodicFit& to) {
  const Eigen::VectorXd errors = standard_errors(to.information);
  const Eigen::VectorXd moves = (values_of(to) - values_of(from)).cwiseAbs();
  double largest = 0.0;
  for (Eigen::Index p = 0; p < moves.size(); ++p) {
    if (errors(p) > 0.0) largest = std::max(largest, moves(p) / errors(p));
  }
  return largest;
}

}  // namespace

ClearedFit fit_and_clear_transients(const PlantFamily& family, const PeriodicFit& near,
                                    const PeriodicDataOptions& options,
                                    const PeriodicFitOptions& how, double at_rest,
                                    PeriodicData& data) {
  ClearedFit result{near, 0, std::numeric_limits<double>::infinity()};
  while (result.rounds < kRounds && result.moved > at_rest) {
    const ModelState model =
        evaluate_model(family, data, result.fit.parameters, result.fit.laws, false, how.threads);
    clear_transients(family, model, options, data);
    PeriodicFit next = fit_periodic(family, data, {result.fit.parameters}, result.fit.laws, how);
    if (next.parameters.size() == 0) {
      result.fit.converged = false;
      break;
    }
    result.moved = largest_move(result.fit, next);
    result.fit = std::move(next);
    ++result.rounds;
    if (!result.fit.converged) break;
  }
  return result;
}

}  // namespace graybox
