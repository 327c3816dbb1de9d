#include "diagnosis/force_balance_data/clipped_forces.hpp"

#include <algorithm>

#include "diagnosis/recordings/signal_checks.hpp"

namespace graybox {
namespace {

using Eigen::Index;

// Samples beside flat tops, where noise alone may have kept the force below the limit.
constexpr Index kBeside = 3;

using Marks = Eigen::Array<bool, Eigen::Dynamic, 1>;

Marks clipped_marks(const Eigen::VectorXd& force) {
  Marks marks = Marks::Constant(force.size(), false);
  for (const Index place : clipped_places(force)) {
    const Index first = std::max(Index{0}, place - kBeside);
    const Index last = std::min(force.size() - 1, place + kBeside);
    marks.segment(first, last + 1 - first).setConstant(true);
  }
  return marks;
}

}  // namespace

std::vector<Index> mark_clipped_forces(std::vector<Motion>& pieces) {
  std::vector<Index> clipped;
  if (pieces.empty()) return clipped;
  Index samples = 0;
  for (const Motion& piece : pieces) samples += piece.samples();
  for (Index j = 0; j < pieces.front().torque.cols(); ++j) {
    Eigen::VectorXd force(samples);
    Index next = 0;
    for (const Motion& piece : pieces) {
      force.segment(next, piece.samples()) = piece.torque.col(j);
      next += piece.samples();
    }
    const Marks marks = clipped_marks(force);
    clipped.push_back(marks.count());
    if (clipped.back() == 0) continue;
    next = 0;
    for (Motion& piece : pieces) {
      if (piece.stands.size() == 0) {
        piece.stands.setConstant(piece.samples(), piece.torque.cols(), false);
      }
      piece.stands.col(j) = piece.stands.col(j) || marks.segment(next, piece.samples());
      next += piece.samples();
    }
  }
  return clipped;
}

}  // namespace graybox
