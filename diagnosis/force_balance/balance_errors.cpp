#include "diagnosis/force_balance/balance_errors.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/force_balance/remaining_structure.hpp"
#include "diagnosis/signals/coloured_noise.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

// Share of a coordinate's rest that follows from its own past. The low-pass that the forces went
// through gives any noise a past of half its period; so samples so far apart are asked.
double own_past(const ForceBalanceRows& rows, const Eigen::VectorXd& rest) {
  const Motion& piece = rows.pieces.front();
  Index stride = 1;
  for (const FilterPass& filter : piece.filters) {
    const auto most = static_cast<double>(piece.samples());
    const double apart = std::min(0.5 / (filter.frequency * piece.sample_time()), most);
    stride = std::max(stride, static_cast<Index>(apart + 1e-6));
  }
  return 1.0 - ColouredNoise(rest(Eigen::seq(Index{0}, Eigen::last, stride))).innovation_share();
}

// Standard deviation of what was measured where it counts.
double signal_of(const ForceBalanceRows& rows, Index coordinate) {
  return std::sqrt(centred_square(rows.measured.col(coordinate)) / rows.counted(coordinate));
}

void add_held_out_errors(const BalanceFitter& fitter, const ForceBalanceData& data,
                         const ExtendedFit& fit, std::vector<ChannelRest>& channels) {
  if (data.validation.empty()) return;
  const Eigen::MatrixXd rest = fitter.residuals(fit, data.validation);
  for (Index j = 0; j < data.validation.coordinates(); ++j) {
    const double signal = centred_square(data.validation.measured.col(j));
    if (!(signal > 0.0)) continue;
    ChannelRest& channel = channels[static_cast<std::size_t>(j)];
    channel.held_out_nrmse = 100.0 * std::sqrt(rest.col(j).squaredNorm() / signal);
    channel.held_out_level = std::sqrt(data.validation.measured.col(j).squaredNorm() / signal);
    channel.held_out_signal = signal_of(data.validation, j) / signal_of(data.estimation, j);
  }
}

}  // namespace

double autocorrelated_error(const BalanceFitter& fitter, const ForceBalanceData& data,
                            const ExtendedFit& fit) {
  const ForceBalanceRows& rows = data.estimation;
  const Eigen::MatrixXd rest = fitter.residuals(fit, rows);
  double square = 0.0;
  for (Index j = 0; j < rows.coordinates(); ++j) {
    square += own_past(rows, rest.col(j)) * rest.col(j).squaredNorm();
  }
  return 100.0 * std::sqrt(square / centred_square(rows.measured));
}

std::vector<ChannelRest> balance_rests(const BalanceFitter& fitter, const ForceBalanceData& data,
                                       const ExtendedFit& fit) {
  const ForceBalanceRows& rows = data.estimation;
  const Eigen::MatrixXd rest = fitter.residuals(fit, rows), unseen = unpredicted(rows, rest);
  std::vector<ChannelRest> channels;
  for (Index j = 0; j < rows.coordinates(); ++j) {
    const double left = rest.col(j).squaredNorm(), signal = centred_square(rows.measured.col(j));
    ChannelRest& channel = channels.emplace_back();
    channel.channel = data.coordinates[static_cast<std::size_t>(j)].channel();
    if (!(left > 0.0) || !(signal > 0.0)) continue;
    channel.nrmse = 100.0 * std::sqrt(left / signal);
    channel.structure = std::max(0.0, 1.0 - unseen.col(j).squaredNorm() / left);
    channel.autocorrelated_error = 100.0 * std::sqrt(own_past(rows, rest.col(j)) * left / signal);
  }
  add_held_out_errors(fitter, data, fit, channels);
  return channels;
}

}  // namespace graybox
