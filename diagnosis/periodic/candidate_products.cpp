#include "diagnosis/periodic/candidate_products.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <span>
#include <utility>

#include "diagnosis/harmonic_balance/place_observer.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// Forces of candidates are regressors: that a coarse grid folds the last of their harmonics costs
// them nothing but a little power. Half the grid of steady states.
SteadyStateOptions coarse_grid() {
  SteadyStateOptions options;
  options.oversampling = 8.0;
  options.grid_points = 0.0;
  return options;
}

// [n_y (K + 1)] x columns through an answer: answer^H of each line, (K + 1) x columns.
MatrixXcd seen_through(const MatrixXcd& answer, const MatrixXcd& columns) {
  const Index outputs = answer.rows();
  MatrixXcd seen(answer.cols(), columns.cols());
  for (Index k = 0; k < answer.cols(); ++k) {
    seen.row(k).noalias() = answer.col(k).adjoint() * columns.middleRows(k * outputs, outputs);
  }
  return seen;
}

class RecordProducts {
 public:
  RecordProducts(const PlantFamily& family, const PeriodicData& data, const ModelState& model,
                 SteadyStateSolver& solver, const MeasuredRecord& record, bool follows_data,
                 NoiseDraws draws, CandidateSums& sums)
      : model_(model),
        solver_(solver),
        coarse_(family, data, coarse_grid()),
        record_(record),
        observer_(solver, model, data, follows_data),
        undisturbed_(solver, model, data, false),
        lines_(data.last_line + 1),
        outputs_(static_cast<Index>(data.outputs.size())),
        draws_(std::move(draws)),
        sums_(sums) {
    add_parameters();
  }

  // Candidates of one block, which are all part of the plant or all forces and signals.
  void add(std::span<const Candidate> block, const std::vector<PlantChange>& bodies) {
    if (is_body(*block.front().place, *block.front().entry)) {
      add_block(jacobian_, sums_.blocks[block.front().block]);
      for (const Candidate& candidate : block) add_body(candidate, bodies);
    } else {
      see_place(block.front());
      add_columns(block);
    }
  }

 private:
  // The model's own, and everything that columns are multiplied with.
  void add_parameters() {
    solver_.differentiate(model_, record_, false, jacobian_);
    parameters_ = jacobian_.cols();
    moved_ = jacobian_;
    record_.decorrelate(jacobian_);
    residual_ = solver_.state().residual.reshaped();
    record_.decorrelate(residual_);
    own_ = {MatrixXd::Zero(parameters_, parameters_), VectorXd::Zero(parameters_)};
    add_block(jacobian_, own_);
    sums_.own_information += own_.information;
    sums_.own_scores.col(0) += own_.scores;
    const Index count = draws_.draws();
    if (count > 0) sums_.own_scores.rightCols(count) += draws_.products(jacobian_);
    against_.resize(jacobian_.rows(), 1 + parameters_);
    against_.col(0) = residual_;
    against_.rightCols(parameters_) = jacobian_;
    record_.decorrelate(against_);
    draws_.decorrelate(record_);
    if (record_.common_error) {
      const MatrixXcd common = record_.common_error->inverse_directions();
      against_.conservativeResize(Eigen::NoChange, against_.cols() + common.cols());
      against_.rightCols(common.cols()) = common;
    }
    directions_ = against_.cols() - parameters_ - 1;
  }

  void add_block(const MatrixXcd& jacobian, BlockSums& block) const {
    block.information += as_real(jacobian).transpose() * as_real(jacobian);
    block.scores += as_real(jacobian).transpose() * as_real(residual_);
  }

  void add_body(const Candidate& candidate, const std::vector<PlantChange>& bodies) {
    MatrixXcd change(outputs_, lines_);
    auto column = static_cast<Index>(candidate.first_column);
    for (std::size_t s = 0; s < candidate.shapes.size(); ++s, ++column, ++shape_, ++body_) {
      solver_.answer_of_plant(bodies[body_], solver_.state().coordinates, false, change);
      const VectorXcd own = change.reshaped();
      const Eigen::RowVectorXd products = as_real(own).transpose() * as_real(against_);
      sums_.information[shape_](0, 0) +=
          own.squaredNorm() - products.tail(directions_).squaredNorm();
      sums_.scores(column, 0) += products(0);
      sums_.nuisance.row(column) += products.segment(1, parameters_);
      sums_.moved_nuisance.row(column) += products.segment(1, parameters_);
      const Index count = draws_.draws();
      if (count > 0) sums_.scores.row(column).tail(count) += draws_.products(own).row(0);
    }
  }

  // The motion at the place of a block, and what it sees of everything.
  void see_place(const Candidate& first) {
    const Location& place = first.place->location;
    MatrixXcd answer;
    answer_at(solver_, model_, record_, place, answer);
    const PlaceObserver& observer = may_follow_data(*first.entry) ? observer_ : undisturbed_;
    motion_ = observer.observe(record_, place, answer);
    // A law's force acts against the motion.
    if (place.kind == LocationKind::kElement) answer = -answer;
    coarse_.motion_of(motion_.deflection, times_);
    BlockSums& block = sums_.blocks[first.block];
    if (motion_.is_moved) {
      differentiate_moved();
      MatrixXcd moved = moved_;
      record_.decorrelate(moved);
      add_block(moved, block);
      record_.decorrelate(moved);
      seen_moved_ = seen_through(answer, moved);
    } else {
      block.information += own_.information;
      block.scores += own_.scores;
    }
    gain_ = answer.colwise().norm().transpose();
    seen_ = seen_through(answer, against_);
    if (draws_.draws() > 0) seen_noise_ = as_real(draws_.seen_by(answer)).cast<float>();
  }

  // The columns of the plant's parameters under the motion at the place; those of laws stay.
  void differentiate_moved() {
    const std::size_t own = model_.positions[record_.position].changes.size();
    for (std::size_t p = 0; p < own; ++p) {
      Eigen::Map<MatrixXcd> column(moved_.col(static_cast<Index>(p)).data(), outputs_, lines_);
      solver_.answer_of_parameter(record_, p, motion_.coordinates, false, column);
    }
  }

  // The forces of all shapes of a block, and all products in one go.
  void add_columns(std::span<const Candidate> block) {
    const auto first = static_cast<Index>(block.front().first_column);
    Index width = 0;
    for (const Candidate& candidate : block) {
      for (const LawShape& shape : candidate.shapes)
        width += static_cast<Index>(shape.basis.size());
    }
    if (width == 0) return;
    MatrixXcd columns(lines_, width);
    Index next = 0;
    for (const Candidate& candidate : block) {
      for (const LawShape& shape : candidate.shapes) {
        for (const std::vector<double>& parameters : shape.basis) {
          columns.col(next++) = force_of(candidate, parameters);
        }
      }
    }
    const MatrixXd products = as_real(columns).transpose() * as_real(seen_);
    sums_.scores.col(0).segment(first, width) += products.col(0);
    const auto nuisance = products.middleCols(1, parameters_);
    sums_.nuisance.middleRows(first, width) += nuisance;
    if (motion_.is_moved) {
      sums_.moved_nuisance.middleRows(first, width) +=
          as_real(columns).transpose() * as_real(seen_moved_);
    } else {
      sums_.moved_nuisance.middleRows(first, width) += nuisance;
    }
    if (const Index count = draws_.draws(); count > 0) {
      // Chance needs no more than single precision.
      const Eigen::MatrixXf drawn = as_real(columns).cast<float>().transpose() * seen_noise_;
      sums_.scores.middleRows(first, width).rightCols(count) += drawn.cast<double>();
    }
    columns = gain_.asDiagonal() * columns;
    add_information(block, columns, products.rightCols(directions_));
  }

  // Of each shape's columns, times the gain of the place.
  void add_information(std::span<const Candidate> block, const MatrixXcd& columns,
                       const Eigen::Ref<const MatrixXd>& common) {
    Index next = 0;
    for (const Candidate& candidate : block) {
      for (const LawShape& shape : candidate.shapes) {
        const auto size = static_cast<Index>(shape.basis.size());
        const auto own = as_real(columns).middleCols(next, size);
        const auto shared = common.middleRows(next, size);
        sums_.information[shape_++] += own.transpose() * own - shared * shared.transpose();
        next += size;
      }
    }
  }

  const VectorXcd& force_of(const Candidate& candidate, const std::vector<double>& parameters) {
    const Location& place = candidate.place->location;
    const PeriodicLaw law(*candidate.entry, parameters);
    if (place.kind == LocationKind::kActuator) {
      solver_.signal_lines(law, record_, model_.positions[record_.position].plant, place.channel,
                           force_);
    } else {
      coarse_.force_lines(law, motion_.deflection, times_, force_);
    }
    return force_;
  }

  const ModelState& model_;
  SteadyStateSolver& solver_;
  SteadyStateSolver coarse_;
  const MeasuredRecord& record_;
  PlaceObserver observer_, undisturbed_;
  Index lines_, outputs_;
  NoiseDraws draws_;
  CandidateSums& sums_;
  Index parameters_ = 0, directions_ = 0;
  MatrixXcd jacobian_, moved_;  // decorrelated; not, under the motion at the place
  VectorXcd residual_;          // decorrelated
  BlockSums own_;
  MatrixXcd against_;  // residual, jacobian and directions that columns are multiplied with
  SteadyPlaceMotion motion_;
  PeriodicMotion times_;
  MatrixXcd seen_, seen_moved_;
  Eigen::MatrixXf seen_noise_;
  VectorXd gain_;
  VectorXcd force_;
  std::size_t shape_ = 0, body_ = 0;
};

}  // namespace

bool may_follow_data(const LawEntry& entry) {
  return entry.name != "gain" && entry.name != "saturation";
}

NoiseDraws::NoiseDraws(const PeriodicData& data, std::size_t group, int draws, std::uint64_t seed,
                       std::uint64_t record)
    : outputs_(static_cast<Index>(data.outputs.size())), lines_(data.last_line + 1) {
  if (draws == 0) return;
  Random random(seed + 0x9e3779b97f4a7c15ULL * (record + 1));
  noise_ = MatrixXcd::Zero(outputs_ * lines_, draws);
  for (Index d = 0; d < draws; ++d) {
    for (Index i = outputs_ * data.first_line; i < noise_.rows(); ++i) {
      const double real = random.normal();
      noise_(i, d) = Complex(real, random.normal());
    }
  }
  if (!data.noise_pools.empty()) scale(data, data.noise_pools[group], seed ^ (group + 1));
}

MatrixXcd NoiseDraws::seen_by(const MatrixXcd& answer) const {
  return seen_through(answer, noise_);
}

MatrixXd NoiseDraws::products(const MatrixXcd& whitened) const {
  return as_real(whitened).transpose() * as_real(noise_);
}

// The variance of J^H W e over what it is taken for, J^H W J, with W = (q - n) S^-1 as estimated
// from q samples of n outputs (noise_whitening.hpp): (J^H W W J) / (J^H W J) is, whatever J,
//   (q - n) / g_(q-n+1) (1 + g_(n-1) / g_(q-n+2)),
//   g_m independent, of the gamma distribution with mean m,
// by S^-1's partition into J and the rest: the first factor, of mean one, is what is left of S
// along J, the second the squared slope of J on the other outputs.
void NoiseDraws::scale(const PeriodicData& data, const NoisePool& pool, std::uint64_t seed) {
  const auto n = static_cast<double>(outputs_);
  const double beyond = std::max(pool.samples - n, 2.0);  // no mean below one
  Random random(seed);
  const auto width = std::max<Index>(1, static_cast<Index>(pool.lines));
  for (Index d = 0; d < noise_.cols(); ++d) {
    for (Index k = data.first_line; k < lines_; k += width) {
      double ratio = beyond / random.gamma(beyond + 1.0);
      if (outputs_ > 1) ratio *= 1.0 + random.gamma(n - 1.0) / random.gamma(beyond + 2.0);
      const Index count = std::min(width, lines_ - k) * outputs_;
      noise_.col(d).segment(k * outputs_, count) *= std::sqrt(ratio);
    }
  }
}

void add_products(const PlantFamily& family, const PeriodicData& data, const ModelState& model,
                  SteadyStateSolver& solver, const MeasuredRecord& record, bool follows_data,
                  const std::vector<Candidate>& candidates, const std::vector<PlantChange>& bodies,
                  NoiseDraws draws, CandidateSums& sums) {
  RecordProducts products(family, data, model, solver, record, follows_data, std::move(draws),
                          sums);
  for (auto first = candidates.begin(); first != candidates.end();) {
    const auto last = std::find_if(first, candidates.end(), [&](const Candidate& candidate) {
      return candidate.block != first->block;
    });
    products.add({first, last}, bodies);
    first = last;
  }
}

}  // namespace graybox
