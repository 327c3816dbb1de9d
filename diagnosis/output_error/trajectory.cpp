#include "diagnosis/output_error/trajectory.hpp"

#include <cmath>

namespace graybox {
namespace {

const double* column(const Eigen::MatrixXd& matrix, Eigen::Index k) {
  return matrix.size() == 0 ? nullptr : matrix.data() + k * matrix.rows();
}

}  // namespace

TrajectoryIntegrator::TrajectoryIntegrator(LumpedSystem& system,
                                           const ExponentialOperators* operators)
    : system_(system), operators_(operators) {
  state_.setZero(system.state_count(), system.column_count());
  stage_ = flow_ = next_ = rate_0_ = rate_1_ = rate_2_ = rate_3_ = state_;
  sampled_.setZero(system.output_count(), system.column_count());
}

void TrajectoryIntegrator::start(const NodeInputs& inputs, const Stretch& stretch,
                                 const Eigen::VectorXd& initial) {
  const Eigen::Index moving = 2 * system_.coordinate_count();
  state_.setZero();
  if (initial.size() > 0) state_.col(0).head(moving) = initial;
  const Eigen::Index extra = initial.size() > 0 ? initial.size() : 0;
  const Eigen::Index first = system_.column_count() - extra;
  if (first >= 1 && system_.column_count() > 1) {
    for (Eigen::Index i = 0; i < extra; ++i) state_(i, first + i) = 1.0;
  }
  system_.rest_laws(column(inputs.samples, stretch.first), state_);
}

// out += op in: the rows of q and q' by the operator's matrices, which also depend on parameters.
void TrajectoryIntegrator::add(const ExponentialOperator& op, const Rows& in, Rows& out) const {
  const Eigen::Index n = op.matrix.rows();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) out.row(i) += op.matrix(i, j) * in.row(j);
  }
  if (system_.column_count() == 1) return;
  const auto& columns = system_.linear_part_columns();
  for (std::size_t p = 0; p < op.derivatives.size(); ++p) {
    for (Eigen::Index i = 0; i < n; ++i) {
      double sum = 0.0;
      for (Eigen::Index j = 0; j < n; ++j) sum += op.derivatives[p](i, j) * in(j, 0);
      out(i, columns[p]) += sum;
    }
  }
}

void TrajectoryIntegrator::rates(const Rows& state, const NodeInputs& inputs, Eigen::Index node,
                                 bool whole, Rows& out) {
  system_.rates(state, column(inputs.nodes, node), column(inputs.slopes, node), whole, out);
}

void TrajectoryIntegrator::exponential_step(const NodeInputs& inputs, Eigen::Index node) {
  const Eigen::Index moving = 2 * system_.coordinate_count();
  const Eigen::Index laws = system_.state_count() - moving;
  const double h = step_;
  rates(state_, inputs, node, false, rate_0_);
  if (system_.is_linear()) {
    rates(state_, inputs, node + 1, false, rate_1_);
    rates(state_, inputs, node + 2, false, rate_3_);
    rate_1_ *= 2.0;
  } else {
    flow_.setZero();
    add(operators_->half_flow, state_, flow_);
    flow_.bottomRows(laws) = state_.bottomRows(laws);
    const auto half_step = [&](const Rows& rate, Rows& to) {
      add(operators_->half_input, rate, to);
      to.bottomRows(laws) += 0.5 * h * rate.bottomRows(laws);
    };
    stage_ = flow_;
    half_step(rate_0_, stage_);
    next_.setZero();  // e^(Ah/2) a, for the third stage
    add(operators_->half_flow, stage_, next_);
    next_.bottomRows(laws) = stage_.bottomRows(laws);
    rates(stage_, inputs, node + 1, false, rate_1_);
    half_step(rate_1_, flow_);
    rates(flow_, inputs, node + 1, false, rate_2_);
    stage_ = 2.0 * rate_2_ - rate_0_;
    half_step(stage_, next_);
    rates(next_, inputs, node + 2, false, rate_3_);
    rate_1_ += rate_2_;
  }
  next_.setZero();
  add(operators_->flow, state_, next_);
  add(operators_->first, rate_0_, next_);
  add(operators_->middle, rate_1_, next_);
  add(operators_->last, rate_3_, next_);
  if (laws > 0) {
    next_.bottomRows(laws) =
        state_.bottomRows(laws) + h / 6.0 * (rate_0_ + 2.0 * rate_1_ + rate_3_).bottomRows(laws);
  }
  state_.swap(next_);
}

void TrajectoryIntegrator::runge_kutta_step(const NodeInputs& inputs, Eigen::Index node, double h) {
  rates(state_, inputs, node, true, rate_0_);
  stage_ = state_ + 0.5 * h * rate_0_;
  rates(stage_, inputs, node + 1, true, rate_1_);
  stage_ = state_ + 0.5 * h * rate_1_;
  rates(stage_, inputs, node + 1, true, rate_2_);
  stage_ = state_ + h * rate_2_;
  rates(stage_, inputs, node + 2, true, rate_3_);
  state_ += h / 6.0 * (rate_0_ + 2.0 * rate_1_ + 2.0 * rate_2_ + rate_3_);
}

bool TrajectoryIntegrator::run(const NodeInputs& inputs, const Eigen::VectorXd& time,
                               const Stretch& stretch, const Eigen::VectorXd& initial,
                               Rows& outputs) {
  constexpr double kBound = 1e12;  // far beyond any motion, far below overflow
  const Eigen::Index ny = system_.output_count(), m = inputs.steps_per_sample;
  outputs.resize(stretch.count * ny, system_.column_count());
  start(inputs, stretch, initial);
  for (Eigen::Index k = 0; k < stretch.count; ++k) {
    const Eigen::Index sample = stretch.first + k;
    system_.outputs(state_, column(inputs.samples, sample), column(inputs.sample_slopes, sample),
                    sampled_);
    outputs.middleRows(k * ny, ny) = sampled_;
    if (k + 1 == stretch.count || state_.rows() == 0) continue;
    step_ = (time(sample + 1) - time(sample)) / static_cast<double>(m);
    for (Eigen::Index j = 0; j < m; ++j) {
      const Eigen::Index node = 3 * (sample * m + j);
      if (operators_ != nullptr) {
        exponential_step(inputs, node);
      } else {
        runge_kutta_step(inputs, node, step_);
      }
    }
    if (!(state_.col(0).cwiseAbs().maxCoeff() < kBound)) return false;
  }
  return outputs.allFinite();
}

}  // namespace graybox
