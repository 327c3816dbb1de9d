// ExchangeDesign: a design of small support together with the factor of its information matrix, and
// the moves from which vertex-direction and exchange methods are made. Each move is an exact line
// search (log_det_line.hpp), so log det M never falls.
//
//   exchange   lambda_to += a, lambda_from -= a                     M + a (H_to - H_from)
//   vertex     lambda <- (1 - a) lambda + a e_i                     M + a (H_i - M)
//   reweigh    lambda_i <- lambda_i w_i / d on the support          (monotone: Titterington 1976)
//
// M is updated by the move and factored anew, O(d^3). This is as cheap as updating the inverse and
// leaves no error in it. M itself is summed anew from the weights by refresh(), once an iteration,
// so that rounding does not build up. The factor is that of M scaled to unit diagonal.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exchange/log_det_line.hpp"

namespace graybox {

class ExchangeDesign {
 public:
  explicit ExchangeDesign(const InformationSet& set);

  // Equal weights on the candidates listed; one listed k times has k shares. False if M is
  // singular.
  [[nodiscard]] bool assign(std::span<const std::size_t> candidates);
  // The weights given, one for each candidate. False if M is singular.
  [[nodiscard]] bool assign_weights(std::span<const double> weights);

  // Sums M from the weights, scaled to total 1, and factors it. False if M is singular.
  // Reads the candidates of the support.
  [[nodiscard]] bool refresh();

  [[nodiscard]] const std::vector<double>& weights() const { return weights_; }
  [[nodiscard]] double weight(std::size_t i) const { return weights_[i]; }
  [[nodiscard]] const std::vector<std::size_t>& support() const { return support_; }
  [[nodiscard]] double log_det() const { return factor_.log_det(); }

  // M^-1 in trace-dual packing, for pricing many candidates, and w_i = tr(M^-1 H_i) of one.
  [[nodiscard]] std::span<const double> trace_dual() const { return factor_.trace_dual(); }
  [[nodiscard]] double sensitivity(std::size_t i) const;
  // How well the sensitivities are known (claim.hpp).
  [[nodiscard]] double gap_rounding() const;

  struct Move {
    double step = 0.0;        // 0: nothing was gained, and nothing changed
    bool nullifying = false;  // one of the two candidates lost all its weight
  };

  // The best exchange between two candidates, in either direction. With only_nullifying it is
  // carried out only if it is nullifying.
  Move exchange(std::size_t to, std::size_t from, bool only_nullifying = false);

  // The best step towards candidate i (a > 0) or, if i is in the support, away from it (a < 0).
  Move step_to_vertex(std::size_t i);

  // One multiplicative step on the support and refresh(). False if M is singular after it.
  [[nodiscard]] bool reweigh();

  // Candidates read by all moves, and by others who say so, since the last call of take: for
  // Tracer::count_candidates.
  void note_candidates_read(std::size_t count) { candidates_read_ += count; }
  [[nodiscard]] std::size_t take_candidates_read();

 private:
  void clear();
  void set_weight(std::size_t i, double weight);
  void set_line(std::span<const double> packed_direction, double shift);
  bool accept(double step, std::span<const double> packed_direction);

  const InformationSet& set_;
  std::vector<double> weights_;
  std::vector<std::size_t> support_;
  std::vector<std::size_t> place_;   // of each candidate in support_, or kNowhere
  std::vector<double> information_;  // M, packed
  InverseCholesky factor_;
  LogDetLine line_;
  std::vector<double> direction_;  // packed
  std::vector<double> former_;     // packed
  std::vector<double> full_, product_;
  std::vector<double> next_;
  std::size_t candidates_read_ = 0;
};

// Where the sensitivities are extreme: what an iteration of these methods starts from.
struct Extremes {
  std::size_t largest = 0;   // over all candidates
  std::size_t smallest = 0;  // over the support
  double largest_sensitivity = 0.0;
  double smallest_sensitivity = 0.0;
};

// Prices all candidates (out: Q numbers) and finds both.
[[nodiscard]] Extremes price_all(const InformationSet& set, const ExchangeDesign& design,
                                 std::span<double> out);

}  // namespace graybox
