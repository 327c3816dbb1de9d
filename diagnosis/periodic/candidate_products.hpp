// Score tests of many laws at many places: the products of their columns with the residuals, the
// parameters' derivatives and each other, one recording after the other.
//
// A column is what the law does to the whitened outputs, under the motion at its place, in first
// order: the answer of the outputs to a force there (n_y numbers a line) times the force's lines.
// So all products go through what the place sees of the others (answer^H times them, one number a
// line), and cost O(K) a column instead of O(n_y K).
//
// Columns are not decorrelated (common_error.hpp); what they are multiplied with is, twice, and
// among themselves they lose what they have in common with the directions of the common error:
// Cov^-1 = 1 - W W^T.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"

namespace graybox {

// Whether a law's column is worth taking from the motion as measured. What a gain error does is
// proportional to it whatever its size, and often to what the parameters do: the model's own
// motion, which has nothing of the residuals in it, gives that exactly. What a saturation has cut
// off is not in the measured signal any more.
[[nodiscard]] bool may_follow_data(const LawEntry& entry);

// One law at one place, with the shapes that are tried.
struct Candidate {
  std::size_t hypothesis = 0;
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;
  std::vector<LawShape> shapes;
  std::size_t first_column = 0;  // of its basis functions among all
  std::size_t block = 0;         // of candidates that share a motion
};

// Products of the parameters' columns under the motion that one block of candidates goes with.
struct BlockSums {
  Eigen::MatrixXd information;  // parameters x parameters
  Eigen::VectorXd scores;       // with the residuals
};

// Products of all candidates' columns, summed over recordings.
struct CandidateSums {
  Eigen::MatrixXd scores;                       // columns x (1 + draws)
  Eigen::MatrixXd nuisance;                     // columns x parameters, as fitted
  Eigen::MatrixXd moved_nuisance;               // columns x parameters under the block's motion
  std::vector<Eigen::MatrixXd> information;     // of each shape
  Eigen::MatrixXd own_information, own_scores;  // of the parameters, as fitted
  std::vector<BlockSums> blocks;

  void add(const CandidateSums& other) {
    scores += other.scores;
    nuisance += other.nuisance;
    moved_nuisance += other.moved_nuisance;
    own_information += other.own_information;
    own_scores += other.own_scores;
    for (std::size_t s = 0; s < information.size(); ++s) information[s] += other.information[s];
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      blocks[b].information += other.blocks[b].information;
      blocks[b].scores += other.blocks[b].scores;
    }
  }
};

// Draws of what pure noise leaves over the lines of one recording, whitened by a covariance that is
// an estimate itself. Where that came out too small in a draw, the noise is too large. This holds
// in neighbouring lines and in all records of a group alike.
class NoiseDraws {
 public:
  NoiseDraws(const PeriodicData& data, std::size_t group, int draws, std::uint64_t seed,
             std::uint64_t record);

  [[nodiscard]] Eigen::Index draws() const { return noise_.cols(); }
  // Each draw through an answer (n_y x lines), answer^H noise at each line: lines x draws.
  [[nodiscard]] Eigen::MatrixXcd seen_by(const Eigen::MatrixXcd& answer) const;
  // Re whitened^H noise, of whitened columns over outputs and lines.
  [[nodiscard]] Eigen::MatrixXd products(const Eigen::MatrixXcd& whitened) const;
  void decorrelate(const MeasuredRecord& record) {
    if (draws() > 0) record.decorrelate(noise_);
  }

 private:
  void scale(const PeriodicData& data, const NoisePool& pool, std::uint64_t seed);

  Eigen::Index outputs_, lines_;
  Eigen::MatrixXcd noise_;  // (outputs of each line) x draws
};

// Adds those of one recording, that the solver has solved. `bodies`: what each column of a body law
// changes in the plant at the recording's position, in the candidates' order.
void add_products(const PlantFamily& family, const PeriodicData& data, const ModelState& model,
                  SteadyStateSolver& solver, const MeasuredRecord& record, bool follows_data,
                  const std::vector<Candidate>& candidates, const std::vector<PlantChange>& bodies,
                  NoiseDraws draws, CandidateSums& sums);

}  // namespace graybox
