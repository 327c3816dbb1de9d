#include "graybox/diagnosis/prediction_error/friction_energy.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

bool counts(const Element& part) {
  return part.location.kind == LocationKind::kElement && part.law &&
         part.law->state_count() == 0 && part.location.input == part.location.output;
}

void add_power(const Element& part, const VectorXd& z, const VectorXd& rate, VectorXd& power) {
  for (Index k = 0; k < z.size(); ++k) {
    power(k) += (part.law->force(z(k), rate(k), {}) - part.law->force(z(k), 0.0, {})) * rate(k);
  }
}

}  // namespace

double fed_in_share(const LumpedModel& model, const Eigen::MatrixXd& motion) {
  const Index m = motion.cols() / 2;
  double worst = 0.0;
  for (std::size_t i = 0; i < model.parts.size(); ++i) {
    const Element& part = model.parts[i];
    if (!counts(part)) continue;
    const VectorXd z = motion.leftCols(m) * part.location.input;
    const VectorXd rate = motion.rightCols(m) * part.location.input;
    VectorXd power = VectorXd::Zero(z.size());
    bool is_first = true;  // of its place
    for (std::size_t k = 0; k < model.parts.size(); ++k) {
      const Element& other = model.parts[k];
      if (!counts(other)) continue;
      const bool is_same = other.location.output == part.location.output;
      if (!is_same && other.location.output != -part.location.output) continue;
      is_first &= k >= i;
      const double sign = is_same ? 1.0 : -1.0;
      add_power(other, sign * z, sign * rate, power);
    }
    const double all = power.cwiseAbs().sum();
    if (is_first && all > 0.0) worst = std::max(worst, -power.cwiseMin(0.0).sum() / all);
  }
  return worst;
}

}  // namespace graybox
