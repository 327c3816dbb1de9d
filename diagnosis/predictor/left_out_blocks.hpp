// Two fits compared by what each says of blocks that it was not fitted to.
//
// With r and J of a fit, H = J'J, the residuals of block b without block b are, to first order,
//
//   r_b + J_b (H - J_b'J_b)^-1 J_b'r_b,
//
// (`prior` on the diagonal of H keeps a parameter that hardly anything determines from running away
// when a block goes: the weak belief that it is known to a unit of its coordinate),
//
// in closed form, no refit (as PRESS of linear regression: Allen, Technometrics 16, 1974). To first
// order only: a parameter that hardly any other block determines would run away. Two things keep
// it: a weak prior (a unit of its coordinate, so variance on the diagonal of H), and a limit of 4
// standard deviations a parameter for the step d, d'H d <= 16 p variance. With RSS_b of both fits
// and n_b rows,
//
//   d_b = (n_b / 2) (log RSS_b(poorer) - log RSS_b(richer)),   z = mean(d) / sqrt(V / B),
//
// V the long-run variance of d over neighbouring blocks (Newey and West, Econometrica 55, 1987,
// lags 1 and 2). The logarithm of each block keeps a loud one from deciding.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

inline constexpr Eigen::Index kLeftOutBlocks = 24;  // at most

// First rows of blocks, and the number of rows behind the last.
using BlockEdges = std::vector<Eigen::Index>;
// Divides the rows into so many blocks of whole units. A unit is a window of a predictor, whose
// errors follow each other.
// `unit_starts`: first row of each unit.
[[nodiscard]] BlockEdges block_edges(const std::vector<Eigen::Index>& unit_starts,
                                     Eigen::Index rows);

// Sums of squares of each block without it. The last `local` columns are of what one block alone
// tells (initial states): they are fitted with all blocks. `variance`: of a residual; 0: neither
// prior nor limit.
[[nodiscard]] Eigen::VectorXd left_out_squares(const Eigen::VectorXd& residuals,
                                               const Eigen::MatrixXd& jacobian,
                                               const BlockEdges& edges, Eigen::Index local,
                                               double variance);

// z of the richer over the poorer, from both left_out_squares(). `rows` a block. With few blocks
// the ratio follows Student's t: z is the normal quantile of the same probability (Abramowitz and
// Stegun, 26.7.8).
[[nodiscard]] double left_out_z(const Eigen::VectorXd& poorer, const Eigen::VectorXd& richer,
                                double rows);

}  // namespace graybox
