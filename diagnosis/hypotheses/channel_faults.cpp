#include "diagnosis/hypotheses/channel_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr double kSuspicious = 0.7;
constexpr double kSettled = 0.35;
constexpr double kLargestSettled = 0.6;
constexpr double kAlike = 1.25;  // ratio of dissimilarities: either fault may be the one
constexpr double kSmallestFactor = 3.0;
constexpr double kSignalToNoise = 9.0;  // of powers, for an element to count
constexpr std::size_t kFewestLines = 5;
constexpr int kMostFaults = 4;

// What is done to the recorded responses: outputs and inputs taken from elsewhere, times factors.
struct Rewiring {
  std::vector<Index> outputs, inputs;
  Eigen::VectorXd output_factors, input_factors;

  Rewiring(Index n_y, Index n_u)
      : outputs(static_cast<std::size_t>(n_y)),
        inputs(static_cast<std::size_t>(n_u)),
        output_factors(Eigen::VectorXd::Ones(n_y)),
        input_factors(Eigen::VectorXd::Ones(n_u)) {
    for (std::size_t i = 0; i < outputs.size(); ++i) outputs[i] = static_cast<Index>(i);
    for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i] = static_cast<Index>(i);
  }
};

struct Suspicion {
  Rewiring rewiring;
  std::vector<std::pair<Index, Index>> touched;  // elements
  ChannelFault fault;
  double gain = 0.0;  // of dissimilarity, summed over the elements
};

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class Detective {
 public:
  explicit Detective(const ComparedResponses& compared)
      : compared_(compared),
        n_y_(static_cast<Index>(compared.outputs.size())),
        n_u_(static_cast<Index>(compared.inputs.size())),
        wiring_(n_y_, n_u_) {}

  std::vector<ChannelFault> run() {
    std::vector<ChannelFault> faults;
    while (static_cast<int>(faults.size()) < kMostFaults) {
      std::optional<Suspicion> best = best_suspicion();
      if (!best) break;
      wiring_ = best->rewiring;
      faults.push_back(std::move(best->fault));
    }
    return faults;
  }

 private:
  // Of one element under a wiring; NaN where it never stands out of the noise.
  [[nodiscard]] double dissimilarity(const Rewiring& wiring, Index c, Index i) const {
    std::vector<double> distances;
    const Index from_y = wiring.outputs[static_cast<std::size_t>(c)];
    const Index from_u = wiring.inputs[static_cast<std::size_t>(i)];
    const double factor = wiring.output_factors(c) / wiring.input_factors(i);
    for (const ComparedResponse& line : compared_.lines) {
      const Complex measured = line.measured(from_y, from_u);
      if (std::norm(measured) < kSignalToNoise * line.variance(from_y, from_u)) continue;
      const Complex ratio = factor * measured / line.model(c, i);
      if (!std::isfinite(std::abs(ratio)) || ratio == 0.0) continue;
      distances.push_back(std::abs(std::log(ratio)));
    }
    if (distances.size() < kFewestLines) return std::numeric_limits<double>::quiet_NaN();
    return median(distances);
  }

  // The factor that measured responses have too much, over the elements of a row or column.
  [[nodiscard]] double factor_of(bool is_output, Index channel) const {
    std::vector<double> logs;
    for (const ComparedResponse& line : compared_.lines) {
      for (Index other = 0; other < (is_output ? n_u_ : n_y_); ++other) {
        const Index c = is_output ? channel : other, i = is_output ? other : channel;
        const Index from_y = wiring_.outputs[static_cast<std::size_t>(c)];
        const Index from_u = wiring_.inputs[static_cast<std::size_t>(i)];
        const Complex measured = line.measured(from_y, from_u);
        if (std::norm(measured) < kSignalToNoise * line.variance(from_y, from_u)) continue;
        const double ratio = std::abs(wiring_.output_factors(c) / wiring_.input_factors(i) *
                                      measured / line.model(c, i));
        if (ratio > 0.0 && std::isfinite(ratio)) logs.push_back(std::log(ratio));
      }
    }
    return logs.size() < kFewestLines ? 1.0 : std::exp(median(logs));
  }

  [[nodiscard]] std::vector<std::pair<Index, Index>> row(Index c) const {
    std::vector<std::pair<Index, Index>> elements;
    for (Index i = 0; i < n_u_; ++i) elements.emplace_back(c, i);
    return elements;
  }
  [[nodiscard]] std::vector<std::pair<Index, Index>> column(Index i) const {
    std::vector<std::pair<Index, Index>> elements;
    for (Index c = 0; c < n_y_; ++c) elements.emplace_back(c, i);
    return elements;
  }

  // Whether undoing it makes the elements agree; then with its figures.
  [[nodiscard]] std::optional<Suspicion> weighed(Suspicion suspicion) const {
    double before = 0.0, after = 0.0;
    int count = 0;
    for (const auto& [c, i] : suspicion.touched) {
      const double now = dissimilarity(wiring_, c, i);
      const double then = dissimilarity(suspicion.rewiring, c, i);
      if (std::isnan(now) || std::isnan(then)) continue;
      before += now;
      after += then;
      ++count;
    }
    if (count == 0) return {};
    suspicion.gain = before - after;
    suspicion.fault.dissimilarity_before = before / count;
    suspicion.fault.dissimilarity_after = after / count;
    if (before / count < kSuspicious || after > kSettled * before ||
        after / count > kLargestSettled) {
      return {};
    }
    return suspicion;
  }

  void add_signs(std::vector<Suspicion>& list) const {
    const bool is_single = n_y_ == 1 && n_u_ == 1;
    for (Index c = 0; c < n_y_; ++c) {
      Suspicion flipped{wiring_, row(c), {}, 0.0};
      flipped.rewiring.output_factors(c) *= -1.0;
      flipped.fault.channels = {output(c)};
      flipped.fault.message = fmt::format("{} has the wrong sign", output(c));
      if (is_single) {
        flipped.fault.channels.push_back(input(0));
        flipped.fault.message = fmt::format("{} or {} has the wrong sign", output(0), input(0));
      }
      list.push_back(std::move(flipped));
    }
    for (Index i = 0; i < n_u_ && !is_single; ++i) {
      Suspicion flipped{wiring_, column(i), {}, 0.0};
      flipped.rewiring.input_factors(i) *= -1.0;
      flipped.fault = {{input(i)}, fmt::format("{} has the wrong sign", input(i)), 0.0, 0.0};
      list.push_back(std::move(flipped));
    }
    // Both of one joint: its own response stays, those with the others change.
    for (Index j = 0; j < std::min(n_y_, n_u_) && n_y_ == n_u_ && !is_single; ++j) {
      Suspicion flipped{wiring_, {}, {}, 0.0};
      flipped.rewiring.output_factors(j) *= -1.0;
      flipped.rewiring.input_factors(j) *= -1.0;
      for (Index other = 0; other < n_u_; ++other) {
        if (other == j) continue;
        flipped.touched.emplace_back(j, other);
        flipped.touched.emplace_back(other, j);
      }
      flipped.fault = {{input(j), output(j)},
                       fmt::format("{} and {} both have the wrong sign: that of the gear ratio?",
                                   input(j), output(j)),
                       0.0,
                       0.0};
      list.push_back(std::move(flipped));
    }
  }

  void add_units(std::vector<Suspicion>& list) const {
    const bool is_single = n_y_ == 1 && n_u_ == 1;
    for (Index c = 0; c < n_y_; ++c) {
      const double factor = factor_of(true, c);
      if (std::abs(std::log(factor)) < std::log(kSmallestFactor)) continue;
      Suspicion scaled{wiring_, row(c), {}, 0.0};
      scaled.rewiring.output_factors(c) /= factor;
      scaled.fault.channels = {output(c)};
      scaled.fault.message = unit_words(output(c), compared_.output_units, c, factor);
      if (is_single) {
        scaled.fault.channels.push_back(input(0));
        scaled.fault.message +=
            fmt::format(", or {} that much too {}", input(0), factor > 1.0 ? "small" : "large");
      }
      list.push_back(std::move(scaled));
    }
    for (Index i = 0; i < n_u_ && !is_single; ++i) {
      const double factor = 1.0 / factor_of(false, i);
      if (std::abs(std::log(factor)) < std::log(kSmallestFactor)) continue;
      Suspicion scaled{wiring_, column(i), {}, 0.0};
      scaled.rewiring.input_factors(i) /= factor;
      scaled.fault = {{input(i)}, unit_words(input(i), compared_.input_units, i, factor), 0.0, 0.0};
      list.push_back(std::move(scaled));
    }
  }

  void add_swaps(std::vector<Suspicion>& list) const {
    const auto add = [&](bool outputs, bool inputs, Index a, Index b) {
      Suspicion swapped{wiring_, {}, {}, 0.0};
      const auto first = static_cast<std::size_t>(a), second = static_cast<std::size_t>(b);
      std::string names;
      for (const bool is_output : {true, false}) {
        if (!(is_output ? outputs : inputs)) continue;
        auto& from = is_output ? swapped.rewiring.outputs : swapped.rewiring.inputs;
        std::swap(from[first], from[second]);
        for (const Index channel : {a, b}) {
          for (const auto& element : is_output ? row(channel) : column(channel)) {
            if (std::ranges::find(swapped.touched, element) == swapped.touched.end()) {
              swapped.touched.push_back(element);
            }
          }
          swapped.fault.channels.push_back(is_output ? output(channel) : input(channel));
        }
        names += fmt::format("{}{} and {}", names.empty() ? "" : ", and ",
                             is_output ? output(a) : input(a), is_output ? output(b) : input(b));
      }
      swapped.fault.message = names + " are swapped";
      list.push_back(std::move(swapped));
    };
    for (Index a = 0; a < n_y_; ++a) {
      for (Index b = a + 1; b < n_y_; ++b) add(true, false, a, b);
    }
    for (Index a = 0; a < n_u_; ++a) {
      for (Index b = a + 1; b < n_u_; ++b) {
        add(false, true, a, b);
        if (n_y_ == n_u_) add(true, true, a, b);
      }
    }
  }

  [[nodiscard]] std::optional<Suspicion> best_suspicion() const {
    std::vector<Suspicion> list;
    add_signs(list);
    add_units(list);
    add_swaps(list);
    std::vector<Suspicion> claimed;
    for (Suspicion& suspicion : list) {
      std::optional<Suspicion> found = weighed(std::move(suspicion));
      if (found) claimed.push_back(*std::move(found));
    }
    if (claimed.empty()) return {};
    const auto first = std::ranges::max_element(claimed, {}, &Suspicion::gain);
    std::iter_swap(claimed.begin(), first);
    Suspicion best = std::move(claimed.front());
    const double least = dissimilarity_of_all(best.rewiring);
    for (std::size_t i = 1; i < claimed.size(); ++i) {
      const Suspicion& other = claimed[i];
      const bool is_alike = dissimilarity_of_all(other.rewiring) <= kAlike * least;
      if (is_alike && share_elements(other, best)) best.fault.add_rival(other.fault);
    }
    return best;
  }

  static bool share_elements(const Suspicion& a, const Suspicion& b) {
    return std::ranges::any_of(a.touched, [&b](const std::pair<Index, Index>& element) {
      return std::ranges::find(b.touched, element) != b.touched.end();
    });
  }

  [[nodiscard]] double dissimilarity_of_all(const Rewiring& wiring) const {
    double sum = 0.0;
    for (Index c = 0; c < n_y_; ++c) {
      for (Index i = 0; i < n_u_; ++i) {
        const double own = dissimilarity(wiring, c, i);
        if (!std::isnan(own)) sum += own;
      }
    }
    return sum;
  }

  [[nodiscard]] const std::string& output(Index c) const {
    return compared_.outputs[static_cast<std::size_t>(c)];
  }
  [[nodiscard]] const std::string& input(Index i) const {
    return compared_.inputs[static_cast<std::size_t>(i)];
  }

  static std::string unit_words(const std::string& channel, const std::vector<std::string>& units,
                                Index index, double factor) {
    const auto at = static_cast<std::size_t>(index);
    return unit_fault_words(channel, at < units.size() ? units[at] : "", factor);
  }

  const ComparedResponses& compared_;
  Index n_y_, n_u_;
  Rewiring wiring_;
};

}  // namespace

std::string ChannelFault::statement() const {
  if (rivals.empty()) return message;
  std::string words = "one of: " + message;
  for (const std::string& rival : rivals) words += "; " + rival;
  return words;
}

void ChannelFault::add_rival(const ChannelFault& other) {
  rivals.push_back(other.message);
  for (const std::string& channel : other.channels) {
    if (std::ranges::find(channels, channel) == channels.end()) channels.push_back(channel);
  }
}

std::vector<ChannelFault> find_channel_faults(const ComparedResponses& compared) {
  return Detective(compared).run();
}

std::string unit_fault_words(const std::string& channel, const std::string& unit, double factor) {
  struct Known {
    double factor;
    std::string_view dimension;  // the unit begins with it
    std::string_view words;
  };
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  static constexpr std::array<Known, 8> kKnown{{
      {kDegrees, "rad", "degrees"},
      {30.0 / std::numbers::pi, "rad/s", "revolutions a minute"},
      {0.5 / std::numbers::pi, "rad", "revolutions"},
      {1000.0, "", "thousandths of the unit stated"},
      {0.001, "", "thousands of the unit stated"},
      {1.0 / kDegrees, "rad", "radians, where degrees are stated"},
      {1e6, "", "millionths of the unit stated"},
      {1e-6, "", "millions of the unit stated"},
  }};
  constexpr double kClose = 0.25;  // of the logarithm: parameters are off, too
  std::string guess;
  for (const Known& known : kKnown) {
    if (std::abs(std::log(factor / known.factor)) < kClose && unit.starts_with(known.dimension)) {
      guess = fmt::format(": {}?", known.words);
      break;
    }
  }
  return fmt::format("{} is {:.3g} times too {} for {}{}", channel,
                     factor > 1.0 ? factor : 1.0 / factor, factor > 1.0 ? "large" : "small",
                     unit.empty() ? "its unit" : unit,
                     guess.empty() ? ": another unit, a gear ratio or a gain?"
                                   : guess + " (or a gear ratio or gain of that size)");
}

}  // namespace graybox
