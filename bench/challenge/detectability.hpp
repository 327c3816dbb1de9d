// Detectability of a hidden effect, from noise-free data and never from a diagnosis.
//
// Each estimation recording is simulated without noise, without the effect (0) and with it (1).
// With G the frequency response of the true system without the effect, the effect is, at line k,
//
//   e(k) = [Y_1 - G U_1] - [Y_0 - G U_0]
//
// (the second bracket takes out what the base model itself has of non-linearity), and the model's
// fitted parameters theta can take away its part in the span of dG/dtheta U_1. The noise of Y - G U
// is the sensors' noise alone, of known spectrum Phi(k) / P after the mean over P periods. With the
// lines of all recordings whitened by sqrt(2 P / Phi) and stacked as real numbers, r of e and J of
// the derivatives,
//
//   lambda = min_x |r - J x|^2
//
// is the non-centrality of the lack-of-fit statistic after the refit, to first order in the refit.
// Lines: all from the lowest to the highest excited one. An effect is detectable if the chi-square
// test of lack of fit at level 5 %, on all these numbers less the parameters, has 90 % power;
// `directed_noncentrality` (10.5) is what a test aimed at this one effect would need.
//
// The n_u sub-experiments of a set are alike, so the first stands for all: lambda and the count of
// numbers are n_u times those of the first.
#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "bench/challenge/case_system.hpp"

namespace graybox::bench {

inline constexpr double kDetectionLevel = 0.05;
inline constexpr double kDetectionPower = 0.9;
// (z_{0.975} + z_{0.9})^2, one degree of freedom.
inline constexpr double kDirectedNoncentrality = 10.5;

// |r|^2 less its part in the span of J's columns.
[[nodiscard]] double left_over(const Eigen::VectorXd& r, const Eigen::MatrixXd& jacobian);

// The non-centrality at which the chi-square test of this level has this power.
[[nodiscard]] double required_noncentrality(double degrees_of_freedom,
                                            double level = kDetectionLevel,
                                            double power = kDetectionPower);

// The smallest size at which lambda is within 25 % of what is required (so the size to 12 %). It is
// searched by steps of sqrt(lambda) kept within the bracket so far. `lambda_at` is not a number
// where the system can't move with an effect of that size. None up to the largest size, or where
// `keep_going` says no. At most nine calls.
[[nodiscard]] std::optional<double> smallest_detectable_size(
    const std::function<double(double)>& lambda_at, double required, double largest,
    const std::function<bool()>& keep_going = {});

struct ResponseAt {
  Eigen::MatrixXcd response;
  std::vector<Eigen::MatrixXcd> derivatives;  // by the logarithm of each fitted parameter
};

// From inputs held between samples to sampled outputs, exactly: with x' = A x + B u, x = (q, q'),
//
//   G(w) = S (e^(j w T_s) - A_d)^-1 B_d,   [A_d B_d; 0 I] = exp([A B; 0 0] T_s)   (Van Loan 1978).
//
// G without the images of the hold would leave of every gain error what the images make of it, and
// call detectable what the fitted parameters can take up. Derivatives are central differences.
class SampledDynamics {
 public:
  SampledDynamics(const LinearDynamics& dynamics, double sample_time);
  [[nodiscard]] ResponseAt at(double w) const;

 private:
  struct StateSpace {
    Eigen::MatrixXd transition, input, output;
  };
  [[nodiscard]] static StateSpace sampled(const LinearDynamics& dynamics, double sample_time);
  [[nodiscard]] static Eigen::MatrixXcd response(const StateSpace& system,
                                                 std::complex<double> shift);

  double sample_time_;
  StateSpace nominal_;
  std::vector<std::array<StateSpace, 2>> beside_;  // below and above, of each parameter
};

class Detectability {
 public:
  // Simulates the case without effect. Keeps a reference to the system.
  Detectability(const CaseSystem& system, std::uint64_t seed);

  [[nodiscard]] double degrees_of_freedom() const;
  // Simulates with these elements. Throws UnstableMotion, InputError (no rest).
  [[nodiscard]] double noncentrality(const std::vector<Element>& elements) const;
  [[nodiscard]] PlaceScale scale_at(const ChallengePlace& place) const;

 private:
  struct Spectra {
    Eigen::MatrixXcd input, output;  // n x lines
  };
  struct Record {
    ExperimentSet set;
    Spectra without;
    std::vector<ResponseAt> responses;  // by line
  };

  [[nodiscard]] Spectra spectra(const std::vector<Element>& elements,
                                const ExperimentSet& set) const;
  [[nodiscard]] double frequency(std::size_t line) const;  // rad/s
  // Standard deviations of the noise's lines, n_y x lines.
  [[nodiscard]] Eigen::MatrixXd noise() const;

  const CaseSystem* system_;
  std::uint64_t seed_;
  std::size_t first_line_, line_count_;
  std::vector<Record> records_;
};

}  // namespace graybox::bench
