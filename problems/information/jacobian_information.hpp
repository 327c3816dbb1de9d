// Information matrices of one's own model, from the derivatives of what is measured with respect to
// the parameters.
//
// An experiment measures r outputs y = f(theta) + noise. With the Jacobian J = df/dtheta (r x d) at
// nominal parameters and Gaussian noise of covariance R (r x r), independent between experiments,
// its information matrix is (Fedorov 1972)
//
//   H = J^T R^-1 J.
//
// Generalised linear models (McCullagh and Nelder 1989): y_k has the mean mu(eta_k), eta_k = x_k^T
// theta, where the rows x_k of J are regressors, and
//
//   H = sum_k v(eta_k) x_k x_k^T,   logistic  mu = 1 / (1 + exp(-eta)),  v = mu (1 - mu)
//                                   Poisson   mu = exp(eta),             v = mu.
//
// J and R have the units of outputs over parameters and of outputs squared; H those of one over
// parameters squared.
//
//   Jacobians jacobians{.candidates = 3, .outputs = 1, .parameters = 2,
//                       .values = {1, -1,  1, 0,  1, 1}};              // a straight line
//   const InformationSet set =
//       information_set_from_jacobians(std::move(jacobians), JacobianNoise::deviations({0.1}));
//
// Cost: Q r d (r + d / 2) multiplications, Q d (d + 1) / 2 numbers of memory.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct Jacobians {
  std::size_t candidates = 0;            // Q
  std::size_t outputs = 1;               // r
  std::size_t parameters = 0;            // d
  std::vector<double> values = {};       // Q x r x d, row-major
  std::vector<std::string> names = {};   // of the parameters; empty or d
  CandidateTable table = {};             // coordinates of the candidates; empty or Q rows
  std::string source = "the Jacobians";  // for messages
};

// What the noise of r outputs is, as a matrix W with R^-1 = W^T W.
class JacobianNoise {
 public:
  // Independent outputs. Throws InputError unless each is positive and finite.
  [[nodiscard]] static JacobianNoise deviations(std::span<const double> deviations);
  // R, r x r row-major. Throws InputError unless it is symmetric to 1e-12 and positive definite.
  [[nodiscard]] static JacobianNoise covariance(std::span<const double> matrix,
                                                std::size_t outputs);

  [[nodiscard]] std::size_t outputs() const { return outputs_; }
  // W, r x r row-major, lower triangular.
  [[nodiscard]] std::span<const double> whitening() const { return whitening_; }

 private:
  std::size_t outputs_ = 0;
  std::vector<double> whitening_;
};

// H of one Jacobian (r x d row-major), packed (packed_matrix.hpp).
[[nodiscard]] std::vector<double> information(std::span<const double> jacobian,
                                              std::size_t parameters, const JacobianNoise& noise);

// In factor form the set holds W J, r d numbers a candidate, and no matrix is made.
//
// Throws InputError where sizes do not fit or a number is not finite. That the sum of all matrices
// is regular is left to InformationSet::validate().
[[nodiscard]] InformationSet information_set_from_jacobians(Jacobians jacobians,
                                                            const JacobianNoise& noise,
                                                            SetForm form = SetForm::kMatrices);

enum class GeneralisedLinearModel { kLogistic, kPoisson };

// v(eta).
[[nodiscard]] double information_weight(GeneralisedLinearModel model, double linear_predictor);

// theta: d nominal parameters. Throws as above, and where v overflows or vanishes for all rows.
[[nodiscard]] InformationSet generalised_linear_set(Jacobians regressors,
                                                    GeneralisedLinearModel model,
                                                    std::span<const double> theta,
                                                    SetForm form = SetForm::kMatrices);

}  // namespace graybox
