#include "diagnosis/output_error/node_inputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace graybox {
namespace {

constexpr Eigen::Index kHalfWidth = 24;
constexpr double kKaiserBeta = 8.0;

using Values = Eigen::Ref<const Eigen::VectorXd>;

// The record as it goes on beyond its ends.
double extended(const Values& values, Eigen::Index k) {
  const Eigen::Index last = values.size() - 1;
  if (k < 0) return 2.0 * values(0) - values(std::min(-k, last));
  if (k > last) return 2.0 * values(last) - values(std::max<Eigen::Index>(2 * last - k, 0));
  return values(k);
}

double kaiser(double x) {  // |x| <= 1
  return std::cyl_bessel_i(0.0, kKaiserBeta * std::sqrt(std::max(0.0, 1.0 - x * x))) /
         std::cyl_bessel_i(0.0, kKaiserBeta);
}

double windowed_sinc(double t) {
  const double window = kaiser(t / static_cast<double>(kHalfWidth));
  const double angle = std::numbers::pi * t;
  return std::abs(t) < 1e-9 ? 1.0 : window * std::sin(angle) / angle;
}

// Weights of the 2 * kHalfWidth samples around a time that lies by `part` behind one of them.
struct Kernel {
  explicit Kernel(double part) {
    double sum = 0.0, sum_slope = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double t = part + static_cast<double>(kHalfWidth - 1) - static_cast<double>(i);
      constexpr double kStep = 1e-5;
      sum += weights[i] = windowed_sinc(t);
      slopes[i] = (windowed_sinc(t + kStep) - windowed_sinc(t - kStep)) / (2.0 * kStep);
      sum_slope += slopes[i];
    }
    // Divided by their sum, so that a constant stays what it is.
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weights[i] /= sum;
      slopes[i] = (slopes[i] - weights[i] * sum_slope) / sum;
    }
  }
  std::array<double, 2 * kHalfWidth> weights{}, slopes{};
};

double weighted(const std::array<double, 2 * kHalfWidth>& weights, const Values& values,
                Eigen::Index whole) {
  const Eigen::Index first = whole - kHalfWidth + 1;
  double sum = 0.0;
  if (first >= 0 && first + 2 * kHalfWidth <= values.size()) {
    for (std::size_t i = 0; i < weights.size(); ++i) {
      sum += weights[i] * values(first + static_cast<Eigen::Index>(i));
    }
    return sum;
  }
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i] * extended(values, first + static_cast<Eigen::Index>(i));
  }
  return sum;
}

struct Point {
  double value = 0.0;
  double slope = 0.0;  // by time, in samples
};

// A smooth input at times (k + part), all k with the same part. Held back at the ends of the
// record.
class SmoothSignal {
 public:
  SmoothSignal(const Values& values, InputHold hold, double part)
      : values_(values),
        hold_(hold),
        whole_(static_cast<Eigen::Index>(std::floor(part))),
        part_(part - std::floor(part)),
        kernel_(hold == InputHold::kBandLimited ? part_ : 0.0) {}

  [[nodiscard]] Point at(Eigen::Index k) const {
    const Eigen::Index last = values_.size() - 1;
    Eigen::Index whole = k + whole_;
    if (whole < 0) return {values_(0), 0.0};
    if (hold_ == InputHold::kFirst) {
      const Eigen::Index next = std::min(whole + 1, last);
      whole = std::min(whole, last);
      const double rise = values_(next) - values_(whole);
      return {values_(whole) + part_ * rise, rise};
    }
    if (part_ == 0.0) return {extended(values_, whole), weighted(kernel_.slopes, values_, whole)};
    return {weighted(kernel_.weights, values_, whole), weighted(kernel_.slopes, values_, whole)};
  }

 private:
  Values values_;
  InputHold hold_;
  Eigen::Index whole_;
  double part_;
  Kernel kernel_;
};

// The parabola with the moments of a unit jump at s of a step from 0 to 1, at 0, 1/2 and 1: from
// its Legendre coefficients c_k = (2k + 1) int_s^1 P_k. And its derivative by s.
std::array<Point, 3> jump_nodes(double s) {
  const std::array<Point, 3> c{
      {{1.0 - s, -1.0},
       {3.0 * s * (1.0 - s), 3.0 - 6.0 * s},
       {-5.0 * s * (2.0 * s - 1.0) * (s - 1.0), -5.0 * (6.0 * s * s - 6.0 * s + 1.0)}}};
  const auto at = [&](double p1, double p2) {
    return Point{c[0].value + p1 * c[1].value + p2 * c[2].value,
                 c[0].slope + p1 * c[1].slope + p2 * c[2].slope};
  };
  return {at(-1.0, 1.0), at(0.0, -0.5), at(1.0, 1.0)};
}

class Filler {
 public:
  Filler(NodeInputs& result, Eigen::Index channel, bool with_slopes)
      : result_(result), channel_(channel), with_slopes_(with_slopes) {}

  void smooth(const Values& values, InputHold hold, double delay) const {
    const Eigen::Index intervals = values.size() - 1, m = result_.steps_per_sample;
    for (Eigen::Index j = 0; j <= 2 * m; ++j) {
      const double part = static_cast<double>(j) / static_cast<double>(2 * m) - delay;
      const SmoothSignal signal(values, hold, part);
      for (Eigen::Index k = 0; k < intervals; ++k) {
        const Point point = signal.at(k);
        if (j < 2 * m) set_node(3 * (k * m + j / 2) + j % 2, point.value, -point.slope);
        if (j > 0 && j % 2 == 0) {
          set_node(3 * (k * m + j / 2 - 1) + 2, point.value, -point.slope);
        }
      }
    }
    const SmoothSignal signal(values, hold, -delay);
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      const Point point = signal.at(k);
      set_sample(k, point.value, -point.slope);
    }
  }

  void held(const Values& values, double delay, double earlier) const {
    const Eigen::Index intervals = values.size() - 1, m = result_.steps_per_sample;
    const auto at = [&](Eigen::Index k) { return k < 0 ? earlier : values(k); };
    const auto whole = static_cast<Eigen::Index>(std::floor(delay));
    // Within a sample the input changes from u(k - whole - 1) to u(k - whole) at `part` of it.
    const double part = (delay - std::floor(delay)) * static_cast<double>(m);
    for (Eigen::Index j = 0; j < m; ++j) {
      const double s = part - static_cast<double>(j);  // of this step
      const auto jump = jump_nodes(std::clamp(s, 0.0, 1.0));
      const bool within = s >= 0.0 && s < 1.0;
      for (Eigen::Index k = 0; k < intervals; ++k) {
        const double before = at(k - whole - 1), rise = at(k - whole) - before;
        for (Eigen::Index node = 0; node < 3; ++node) {
          const Point& point = jump[static_cast<std::size_t>(node)];
          set_node(3 * (k * m + j) + node, before + rise * point.value,
                   within ? rise * point.slope * static_cast<double>(m) : 0.0);
        }
      }
    }
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      set_sample(k, at(part > 0.0 ? k - whole - 1 : k - whole), 0.0);
    }
  }

 private:
  void set_node(Eigen::Index column, double value, double slope) const {
    result_.nodes(channel_, column) = value;
    if (with_slopes_) result_.slopes(channel_, column) = slope;
  }
  void set_sample(Eigen::Index k, double value, double slope) const {
    result_.samples(channel_, k) = value;
    if (with_slopes_) result_.sample_slopes(channel_, k) = slope;
  }

  NodeInputs& result_;
  Eigen::Index channel_;
  bool with_slopes_;
};

void drop_columns(Eigen::Index first, Eigen::MatrixXd& values) {
  if (values.size() > 0) values = values.rightCols(values.cols() - first).eval();
}

}  // namespace

void NodeInputs::drop_samples(Eigen::Index first) {
  if (first == 0) return;
  drop_columns(3 * first * steps_per_sample, nodes);
  drop_columns(3 * first * steps_per_sample, slopes);
  drop_columns(first, samples);
  drop_columns(first, sample_slopes);
}

NodeInputs node_inputs(const Eigen::MatrixXd& values, InputHold hold, int steps_per_sample,
                       const Eigen::VectorXd& delays, bool with_slopes,
                       const Eigen::VectorXd& before) {
  const Eigen::Index channels = values.cols(), samples = values.rows();
  const Eigen::Index columns = 3 * (samples - 1) * steps_per_sample;
  NodeInputs result{.steps_per_sample = steps_per_sample,
                    .nodes = Eigen::MatrixXd(channels, columns),
                    .slopes = {},
                    .samples = Eigen::MatrixXd(channels, samples),
                    .sample_slopes = {}};
  if (with_slopes) {
    result.slopes.resize(channels, columns);
    result.sample_slopes.resize(channels, samples);
  }
  for (Eigen::Index c = 0; c < channels; ++c) {
    const Filler filler(result, c, with_slopes);
    const double delay = delays.size() > 0 ? delays(c) : 0.0;
    if (hold == InputHold::kZero) {
      filler.held(values.col(c), delay, before.size() > 0 ? before(c) : values(0, c));
    } else {
      filler.smooth(values.col(c), hold, delay);
    }
  }
  return result;
}

}  // namespace graybox
