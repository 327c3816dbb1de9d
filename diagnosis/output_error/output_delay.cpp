#include "diagnosis/output_error/output_delay.hpp"

#include <algorithm>
#include <array>

namespace graybox {
namespace {

constexpr Eigen::Index kNodes = 4;

// Lagrange weights of the nodes around a time, and their slopes.
struct Cubic {
  Eigen::Index first = 0;
  std::array<double, kNodes> weights{}, slopes{};
};

Cubic cubic_at(const Eigen::Ref<const Eigen::VectorXd>& time, double t) {
  Cubic cubic;
  const auto* const after = std::upper_bound(time.data(), time.data() + time.size(), t);
  cubic.first = std::clamp<Eigen::Index>(after - time.data() - 2, 0, time.size() - kNodes);
  for (Eigen::Index i = 0; i < kNodes; ++i) {
    double weight = 1.0, slope = 0.0;
    for (Eigen::Index j = 0; j < kNodes; ++j) {
      if (j == i) continue;
      const double from = time(cubic.first + j);
      const double span = time(cubic.first + i) - from;
      slope = (slope * (t - from) + weight) / span;
      weight *= (t - from) / span;
    }
    cubic.weights[static_cast<std::size_t>(i)] = weight;
    cubic.slopes[static_cast<std::size_t>(i)] = slope;
  }
  return cubic;
}

}  // namespace

void delay_outputs(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::VectorXd& delays,
                   const std::vector<Eigen::Index>& columns, Rows& outputs) {
  const Eigen::Index ny = delays.size();
  for (Eigen::Index j = 0; j < ny; ++j) {
    const Eigen::Index column = columns[static_cast<std::size_t>(j)];
    if (delays(j) == 0.0 && column == 0) continue;
    const Rows prompt = outputs(Eigen::seqN(j, time.size(), ny), Eigen::all);
    for (Eigen::Index k = 0; k < time.size(); ++k) {
      auto late = outputs.row(k * ny + j);
      const double t = time(k) - delays(j);
      if (t <= time(0)) {
        late = prompt.row(0);
        continue;
      }
      const Cubic cubic = cubic_at(time, t);
      double slope = 0.0;
      late.setZero();
      for (Eigen::Index i = 0; i < kNodes; ++i) {
        late += cubic.weights[static_cast<std::size_t>(i)] * prompt.row(cubic.first + i);
        slope += cubic.slopes[static_cast<std::size_t>(i)] * prompt(cubic.first + i, 0);
      }
      if (column > 0) late(column) -= slope;
    }
  }
}

}  // namespace graybox
