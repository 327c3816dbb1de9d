#include "diagnosis/recordings/preprocess.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "diagnosis/recordings/channel_arithmetic.hpp"
#include "diagnosis/recordings/preprocess_data.hpp"
#include "diagnosis/recordings/sample_interpolation.hpp"
#include "diagnosis/recordings/sample_mending.hpp"
#include "diagnosis/signals/band_limited_derivative.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

// ---- filter -------------------------------------------------------------------------------------

// y(t) = b0 x(t) + b1 x(t-1) + b2 x(t-2) - a1 y(t-1) - a2 y(t-2), gain 1 at frequency zero.
struct Section {
  double b0, b1, b2, a1, a2;

  struct State {
    double s1, s2;
  };
  // The state after a signal that has always been `value`.
  [[nodiscard]] State at_rest(double value) const {
    const double s2 = (b2 - a2) * value;
    return {(b1 - a1) * value + s2, s2};
  }
  double step(State& state, double in) const {
    const double out = b0 * in + state.s1;
    state.s1 = b1 * in - a1 * out + state.s2;
    state.s2 = b2 * in - a2 * out;
    return out;
  }
};

// One section after another, sample by sample: while one waits for its own past, the others work.
template <std::size_t sections>
void run_through(const Section* section, Eigen::VectorXd& x, bool backward) {
  const Index last = x.size() - 1;
  const Index begin = backward ? last : 0, direction = backward ? -1 : 1;
  std::array<Section, sections> own;
  std::array<Section::State, sections> state;
  for (std::size_t i = 0; i < sections; ++i) {
    own[i] = section[i];
    state[i] = own[i].at_rest(x(begin));
  }
  for (Index k = 0, at = begin; k <= last; ++k, at += direction) {
    double value = x(at);
    for (std::size_t i = 0; i < sections; ++i) value = own[i].step(state[i], value);
    x(at) = value;
  }
}

void run_all(const std::vector<Section>& sections, Eigen::VectorXd& x, bool backward) {
  std::size_t next = 0;
  for (; next + 2 <= sections.size(); next += 2) run_through<2>(&sections[next], x, backward);
  if (next < sections.size()) run_through<1>(&sections[next], x, backward);
}

// Butterworth by the bilinear transform, s = (1/w)(z - 1)/(z + 1) with w = tan(pi f) so that the
// cut-off stays where it is.
std::vector<Section> butterworth(double frequency, int order) {
  const double w = std::tan(std::numbers::pi * frequency);
  std::vector<Section> sections;
  for (int k = 0; k < order / 2; ++k) {
    const double damping =
        2.0 * std::sin(std::numbers::pi * (2.0 * k + 1.0) / (2.0 * static_cast<double>(order)));
    const double scale = 1.0 / (1.0 + damping * w + w * w);
    sections.push_back({w * w * scale, 2.0 * w * w * scale, w * w * scale,
                        2.0 * (w * w - 1.0) * scale, (1.0 - damping * w + w * w) * scale});
  }
  if (order % 2 == 1) {
    const double scale = 1.0 / (1.0 + w);
    sections.push_back({w * scale, w * scale, 0.0, (w - 1.0) * scale, 0.0});
  }
  return sections;
}

// Reflected samples at each end: a filter of this order settles within about order / (2 pi f).
Index reflected_samples(double frequency, int order, Index size) {
  const double settling = static_cast<double>(order) / frequency;
  return static_cast<Index>(std::min(std::ceil(settling), static_cast<double>(size - 1)));
}

// ---- steps --------------------------------------------------------------------------------------

class Preprocessor : private PreprocessData {
 public:
  Preprocessor(const std::string& source, Signals& data)
      : PreprocessData(source, data), data_(data) {}

  void operator()(const ValidSamples& step) { keep_valid_samples(*this, step); }
  void operator()(const Unwrap& step) { unwrap_channels(*this, step); }
  void operator()(const Resample& step) { resample(*this, step); }
  void operator()(const Advance& step) { advance_channels(*this, step); }
  void operator()(const Scale& step) { scale_channels(*this, step); }
  void operator()(const Integral& step) { add_integrals(*this, step); }
  void operator()(const Product& step) { add_product(*this, step); }
  void operator()(const WeightedSum& step) { add_sum(*this, step); }
  void operator()(const MotorTorque& step) { add_motor_torque(*this, step); }
  void operator()(const ConstantChannel& step) { add_constant(*this, step); }

  void operator()(const LowPass& step) {
    const double sample_time = even("low_pass");
    const double share = step.frequency * sample_time;
    if (share >= 0.5) {
      fail(fmt::format("low_pass at {:g} Hz is not below the Nyquist frequency, {:g} Hz",
                       step.frequency, 0.5 / sample_time));
    }
    for (std::size_t k = 0; k < data_.signals.size(); ++k) {
      Signal& signal = data_.signals[k];
      if (!step.channels.empty() &&
          std::ranges::find(step.channels, signal.name) == step.channels.end()) {
        continue;
      }
      signal.low_pass =
          signal.low_pass > 0.0 ? std::min(signal.low_pass, step.frequency) : step.frequency;
      signal.filters.push_back({step.frequency, step.order});
      for (SignalPiece& piece : data_.pieces) {
        auto column = piece.values.col(static_cast<Index>(k));
        column = zero_phase_low_pass(column, share, step.order);
      }
    }
  }

  void operator()(const Decimate& step) {
    const double sample_time = even("decimate") * static_cast<double>(step.factor);
    const double nyquist = 0.5 / sample_time;
    for (const Signal& signal : data_.signals) {
      if (signal.low_pass == 0.0 || signal.low_pass >= nyquist) {
        fail(
            fmt::format("decimate by {} folds what {} has above {:g} Hz; put a low_pass below it "
                        "first",
                        step.factor, signal.name, nyquist));
      }
    }
    decimate_excitation(step.factor);
    data_.sample_time = sample_time;
    const auto factor = static_cast<Index>(step.factor);
    for (SignalPiece& piece : data_.pieces) {
      const Index size = (piece.time.size() + factor - 1) / factor;
      const auto rows = Eigen::seqN(0, size, factor);
      piece.time = Eigen::VectorXd(piece.time(rows));
      piece.values = Eigen::MatrixXd(piece.values(rows, Eigen::all));
    }
  }

  void operator()(const Trim& step) {
    if (data_.excitation) {
      fail("trim would cut the periods of an excitation; say which to use in segments");
    }
    for (SignalPiece& piece : data_.pieces) {
      const Index last = piece.time.size() - 1;
      const double from = piece.time(0) + step.time, to = piece.time(last) - step.time;
      Index first = 0, end = last + 1;
      while (first < end && piece.time(first) < from) ++first;
      while (end > first && piece.time(end - 1) > to) --end;
      if (end - first < 2) {
        fail(fmt::format("trim of {:g} s at either end leaves nothing of a segment of {:g} s",
                         step.time, piece.time(last) - piece.time(0)));
      }
      const auto rows = Eigen::seqN(first, end - first);
      piece.first_sample += static_cast<std::size_t>(first);
      piece.time = Eigen::VectorXd(piece.time(rows));
      piece.values = Eigen::MatrixXd(piece.values(rows, Eigen::all));
    }
  }

  void operator()(const Derivative& step) {
    std::vector<Signal> added;
    for (std::size_t k = 0; k < step.of.size(); ++k) {
      const Signal& signal = data_.signals[index_of(step.of[k])];
      added.push_back({step.names[k], unit_of_derivative(signal.unit),
                       step.role.value_or(signal.role), signal.low_pass, signal.filters});
    }
    const std::vector<Index> of = indices(step.of);
    const double sample_time = step.band_limited ? even("band_limited derivative") : 0.0;
    for (SignalPiece& piece : data_.pieces) {
      if (piece.time.size() < 3) fail("derivative needs at least three samples in each segment");
      Eigen::MatrixXd derived(piece.time.size(), static_cast<Index>(of.size()));
      for (std::size_t k = 0; k < of.size(); ++k) {
        const auto values = piece.values.col(of[k]);
        derived.col(static_cast<Index>(k)) = step.band_limited
                                                 ? band_limited_derivative(sample_time, values)
                                                 : time_derivative(piece.time, values);
      }
      append(piece, derived);
    }
    data_.signals.insert(data_.signals.end(), added.begin(), added.end());
  }

  void operator()(const Transmission& step) {
    const std::string unit = data_.signals[index_of(step.of.front())].unit;
    const bool motion = unit.starts_with("rad");
    if (!motion && unit != "N m") {
      fail(
          fmt::format("transmission: {} is in {}; angles, their derivatives and torques go through "
                      "a transmission",
                      step.of.front(), unit));
    }
    for (const std::string& name : step.of) {
      const Signal& signal = data_.signals[index_of(name)];
      if (signal.unit == unit) continue;
      fail(fmt::format("transmission: {} is in {}, but {} is in {}; all must be of one unit", name,
                       signal.unit, step.of.front(), unit));
    }
    const Signal& least = least_filtered(step.of);
    const double low_pass = least.low_pass;
    const std::vector<FilterPass> filters = least.filters;
    std::vector<Signal> added;
    for (std::size_t k = 0; k < step.of.size(); ++k) {
      const ChannelRole role = step.role.value_or(data_.signals[index_of(step.of[k])].role);
      added.push_back({step.names[k], unit, role, low_pass, filters});
    }
    // Columns are samples: arm = N^-1 motor for motion, N' motor for torques, and back.
    Eigen::MatrixXd matrix =
        motion ? step.matrix : Eigen::MatrixXd(step.matrix.transpose().inverse());
    if (step.to_arm) matrix = matrix.inverse().eval();
    const std::vector<Index> of = indices(step.of);
    for (SignalPiece& piece : data_.pieces) {
      const Eigen::MatrixXd source = piece.values(Eigen::all, of);
      append(piece, source * matrix.transpose());
    }
    data_.signals.insert(data_.signals.end(), added.begin(), added.end());
  }

 private:
  void decimate_excitation(std::size_t factor) {
    if (!data_.excitation) return;
    PeriodicExcitation& excitation = *data_.excitation;
    if (excitation.period % factor != 0) {
      fail(fmt::format("decimate by {} doesn't divide the period of {} samples", factor,
                       excitation.period));
    }
    excitation.period /= factor;
    if (!excitation.lines.empty() && 2 * excitation.lines.back() >= excitation.period) {
      fail(
          fmt::format("decimate by {} folds the excited line {}", factor, excitation.lines.back()));
    }
  }

  Signals& data_;
};

}  // namespace

Eigen::VectorXd zero_phase_low_pass(const Eigen::Ref<const Eigen::VectorXd>& values,
                                    double frequency, int order) {
  const Index size = values.size();
  const Index margin = reflected_samples(frequency, order, size);
  // Odd reflection about both ends: value and slope go on.
  Eigen::VectorXd extended(size + 2 * margin);
  extended.segment(margin, size) = values;
  for (Index k = 1; k <= margin; ++k) {
    extended(margin - k) = 2.0 * values(0) - values(k);
    extended(margin + size - 1 + k) = 2.0 * values(size - 1) - values(size - 1 - k);
  }
  const std::vector<Section> sections = butterworth(frequency, order);
  run_all(sections, extended, false);
  run_all(sections, extended, true);
  return extended.segment(margin, size);
}

Eigen::VectorXd time_derivative(const Eigen::Ref<const Eigen::VectorXd>& time,
                                const Eigen::Ref<const Eigen::VectorXd>& values) {
  const Index last = time.size() - 1;
  Eigen::VectorXd derivative(time.size());
  for (Index k = 0; k <= last; ++k) {
    const Index middle = std::clamp(k, Index{1}, last - 1);
    const double before = (values(middle) - values(middle - 1)) / (time(middle) - time(middle - 1));
    const double after = (values(middle + 1) - values(middle)) / (time(middle + 1) - time(middle));
    // The parabola's slope runs linearly through `before` and `after` at the middles of the steps.
    const double left = 0.5 * (time(middle - 1) + time(middle));
    const double right = 0.5 * (time(middle) + time(middle + 1));
    derivative(k) = before + (after - before) * (time(k) - left) / (right - left);
  }
  return derivative;
}

void preprocess(const std::string& source, const std::vector<PreprocessStep>& steps,
                Signals& signals) {
  Preprocessor preprocessor(source, signals);
  for (const PreprocessStep& step : steps) std::visit(preprocessor, step);
}

}  // namespace graybox
