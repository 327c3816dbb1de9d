#include "diagnosis/wiring/wired_balance.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostSamples = 1500;
constexpr Index kFriction = 3;        // columns at each joint
constexpr double kTransition = 0.05;  // of the velocity's rms
constexpr double kStill = 1e-10;      // of a force's square: what rounding leaves of no variance
constexpr Index kBetween =
    10;  // samples from one evaluation of inertia and dissipation to the next

// Columns of `signals` (samples x joints) as wired.
MatrixXd rewired(const MatrixXd& signals, const std::vector<Index>& from, const VectorXd& factors) {
  return signals(Eigen::all, from) * factors.asDiagonal();
}

Eigen::Vector3d friction(double velocity, double transition) {
  return {velocity, std::tanh(velocity / transition), 1.0};
}

// Of least norm in units that make the diagonal one: columns depend on each other.
VectorXd solve(const MatrixXd& gram, const VectorXd& moment) {
  constexpr double kIndependent = 1e-9;
  const VectorXd unit = gram.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(unit.asDiagonal() * gram * unit.asDiagonal());
  VectorXd along = eigen.eigenvectors().transpose() * unit.cwiseProduct(moment);
  for (Index k = 0; k < along.size(); ++k) {
    const double value = eigen.eigenvalues()(k);
    along(k) = value > kIndependent ? along(k) / value : 0.0;
  }
  return unit.cwiseProduct(eigen.eigenvectors() * along);
}

}  // namespace

std::vector<Motion> thinned(std::span<const Motion> pieces, Index most) {
  Index samples = 0;
  for (const Motion& piece : pieces) samples += piece.samples();
  const Index stride = samples / most + 1;
  std::vector<Motion> result;
  for (const Motion& piece : pieces) {
    const auto kept = Eigen::seq(Index{0}, Eigen::last, stride);
    result.push_back({piece.time(kept), piece.position(kept, Eigen::all),
                      piece.velocity(kept, Eigen::all), piece.acceleration(kept, Eigen::all),
                      piece.torque(kept, Eigen::all)});
    result.back().load = piece.load;
  }
  return result;
}

Wiring::Wiring(Index joints)
    : force_factors(VectorXd::Ones(joints)), motion_factors(VectorXd::Ones(joints)) {
  for (Index j = 0; j < joints; ++j) {
    force.push_back(j);
    motion.push_back(j);
  }
}

WiredBalance::WiredBalance(const RigidRobotModel& robot, std::span<const Motion> pieces,
                           Gains gains)
    : robot_(robot),
      gains_(gains),
      joints_(robot.size()),
      pieces_(thinned(pieces, kMostSamples)),
      columns_(robot),
      to_motors_(robot.transmission.inverse()) {}

Index WiredBalance::parameters() const { return columns_.size() + kFriction * joints_; }

Motion WiredBalance::motion_under(const Wiring& wiring, const Motion& piece) const {
  const MatrixXd& n = robot_.transmission;
  Motion result = piece;
  for (MatrixXd Motion::*signal : {&Motion::position, &Motion::velocity, &Motion::acceleration}) {
    const bool is_motor = robot_.channels.motor_position;
    const MatrixXd recorded =
        is_motor ? MatrixXd(piece.*signal * n.transpose()) : MatrixXd(piece.*signal);
    const MatrixXd wired = rewired(recorded, wiring.motion, wiring.motion_factors);
    result.*signal = is_motor ? MatrixXd(wired * to_motors_.transpose()) : wired;
  }
  return result;
}

const WiredBalance::Sums& WiredBalance::sums_under(const Wiring& wiring, bool with_blocks) {
  for (auto& [wired, sums] : known_) {
    if (!wired.has_motion_of(wiring)) continue;
    if (with_blocks && sums.blocks.empty()) sums = sums_of(wiring, true);
    return sums;
  }
  known_.emplace_back(wiring, sums_of(wiring, with_blocks));
  return known_.back().second;
}

WiredBalance::Sums WiredBalance::sums_of(const Wiring& wiring, bool with_blocks) {
  std::vector<Motion> pieces;
  Index samples = 0;
  VectorXd squares = VectorXd::Zero(joints_);
  for (const Motion& piece : pieces_) {
    pieces.push_back(motion_under(wiring, piece));
    samples += piece.samples();
    squares += pieces.back().velocity.colwise().squaredNorm().transpose();
  }
  const VectorXd transition =
      kTransition * (squares / static_cast<double>(samples)).cwiseSqrt().cwiseMax(1e-300);
  const Functional nothing{VectorXd::Zero(parameters()), 0.0};
  const std::vector<Products> empty(at(joints_), {MatrixXd::Zero(parameters(), parameters()),
                                                  MatrixXd::Zero(parameters(), joints_ + 1),
                                                  MatrixXd::Zero(joints_ + 2, joints_ + 2)});
  Sums sums;
  sums.blocks.assign(with_blocks ? at(kBlocks) : 1, empty);
  sums.all = empty;
  sums.inertia.assign(at(joints_), nothing);
  sums.dissipation.assign(at(joints_), nothing);
  Index row = 0;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const MatrixXd remembered = columns_.remembered(pieces[i]);
    columns_.carry(pieces[i].load);
    for (Index t = 0; t < pieces[i].samples(); ++t, ++row) {
      add_sample(pieces[i], pieces_[i], t, remembered.row(t), transition,
                 sums.blocks[with_blocks ? at(row * kBlocks / samples) : 0]);
      if (row % kBetween == 0) {
        add_functionals(pieces[i], t, remembered.row(t), transition, sums);
      }
    }
  }
  for (const std::vector<Products>& block : sums.blocks) {
    for (std::size_t j = 0; j < block.size(); ++j) {
      sums.all[j].gram += block[j].gram;
      sums.all[j].moments += block[j].moments;
      sums.all[j].squares += block[j].squares;
    }
  }
  if (!with_blocks) sums.blocks.clear();
  return sums;
}

void WiredBalance::add_sample(const Motion& moved, const Motion& recorded, Index t,
                              const Eigen::RowVectorXd& remembered, const VectorXd& transition,
                              std::vector<Products>& block) {
  columns_.evaluate(moved.position.row(t).transpose(), moved.velocity.row(t).transpose(),
                    moved.acceleration.row(t).transpose());
  const Index own = columns_.size();
  VectorXd row = VectorXd::Zero(parameters());
  VectorXd right(joints_ + 2);
  right.head(joints_) = recorded.torque.row(t);
  right(joints_ + 1) = 1.0;
  for (Index j = 0; j < joints_; ++j) {
    row.setZero();
    row.head(own) = columns_.matrix().row(j);
    row.segment(own + kFriction * j, kFriction) = friction(moved.velocity(t, j), transition(j));
    right(joints_) = columns_.known()(j) + remembered(j);
    Products& products = block[at(j)];
    products.gram.noalias() += row * row.transpose();
    products.moments.noalias() += row * right.head(joints_ + 1).transpose();
    products.squares.noalias() += right * right.transpose();
  }
}

void WiredBalance::add_functionals(const Motion& moved, Index t,
                                   const Eigen::RowVectorXd& remembered, const VectorXd& transition,
                                   Sums& sums) {
  const VectorXd q = moved.position.row(t), velocity = moved.velocity.row(t),
                 still = VectorXd::Zero(joints_);
  const auto evaluate = [&](const VectorXd& v, const VectorXd& a) {
    columns_.evaluate(q, v, a);
    return std::pair<MatrixXd, VectorXd>(columns_.matrix(), columns_.known());
  };
  const Index own = columns_.size();
  const auto [at_rest, known_at_rest] = evaluate(still, still);
  const auto [forth, known_forth] = evaluate(velocity, still);
  const auto [back, known_back] = evaluate(-velocity, still);
  for (Index j = 0; j < joints_; ++j) {
    const auto [pushed, known_pushed] = evaluate(still, VectorXd::Unit(joints_, j));
    Functional& inertia = sums.inertia[at(j)];
    inertia.columns.head(own) += (pushed - at_rest).row(j).transpose();
    inertia.known += (known_pushed - known_at_rest)(j);
    const double half = 0.5 * velocity(j);
    Functional& dissipation = sums.dissipation[at(j)];
    dissipation.columns.head(own) += half * (forth - back).row(j).transpose();
    dissipation.known += half * (known_forth - known_back)(j) + velocity(j) * remembered(j);
    dissipation.columns.segment(own + kFriction * j, 2) +=
        velocity(j) * friction(velocity(j), transition(j)).head(2);
  }
}

// Coefficients of joint j's force in the recorded ones, known forces with -1.
VectorXd WiredBalance::force_row(const Wiring& wiring, Index j) const {
  // Row vectors: tau = u N, u = tau N^-1.
  MatrixXd from = MatrixXd::Zero(joints_, joints_);
  for (Index k = 0; k < joints_; ++k) from(wiring.force[at(k)], k) = wiring.force_factors(k);
  const MatrixXd map =
      robot_.channels.motor_torque ? MatrixXd(to_motors_ * from * robot_.transmission) : from;
  VectorXd row(joints_ + 1);
  row << map.col(j), -1.0;
  return row;
}

// Where gains are positive, what a joint's known bodies do is left out where its would be negative.
VectorXd WiredBalance::solve_with_gains(MatrixXd gram, VectorXd moment) const {
  const std::vector<std::string>& names = columns_.names();
  for (;;) {
    VectorXd parameters = solve(gram, moment);
    bool is_negative = false;
    for (std::size_t k = 0; k < names.size(); ++k) {
      const auto column = static_cast<Index>(k);
      if (!names[k].starts_with("1/gain_") || !(parameters(column) < 0.0)) continue;
      gram.row(column).setZero();
      gram.col(column).setZero();
      moment(column) = 0.0;
      is_negative = true;
    }
    if (!is_negative || gains_ == Gains::kAnySign) return parameters;
  }
}

WiredFit WiredBalance::fit(const Wiring& wiring, Index left_out) {
  const Sums& sums = sums_under(wiring, left_out >= 0);
  const Index known = joints_, one = joints_ + 1;
  MatrixXd gram = MatrixXd::Zero(parameters(), parameters());
  VectorXd moment = VectorXd::Zero(parameters());
  std::vector<Products> joints = sums.all;
  VectorXd variances(joints_);
  for (Index j = 0; j < joints_; ++j) {
    Products& sum = joints[at(j)];
    if (left_out >= 0) {
      const Products& out = sums.blocks[at(left_out)][at(j)];
      sum.gram -= out.gram;
      sum.moments -= out.moments;
      sum.squares -= out.squares;
    }
    const VectorXd row = force_row(wiring, j);
    const VectorXd force = row.head(known);
    const double square = force.dot(sum.squares.topLeftCorner(known, known) * force);
    const double mean = force.dot(sum.squares.col(one).head(known)) / sum.squares(one, one);
    variances(j) = square - sum.squares(one, one) * mean * mean;
    if (!(variances(j) > kStill * square)) {
      variances(j) = 0.0;
      continue;
    }
    gram += sum.gram / variances(j);
    moment += sum.moments * row / variances(j);
  }
  WiredFit result{solve_with_gains(gram, moment), VectorXd::Zero(joints_)};
  for (Index j = 0; j < joints_; ++j) {
    if (variances(j) == 0.0) continue;
    const Products& sum = joints[at(j)];
    const VectorXd row = force_row(wiring, j), &p = result.parameters;
    const double rest = row.dot(sum.squares.topLeftCorner(one, one) * row) -
                        2.0 * p.dot(sum.moments * row) + p.dot(sum.gram * p);
    result.error(j) = std::sqrt(std::max(0.0, rest / variances(j)));
  }
  return result;
}

double WiredBalance::inertia(const Wiring& wiring, const WiredFit& fit, Index j) {
  const Functional& inertia = sums_under(wiring, false).inertia[at(j)];
  return inertia.columns.dot(fit.parameters) + inertia.known;
}

double WiredBalance::dissipation(const Wiring& wiring, const WiredFit& fit, Index j) {
  const Functional& dissipation = sums_under(wiring, false).dissipation[at(j)];
  return dissipation.columns.dot(fit.parameters) + dissipation.known;
}

void WiredBalance::forget() { known_.clear(); }

double WiredBalance::range(const Wiring& wiring, Index j) const {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Motion& piece : pieces_) {
    const Motion moved = motion_under(wiring, piece);
    least = std::min(least, moved.position.col(j).minCoeff());
    most = std::max(most, moved.position.col(j).maxCoeff());
  }
  return most - least;
}

}  // namespace graybox
