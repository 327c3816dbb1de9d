// Least squares of a force balance with columns of laws beside those of the model, many times over:
// the model's columns are compressed once.
//
// Rows of coordinate j are divided by a noise s_j of their own (weighted_regression.hpp). Let the
// model's columns be W = Q R, Q^T Q = I. A fit with laws' columns L then needs of the samples only
// the products of L with Q, L and the force, by coordinate and block. Noise iterations and
// cross-validation work on these (Frisch and Waugh 1933; the normal equations of an orthonormal Q
// lose nothing).
//
// Parameters of the model with a prior (ForceBalanceRows::model_precision) have a row more each,
// the precision's root over the parameter, which belongs to no block: [W; root] = [Q; G] R.
//
// The s_j are the most likely ones: those of the least sum of ln s_j. It may have several minima,
// for where a law is missing, what coordinates share suits some of them or the others. So the
// iteration starts from the s_j of the model alone, and once for each coordinate with that
// coordinate all but left out.
//
// Blocks are contiguous tenths of the recordings, which predict each other in cross-validation: of
// each coordinate tenths of the samples that count there, so that one that often rests has as many
// to be judged by as the others. Where recordings carry different loads, a block has a tenth of
// each load's.
//
// Cost: O(N p^2) once, O(N p m) a fit with m columns, O((B + n) (p + m)^3) for B blocks and n
// coordinates.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"

namespace graybox {

struct BalanceFit {
  bool full_rank = false;      // else nothing below is set
  Eigen::VectorXd model;       // parameters of the model's columns
  Eigen::VectorXd amplitudes;  // of the laws' columns
  Eigen::VectorXd noise;       // s_j
  Eigen::MatrixXd residuals;   // samples x coordinates
  Eigen::MatrixXd
      held_out;  // mean squared error of each block (rows) in each coordinate, predicted
                 // by the others; not finite where they don't determine the parameters
};

class BalanceRegression {
 public:
  static constexpr Eigen::Index kBlocks = 10;

  // `rows` must outlive it. The model's columns must be independent. With `noise` the noise of the
  // model alone is not asked for.
  explicit BalanceRegression(const ForceBalanceRows& rows);
  BalanceRegression(const ForceBalanceRows& rows, Eigen::VectorXd noise);

  // s_j of the model alone, or those given.
  [[nodiscard]] const Eigen::VectorXd& noise() const { return noise_; }
  [[nodiscard]] BalanceFit fit(std::span<const BalanceColumns> laws) const;

 private:
  friend class BalanceProjection;
  // Products of [Q, force] with themselves in one block and coordinate.
  struct Products {
    Eigen::MatrixXd basis;
    Eigen::VectorXd basis_force;
    double force = 0.0;
  };
  struct System;  // of one fit
  struct Settled;

  [[nodiscard]] Eigen::Index coordinates() const { return rows_.coordinates(); }
  [[nodiscard]] std::size_t index(Eigen::Index block, Eigen::Index coordinate) const {
    return static_cast<std::size_t>(block * coordinates() + coordinate);
  }
  void cut_into_blocks();
  void cut_into_blocks(Eigen::Index coordinate);
  void compress();
  [[nodiscard]] double counted(Eigen::Index block, Eigen::Index coordinate) const;
  // [Q; G] for this noise.
  [[nodiscard]] Eigen::MatrixXd basis(const Eigen::VectorXd& noise) const;
  [[nodiscard]] Eigen::MatrixXd prior_rows() const;
  [[nodiscard]] System system(std::span<const BalanceColumns> laws) const;
  void settle(const System& system, int iterations, Settled& state) const;
  [[nodiscard]] Settled settled(const System& system) const;
  [[nodiscard]] Eigen::MatrixXd residuals(std::span<const BalanceColumns> laws,
                                          const BalanceFit& fit) const;
  [[nodiscard]] Eigen::MatrixXd predicted_by_others(const System& system,
                                                    const Settled& state) const;

  const ForceBalanceRows& rows_;
  Eigen::VectorXd noise_;
  Eigen::MatrixXd basis_;     // Q, coordinate after coordinate
  Eigen::MatrixXd prior_;     // G; no rows where no parameter has a prior
  Eigen::MatrixXd triangle_;  // R
  Eigen::VectorXd scaled_force_;
  struct Rows {
    Eigen::Index first = 0, count = 0;
  };
  std::vector<std::vector<Rows>> blocks_;  // by block and coordinate, index()
  std::vector<Products> products_;
};

// Rows over a noise of one's own, less what the model's columns imitate there. Coordinates follow
// one another; after them come the rows of the prior, if there are any. Cost: O(N p m) for m
// columns.
class BalanceProjection {
 public:
  // `regression` must outlive it.
  BalanceProjection(const BalanceRegression& regression, const Eigen::VectorXd& noise);

  [[nodiscard]] Eigen::MatrixXd columns(const BalanceColumns& columns) const;
  [[nodiscard]] const Eigen::VectorXd& force() const { return force_; }

 private:
  const BalanceRegression& regression_;
  Eigen::VectorXd noise_;
  Eigen::VectorXd weights_;             // W: the regression's noise over this one
  Eigen::LLT<Eigen::MatrixXd> normal_;  // Q^T W^2 Q
  Eigen::VectorXd force_;
};

// Root mean squares by coordinate, of the samples that count; none is zero.
[[nodiscard]] Eigen::VectorXd rms_of(const ForceBalanceRows& rows,
                                     const Eigen::MatrixXd& residuals);

// Sum of squares about the mean of each column; about zero of one that never changes.
[[nodiscard]] double centred_square(const Eigen::MatrixXd& values);

// Puts columns to the right of those that are there.
void append_columns(const Eigen::MatrixXd& more, Eigen::MatrixXd& columns);

// Adds what an orthonormal basis lacks of each column; whether more than 1e-5 of its length was
// left.
[[nodiscard]] std::vector<bool> extend_basis(const Eigen::MatrixXd& columns,
                                             Eigen::MatrixXd& basis);

}  // namespace graybox
