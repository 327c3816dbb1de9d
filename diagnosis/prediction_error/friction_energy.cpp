#include "diagnosis/prediction_error/friction_energy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace graybox {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr int kSubsteps = 8;  // of a sample, for laws with memory

bool counts(const Element& part) {
  return part.location.kind == LocationKind::kElement && part.law &&
         part.location.input == part.location.output;
}

struct Course {
  VectorXd z, rate;
};

void add_power(const Element& part, const Course& at, VectorXd& power) {
  for (Index k = 0; k < at.z.size(); ++k) {
    const double z = at.z(k), rate = at.rate(k);
    power(k) += (part.law->force(z, rate, {}) - part.law->force(z, 0.0, {})) * rate;
  }
}

// Whole forces; states follow along straight lines between samples.
void add_whole_power(const Element& part, const Course& at, double sample_time, VectorXd& power) {
  const std::size_t states = part.law->state_count();
  std::vector<double> x(states, 0.0), change(states, 0.0);
  part.law->rest(at.z(0), x);
  for (Index k = 0; k < at.z.size(); ++k) {
    power(k) += part.law->force(at.z(k), at.rate(k), x) * at.rate(k);
    if (k + 1 == at.z.size() || states == 0) continue;
    for (int s = 0; s < kSubsteps; ++s) {
      const double t = (s + 0.5) / kSubsteps;
      const double z = at.z(k) + t * (at.z(k + 1) - at.z(k));
      const double rate = at.rate(k) + t * (at.rate(k + 1) - at.rate(k));
      part.law->state_rate(z, rate, x, change);
      for (std::size_t i = 0; i < states; ++i) x[i] += sample_time / kSubsteps * change[i];
    }
  }
}

// Those that act on one motion, with its sign.
std::vector<std::pair<const Element*, double>> companions(const LumpedModel& model,
                                                          const Element& part) {
  std::vector<std::pair<const Element*, double>> list;
  for (const Element& other : model.parts) {
    if (!counts(other)) continue;
    if (other.location.output == part.location.output) list.emplace_back(&other, 1.0);
    if (other.location.output == -part.location.output) list.emplace_back(&other, -1.0);
  }
  return list;
}

double share_at(const LumpedModel& model, const Element& part, const Course& at,
                double sample_time) {
  const auto list = companions(model, part);
  if (list.front().first != &part) return 0.0;  // its place has been seen
  const bool has_memory =
      std::ranges::any_of(list, [](const auto& one) { return one.first->law->state_count() > 0; });
  VectorXd power = VectorXd::Zero(at.z.size());
  for (const auto& [other, sign] : list) {
    // A friction that an input drives takes no less than it does where that is zero.
    const bool is_driven = other->location.driver >= 0;
    const Course own{is_driven ? VectorXd::Zero(at.z.size()) : VectorXd(sign * at.z),
                     sign * at.rate};
    if (has_memory) {
      add_whole_power(*other, own, sample_time, power);
    } else {
      add_power(*other, own, power);
    }
  }
  const double all = power.cwiseAbs().sum();
  const double fed_in = has_memory ? std::max(-power.sum(), 0.0) : -power.cwiseMin(0.0).sum();
  return all > 0.0 ? fed_in / all : 0.0;
}

}  // namespace

double fed_in_share(const LumpedModel& model, const Eigen::MatrixXd& motion, double sample_time) {
  const Index m = motion.cols() / 2;
  double worst = 0.0;
  for (const Element& part : model.parts) {
    if (!counts(part)) continue;
    const Course at{motion.leftCols(m) * part.location.input,
                    motion.rightCols(m) * part.location.input};
    worst = std::max(worst, share_at(model, part, at, sample_time));
  }
  return worst;
}

}  // namespace graybox
