#include "diagnosis/force_balance_data/payload_tangent.hpp"

#include <Eigen/QR>

namespace graybox {
namespace {

using Index = Eigen::Index;

// What must be left of a payload's force beside the columns that a joint has, to tell its gain.
constexpr double kLeastOwnPart = 0.01;

bool is_independent(const Eigen::VectorXd& column, const Eigen::MatrixXd& others) {
  if (!(column.squaredNorm() > 0.0)) return false;
  if (others.cols() == 0) return true;
  const Eigen::VectorXd rest =
      column - others * others.completeOrthogonalDecomposition().solve(column);
  return rest.norm() > kLeastOwnPart * column.norm();
}

void add_column(Index joint, const Eigen::VectorXd& column, BalanceColumns& columns) {
  for (std::size_t j = 0; j < columns.in.size(); ++j) {
    Eigen::MatrixXd& block = columns.in[j];
    block.conservativeResize(Eigen::NoChange, columns.count + 1);
    if (static_cast<Index>(j) == joint) {
      block.rightCols<1>() = column;
    } else {
      block.rightCols<1>().setZero();
    }
  }
  ++columns.count;
}

}  // namespace

BalanceColumns force_before_gains(const PlacedLaw& payload, const ForceBalanceData& data,
                                  const ForceBalanceRows& rows) {
  PlacedLaw unit = payload;
  unit.inverse_gains.setOnes();
  return law_force_column(unit, data, rows);
}

PayloadTangent about_payloads(const ForceBalanceData& data, std::span<const PlacedLaw> payloads) {
  const ForceBalanceRows& recorded = data.estimation;
  PayloadTangent tangent;
  ForceBalanceRows& rows = tangent.rows;
  rows.measured = recorded.measured;
  rows.force = recorded.force;
  rows.model = recorded.model;
  rows.pieces = recorded.pieces;
  rows.counts = recorded.counts;
  Eigen::MatrixXd carried = Eigen::MatrixXd::Zero(rows.samples(), rows.coordinates());
  for (const PlacedLaw& payload : payloads) {
    const BalanceColumns force = force_before_gains(payload, data, recorded);
    for (Index j = 0; j < rows.coordinates(); ++j) {
      const Eigen::VectorXd own = force.in[static_cast<std::size_t>(j)].col(0);
      carried.col(j) += own;
      rows.force.col(j) += payload.inverse_gains(j) * own;
    }
  }
  for (Index j = 0; j < rows.coordinates(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (data.gain_parameters[at] >= 0) {
      rows.model.in[at].col(data.gain_parameters[at]) += carried.col(j);
    } else if (is_independent(carried.col(j), rows.model.in[at])) {
      add_column(j, carried.col(j), rows.model);
      tangent.loaded.push_back(j);
    }
  }
  return tangent;
}

}  // namespace graybox
