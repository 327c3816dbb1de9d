#include "graybox/diagnosis/force_balance/payload_tangent.hpp"

namespace graybox {

ForceBalanceRows about_payloads(const ForceBalanceData& data, std::span<const PlacedLaw> payloads) {
  ForceBalanceRows rows = data.estimation;
  for (const PlacedLaw& payload : payloads) {
    const BalanceColumns force = law_force_column(payload, data, rows);
    for (std::size_t j = 0; j < force.in.size(); ++j) {
      const Eigen::Index gain = data.gain_parameters[j];
      const double inverse_gain = payload.inverse_gains(static_cast<Eigen::Index>(j));
      if (gain < 0 || inverse_gain == 0.0) continue;
      const Eigen::VectorXd carried = force.in[j].col(0);
      rows.force.col(static_cast<Eigen::Index>(j)) += carried;
      rows.model.in[j].col(gain) += carried / inverse_gain;
    }
  }
  return rows;
}

}  // namespace graybox
