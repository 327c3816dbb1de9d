// The score test of one more term in a model that has been fitted: would it explain the residuals?
// No refit is needed, so a whole catalogue of terms is ranked from one fit (Rao 1948; the form for
// least squares is in Seber and Wild 1989, Section 5.9).
//
// Residuals r are whitened (covariance I where the noise is known, s^2 I otherwise), J are the
// derivatives of the fitted parameters ("nuisance") and A those of the m amplitudes of a candidate
// term at zero, all whitened alike. With F = J^T J,
//
//   g = A^T r - A^T J F^-1 J^T r,      S = A^T A - A^T J F^-1 J^T A,
//   score statistic g^T S^-1 g ~ chi-square with m degrees of freedom where nothing is missing,
//
// and S^-1 g estimates the amplitudes to first order, with covariance S^-1. Only these products are
// needed, so the rows of A may be computed and forgotten piece by piece.
//
// Many candidates. The smallest of many p-values is not uniform, and candidates depend on each
// other. Its distribution is found by drawing. The `scores` of a block hold A^T r in the first
// column and A^T e in the others, e pure noise, the same draws for all blocks. The function
// minimum_p_values() gives the least p-value of each draw. Reject at level alpha where the data's
// least is below their alpha quantile.
//
// Cost: O(m^2 p + m p (1 + draws)) a candidate after O(p^3) once.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace graybox {

struct NuisanceProducts {
  Eigen::MatrixXd information;  // J^T J, p x p; p may be 0
  Eigen::MatrixXd scores;       // J^T [r, e_1, e_2, ...], p x (1 + draws)
};

struct CandidateProducts {
  Eigen::MatrixXd information;  // A^T A, m x m
  Eigen::MatrixXd nuisance;     // A^T J, m x p
  Eigen::MatrixXd scores;       // A^T [r, e_1, e_2, ...], m x (1 + draws)
};

struct CandidateScore {
  double statistic = 0.0;
  double degrees_of_freedom = 0.0;  // rank of S; 0: the fitted parameters imitate the term wholly
  double p_value = 1.0;
  Eigen::VectorXd amplitudes;            // S^-1 g
  Eigen::MatrixXd amplitude_covariance;  // S^-1 (pseudo-inverse)
};

struct ResidualScale {
  // Known noise: none. Otherwise r^T r of the residuals and their degrees of freedom n - p: the
  // variance is estimated and p-values are those of Fisher's F.
  std::optional<double> squared_sum;
  double degrees_of_freedom = 0.0;
};

class ScoreTest {
 public:
  // Throws InputError for sizes that do not agree.
  ScoreTest(NuisanceProducts nuisance, const ResidualScale& scale = {});

  [[nodiscard]] CandidateScore score(const CandidateProducts& candidate) const;
  // Whether a term can have these amplitudes: friction can't drive.
  using IsPossible = std::function<bool(const Eigen::VectorXd& amplitudes)>;
  // Lowers minima[b] to the candidate's p-value in draw b, if that is smaller and the amplitudes
  // found there are possible. What the data must meet the draws must meet, or one-sided terms are
  // tested at half the level.
  void lower_minimum_p_values(const CandidateProducts& candidate, const IsPossible& is_possible,
                              std::span<double> minima) const;

 private:
  struct Projected {
    Eigen::MatrixXd root;    // rows u with u^T u = S^+: whitened amplitudes = root * g
    Eigen::MatrixXd scores;  // g of the data and of every draw
  };
  [[nodiscard]] Projected project(const CandidateProducts& candidate) const;
  [[nodiscard]] double p_value(double statistic, double degrees_of_freedom, bool drawn) const;

  NuisanceProducts nuisance_;
  ResidualScale scale_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor_;
  Eigen::VectorXd unit_;  // 1 / sqrt of the information's diagonal
};

// The `level` quantile of the draws' minima; a p-value below it is a detection at that family-wise
// level. Between order statistics k and k + 1 of n draws: the value at which (k + 1) / (n + 1) of
// them are exceeded, so that the level is met in the mean for every n >= 1 / level - 1. Throws
// InputError for fewer draws.
[[nodiscard]] double family_threshold(std::span<const double> minima, double level);

// How alike two candidates look through the data: the largest canonical correlation squared of
// their columns after the nuisance parameters have been taken out; 1 where one imitates the other.
// `cross` is A_1^T A_2.
[[nodiscard]] double canonical_correlation_squared(const NuisanceProducts& nuisance,
                                                   const CandidateProducts& first,
                                                   const CandidateProducts& second,
                                                   const Eigen::MatrixXd& cross);

}  // namespace graybox
