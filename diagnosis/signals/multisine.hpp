// Orthogonal random-phase multisines: the references of the n_u sub-experiments from which one
// frequency response of n_u inputs is estimated (paper, Section VI-B; Dobrowiecki and Schoukens
// 2007).
//
// Sub-experiment e excites input a at DFT line k of the period with
//
//   R_ae(k) = A(k) exp(j phi_a(k)) T_ae,   T_ae = exp(2 pi j a e / n_u) / sqrt(n_u), T T^H = I,
//
// random phases phi_a(k), uniform on the circle, the same in all sub-experiments. So R R^H = A(k)^2
// I at every excited line, with equal power on all inputs; graybox writes A(k)^2 = Phi_r / n_y
// (frequency_response.hpp). DFT here: X(k) = N^(-1/2) sum_t x(t) exp(-2 pi j k t / N).
//
//   const Multisine signal({.period = 8000, .lines = odd_lines(...), .inputs = 6, .rms = 3.0}, 1);
//   signal.reference(e)      // n_u x period, repeated without end
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace graybox {

struct MultisineOptions {
  std::size_t period = 0;                    // samples N
  std::vector<std::size_t> lines;            // excited DFT lines, 1 ... N/2 - 1, increasing
  std::vector<double> relative_amplitude{};  // one for each line; empty: all equal
  Eigen::Index inputs = 1;                   // n_u
  double rms = 1.0;                          // of each input in each sub-experiment
  std::size_t phase_draws = 1;  // of so many random phases the least crest factor is taken,
  double crest_limit = 0.0;     // or the first that is within this limit; 0: no limit
};

class Multisine {
 public:
  // Throws InputError for a line out of range or given twice, no lines, a wrong number of
  // amplitudes, or where no draw of the phases keeps the crest limit.
  Multisine(const MultisineOptions& options, std::uint64_t seed);

  [[nodiscard]] std::size_t period() const { return options_.period; }
  [[nodiscard]] Eigen::Index sub_experiments() const { return options_.inputs; }
  [[nodiscard]] const std::vector<std::size_t>& lines() const { return options_.lines; }
  // A(k) of each line, in the DFT scaling above.
  [[nodiscard]] const std::vector<double>& amplitudes() const { return amplitudes_; }
  // One period of one sub-experiment: n_u x N.
  [[nodiscard]] const Eigen::MatrixXd& reference(Eigen::Index sub_experiment) const {
    return references_[static_cast<std::size_t>(sub_experiment)];
  }
  // max |r| / rms over all inputs and sub-experiments.
  [[nodiscard]] double crest_factor() const { return crest_factor_; }

 private:
  MultisineOptions options_;
  std::vector<double> amplitudes_;
  std::vector<Eigen::MatrixXd> references_;
  double crest_factor_ = 0.0;
};

// The odd lines nearest to increasing frequencies (Hz), each once: with a period too short to tell
// two frequencies apart there are fewer lines than frequencies. Even lines and the odd ones left
// out detect non-linearity.
[[nodiscard]] std::vector<std::size_t> odd_lines(const std::vector<double>& frequencies,
                                                 std::size_t period, double sample_time);

}  // namespace graybox
