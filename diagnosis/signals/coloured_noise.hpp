// Noise whose samples follow each other, as an autoregressive model of the residuals of a fit: how
// much they are worth, and draws of the like.
//
//   e_t = sum over k = 1..P of a_k e_(t-k) + innovation
//
// by the Yule-Walker equations (Levinson and Durbin), P <= 10 log10(n) with the least n
// ln(innovation variance) + P ln n.
#pragma once

#include <Eigen/Core>

#include "problems/base/random.hpp"

namespace graybox {

class ColouredNoise {
 public:
  // At least 20 values at even times.
  explicit ColouredNoise(const Eigen::VectorXd& values);

  [[nodiscard]] Eigen::Index order() const { return coefficients_.size(); }
  // Variance of what one step ahead is not predicted, over that of the values.
  [[nodiscard]] double innovation_share() const { return innovation_; }
  // n over the autocorrelation time, spectrum at zero / variance, of the model; at most n.
  [[nodiscard]] double effective_samples() const;
  // As many values, of the values' root mean square.
  [[nodiscard]] Eigen::VectorXd draw(Random& random) const;

 private:
  Eigen::Index samples_;
  double deviation_ = 0.0;   // of the values
  double innovation_ = 1.0;  // variance of the innovations over that of the values
  Eigen::VectorXd coefficients_;
};

}  // namespace graybox
