// Substitution that is slow or runs away, made to converge: the combination of its last passes,
// with weights of sum one, whose changes cancel best (Anderson 1965; Walker and Ni, SIAM J. Numer.
// Anal. 49, 2011).
//
//   x_i -> g_i = G(x_i),   min |sum_i w_i c_i|,   the next x = sum_i w_i g_i,
//
// c_i: what the pass changed, g_i - x_i, as the one who asks sees it (outputs in noise units). With
// one pass the next x is g. Cost: O(n m^2) for n entries of c and m passes remembered.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace graybox {

class AndersonMixing {
 public:
  explicit AndersonMixing(std::size_t remembered) : remembered_(remembered) {}

  // A pass, all of the same shapes; the oldest is forgotten.
  void add(Eigen::MatrixXcd reached, Eigen::VectorXcd change);
  // After one pass at least.
  [[nodiscard]] Eigen::MatrixXcd mixed() const;

 private:
  std::size_t remembered_;
  std::vector<Eigen::MatrixXcd> reached_;
  std::vector<Eigen::VectorXcd> changes_;
};

}  // namespace graybox
