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
//
// This z asks whether another block would gain. So it is small where a law acts in a few blocks
// only, as a delay does at the few jumps of a drive, however sure it is there. Where the richer
// model is the poorer with a law more, the motion can be taken as given. With l and m the
// residuals of the poorer and the richer, left out, block b gains (l_b - m_b)'(l_b + m_b). Only
// what noise does to that counts as its error:
//
//   u_b = 2 (l_b - m_b)'m_b,   z = sum over b of (l_b - m_b)'(l_b + m_b) / sqrt(V_u),
//
// V_u the long-run variance of the sum of u, about zero. Blocks are finer here. Few of them may
// hold nearly all of V_u: then the ratio follows Student's t with (sum u^2)^2 / sum u^4 degrees of
// freedom. (As White, Econometrica 48, 1980, for errors of changing size.)
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

inline constexpr Eigen::Index kLeftOutBlocks = 24, kFineBlocks = 960;  // at most

// First rows of blocks, and the number of rows behind the last.
using BlockEdges = std::vector<Eigen::Index>;
// Divides the rows into so many blocks of whole units. A unit is a window of a predictor, whose
// errors follow each other.
// `unit_starts`: first row of each unit.
[[nodiscard]] BlockEdges block_edges(const std::vector<Eigen::Index>& unit_starts,
                                     Eigen::Index rows, Eigen::Index most_blocks = kLeftOutBlocks);

// Each block's residuals without it. The last `local` columns are of what one block alone
// tells (initial states): they are fitted with all blocks. `variance`: of a residual; 0: neither
// prior nor limit.
[[nodiscard]] Eigen::VectorXd left_out_residuals(const Eigen::VectorXd& residuals,
                                                 const Eigen::MatrixXd& jacobian,
                                                 const BlockEdges& edges, Eigen::Index local,
                                                 double variance);
// Sums of squares of each block.
[[nodiscard]] Eigen::VectorXd block_squares(const Eigen::VectorXd& residuals,
                                            const BlockEdges& edges);

// z of the richer over the poorer, from the squares of both, left out. `rows` a block. With few
// blocks the ratio follows Student's t: z is the normal quantile of the same probability
// (Abramowitz and Stegun, 26.7.8).
[[nodiscard]] double left_out_z(const Eigen::VectorXd& poorer, const Eigen::VectorXd& richer,
                                double rows);

// z of what the richer has more, the motion as given, from the residuals of both, left out.
[[nodiscard]] double added_z(const Eigen::VectorXd& poorer, const Eigen::VectorXd& richer,
                             const BlockEdges& edges);

}  // namespace graybox
