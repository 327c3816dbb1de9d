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

// The columns of the model's own parameters in one record, and all that others are multiplied with.
struct ModelColumns {
  Index parameters = 0, directions = 0;
  MatrixXcd jacobian, moved;  // decorrelated; not, under the motion at the place
  VectorXcd residual;         // decorrelated
  BlockSums sums;
  MatrixXcd against;  // residual, jacobian and directions that columns are multiplied with
};

// The motion at a place, and what the place sees of the residual and of columns.
struct PlaceView {
  SteadyPlaceMotion motion;
  PeriodicMotion times;
  MatrixXcd against, moved;
  Eigen::MatrixXf noise;
  VectorXd gain;
};

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
      add_block(own_.jacobian, sums_.blocks[block.front().block]);
      for (const Candidate& candidate : block) add_body(candidate, bodies);
    } else {
      see_place(block.front());
      add_columns(block);
    }
  }

 private:
  // The model's own, and everything that columns are multiplied with.
  void add_parameters() {
    solver_.differentiate(model_, record_, false, own_.jacobian);
    own_.parameters = own_.jacobian.cols();
    own_.moved = own_.jacobian;
    record_.decorrelate(own_.jacobian);
    own_.residual = solver_.state().residual.reshaped();
    record_.decorrelate(own_.residual);
    own_.sums = {MatrixXd::Zero(own_.parameters, own_.parameters), VectorXd::Zero(own_.parameters)};
    add_block(own_.jacobian, own_.sums);
    sums_.own_information += own_.sums.information;
    sums_.own_scores.col(0) += own_.sums.scores;
    const Index count = draws_.draws();
    if (count > 0) sums_.own_scores.rightCols(count) += draws_.products(own_.jacobian);
    own_.against.resize(own_.jacobian.rows(), 1 + own_.parameters);
    own_.against.col(0) = own_.residual;
    own_.against.rightCols(own_.parameters) = own_.jacobian;
    record_.decorrelate(own_.against);
    draws_.decorrelate(record_);
    if (record_.common_error) {
      const MatrixXcd common = record_.common_error->inverse_directions();
      own_.against.conservativeResize(Eigen::NoChange, own_.against.cols() + common.cols());
      own_.against.rightCols(common.cols()) = common;
    }
    own_.directions = own_.against.cols() - own_.parameters - 1;
  }

  void add_block(const MatrixXcd& jacobian, BlockSums& block) const {
    block.information += as_real(jacobian).transpose() * as_real(jacobian);
    block.scores += as_real(jacobian).transpose() * as_real(own_.residual);
  }

  void add_body(const Candidate& candidate, const std::vector<PlantChange>& bodies) {
    MatrixXcd change(outputs_, lines_);
    auto column = static_cast<Index>(candidate.first_column);
    for (std::size_t s = 0; s < candidate.shapes.size(); ++s, ++column, ++shape_, ++body_) {
      solver_.answer_of_plant(bodies[body_], solver_.state().coordinates, false, change);
      const VectorXcd own = change.reshaped();
      const Eigen::RowVectorXd products = as_real(own).transpose() * as_real(own_.against);
      sums_.information[shape_](0, 0) +=
          own.squaredNorm() - products.tail(own_.directions).squaredNorm();
      sums_.scores(column, 0) += products(0);
      sums_.nuisance.row(column) += products.segment(1, own_.parameters);
      sums_.moved_nuisance.row(column) += products.segment(1, own_.parameters);
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
    seen_.motion = observer.observe(record_, place, answer);
    // A law's force acts against the motion.
    if (place.kind == LocationKind::kElement) answer = -answer;
    coarse_.motion_of(seen_.motion.deflection, seen_.times);
    BlockSums& block = sums_.blocks[first.block];
    if (seen_.motion.is_moved) {
      differentiate_moved();
      MatrixXcd moved = own_.moved;
      record_.decorrelate(moved);
      add_block(moved, block);
      record_.decorrelate(moved);
      seen_.moved = seen_through(answer, moved);
    } else {
      block.information += own_.sums.information;
      block.scores += own_.sums.scores;
    }
    seen_.gain = answer.colwise().norm().transpose();
    seen_.against = seen_through(answer, own_.against);
    if (draws_.draws() > 0) seen_.noise = as_real(draws_.seen_by(answer)).cast<float>();
  }

  // The columns of the plant's parameters under the motion at the place; those of laws stay.
  void differentiate_moved() {
    const std::size_t own = model_.positions[record_.position].changes.size();
    for (std::size_t p = 0; p < own; ++p) {
      Eigen::Map<MatrixXcd> column(own_.moved.col(static_cast<Index>(p)).data(), outputs_, lines_);
      solver_.answer_of_parameter(record_, p, seen_.motion.coordinates, false, column);
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
    const MatrixXd products = as_real(columns).transpose() * as_real(seen_.against);
    sums_.scores.col(0).segment(first, width) += products.col(0);
    const auto nuisance = products.middleCols(1, own_.parameters);
    sums_.nuisance.middleRows(first, width) += nuisance;
    if (seen_.motion.is_moved) {
      sums_.moved_nuisance.middleRows(first, width) +=
          as_real(columns).transpose() * as_real(seen_.moved);
    } else {
      sums_.moved_nuisance.middleRows(first, width) += nuisance;
    }
    if (const Index count = draws_.draws(); count > 0) {
      // Chance needs no more than single precision.
      const Eigen::MatrixXf drawn = as_real(columns).cast<float>().transpose() * seen_.noise;
      sums_.scores.middleRows(first, width).rightCols(count) += drawn.cast<double>();
    }
    columns = seen_.gain.asDiagonal() * columns;
    add_information(block, columns, products.rightCols(own_.directions));
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
      coarse_.force_lines(law, seen_.motion.deflection, seen_.times, force_);
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
  ModelColumns own_;
  PlaceView seen_;  // of the present block
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
