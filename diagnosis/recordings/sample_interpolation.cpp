#include "diagnosis/recordings/sample_interpolation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;
using Values = Eigen::Ref<const Eigen::VectorXd>;

constexpr double kLeftOut = 8.0;  // error of a sample left out over that between samples
constexpr double kLeftOutOfLine = 2.0;
constexpr double kBeyond = 0.25, kBeyondLeftOut = 0.6;  // of the range of four samples
constexpr double kLongStep = 3.0;   // usual steps: nothing is interpolated across
constexpr double kUsual = 0.95;     // of the steps are no longer
constexpr double kLongest = 1.5;    // medians
constexpr double kRounding = 1e-9;  // of a step

// The polynomial through samples first to first + count - 1.
double polynomial(const Values& time, const Values& values, Index first, Index count, double at) {
  double sum = 0.0;
  for (Index i = first; i < first + count; ++i) {
    double weight = 1.0;
    for (Index j = first; j < first + count; ++j) {
      if (j != i) weight *= (at - time(j)) / (time(i) - time(j));
    }
    sum += weight * values(i);
  }
  return sum;
}

struct Between {
  double value = 0.0;
  bool is_of_line = false;
};

// Between the middle two of four samples. A cubic through a burst of samples leaves all bounds in
// the pause beside it: there the line is taken. `beyond`: as far as it may, of the four's range.
Between between(const Values& time, const Values& values, double at, double beyond) {
  const double cubic = polynomial(time, values, 0, 4, at);
  const double lowest = values.minCoeff(), highest = values.maxCoeff();
  const double margin = beyond * (highest - lowest);
  if (cubic >= lowest - margin && cubic <= highest + margin) return {cubic};
  const Index first = at < time(1) ? 0 : at <= time(2) ? 1 : 2;
  return {polynomial(time, values, first, 2, at), true};
}

double deviation_of(const std::vector<SignalPiece>& pieces, Index channel) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (const SignalPiece& piece : pieces) {
    sum += piece.values.col(channel).sum();
    squares += piece.values.col(channel).squaredNorm();
    count += static_cast<double>(piece.time.size());
  }
  return std::sqrt(std::max(0.0, squares / count - sum * sum / (count * count)));
}

std::string error_words(const std::vector<SignalPiece>& pieces, Index channel) {
  double squares = 0.0, count = 0.0;
  for (const SignalPiece& piece : pieces) {
    const auto size = static_cast<double>(piece.time.size());
    squares += size * std::pow(interpolation_error(piece.time, piece.values.col(channel)), 2);
    count += size;
  }
  const double deviation = deviation_of(pieces, channel);
  if (!(deviation > 0.0)) return "0 %";
  return fmt::format("{:.2g} %", 100.0 * std::sqrt(squares / count) / deviation);
}

Eigen::VectorXd steps_of(const std::vector<SignalPiece>& pieces) {
  std::vector<double> steps;
  for (const SignalPiece& piece : pieces) {
    for (Index k = 1; k < piece.time.size(); ++k) {
      steps.push_back(piece.time(k) - piece.time(k - 1));
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(steps.data(), std::ssize(steps));
}

// Adds the stretches of a piece without a step above `longest`, evenly sampled.
void add_even(const SignalPiece& piece, double sample_time, double longest,
              std::vector<SignalPiece>& even) {
  for (Index first = 0, end = 0; first < piece.time.size(); first = end) {
    end = first + 1;
    while (end < piece.time.size() && piece.time(end) - piece.time(end - 1) <= longest) ++end;
    const Index size = end - first;
    if (size < kShortestPiece) continue;
    const auto time = piece.time.segment(first, size);
    const double steps = (time(size - 1) - time(0)) / sample_time;
    const auto last = static_cast<Index>(std::floor(steps + kRounding));
    Eigen::VectorXd at =
        time(0) + sample_time * Eigen::ArrayXd::LinSpaced(last + 1, 0.0, static_cast<double>(last));
    at(last) = std::min(at(last), time(size - 1));
    Eigen::MatrixXd values(last + 1, piece.values.cols());
    for (Index k = 0; k < values.cols(); ++k) {
      values.col(k) = interpolated(time, piece.values.col(k).segment(first, size), at);
    }
    even.push_back(
        {piece.first_sample + static_cast<std::size_t>(first), std::move(at), std::move(values)});
  }
}

}  // namespace

Eigen::VectorXd interpolated(const Values& time, const Values& values, const Values& at) {
  const Index count = std::min<Index>(4, time.size());
  Eigen::VectorXd result(at.size());
  Index after = 1;  // the first sample that is not before
  for (Index k = 0; k < at.size(); ++k) {
    while (after + 1 < time.size() && time(after) < at(k)) ++after;
    const Index first = std::clamp<Index>(after - count / 2, 0, time.size() - count);
    result(k) =
        count < 4 ? polynomial(time, values, first, count, at(k))
                  : between(time.segment(first, 4), values.segment(first, 4), at(k), kBeyond).value;
  }
  return result;
}

double longest_step(const Values& steps) {
  return steps.size() > 0 ? kLongStep * quantile(steps, kUsual) : 0.0;
}

double interpolation_error(const Values& time, const Values& values) {
  const Index size = time.size();
  if (size < 5) return 0.0;
  double squares = 0.0, duration = 0.0;
  Eigen::Vector4d times, others;
  for (Index k = 2; k + 2 < size; ++k) {
    times << time(k - 2), time(k - 1), time(k + 1), time(k + 2);
    others << values(k - 2), values(k - 1), values(k + 1), values(k + 2);
    const Between left_out = between(times, others, time(k), kBeyondLeftOut);
    const double seconds = time(k + 1) - time(k - 1);
    const double error =
        (left_out.value - values(k)) / (left_out.is_of_line ? kLeftOutOfLine : kLeftOut);
    squares += seconds * error * error;
    duration += seconds;
  }
  return std::sqrt(squares / duration);
}

void resample(const PreprocessData& context, const Resample& step) {
  Signals& data = context.data();
  if (data.sample_time) {
    context.fail("resample is for irregular samples; these are even: low_pass and decimate them");
  }
  const Eigen::VectorXd steps = steps_of(data.pieces);
  const double median = steps.size() > 0 ? quantile(steps, 0.5) : 0.0;
  if (steps.size() > 0 && step.sample_time > kLongest * std::max(median, steps.mean())) {
    context.fail(
        fmt::format("resample at {:g} s would fold what samples {:.4g} s apart hold; "
                    "resample at {:.4g} s, then low_pass and decimate",
                    step.sample_time, median, median));
  }
  std::vector<SignalPiece> even;
  const double longest = longest_step(steps);
  for (const SignalPiece& piece : data.pieces) add_even(piece, step.sample_time, longest, even);
  if (even.empty()) {
    context.fail(fmt::format("resample: no {} samples without a step above {:.4g} s",
                             kShortestPiece, longest));
  }
  std::string errors;
  for (std::size_t k = 0; k < data.signals.size(); ++k) {
    errors += fmt::format("{}{} {}", errors.empty() ? "" : ", ", data.signals[k].name,
                          error_words(data.pieces, static_cast<Index>(k)));
  }
  data.remarks.push_back(
      "was resampled: what interpolation is wrong by, of each channel's deviation: " + errors);
  data.pieces = std::move(even);
  data.sample_time = step.sample_time;
}

void advance_channels(const PreprocessData& context, const Advance& step) {
  Signals& data = context.data();
  if (data.excitation) {
    context.fail(
        "advance would cut the periods of an excitation; a late channel is told apart there "
        "by the model: give it a delay");
  }
  for (const std::string& name : step.channels) {
    const auto channel = static_cast<Index>(context.index_of(name));
    data.remarks.push_back(
        fmt::format("{} was advanced by {:g} s: what interpolation is wrong by is about {} of its "
                    "deviation",
                    name, step.time, error_words(data.pieces, channel)));
  }
  const std::vector<Index> channels = context.indices(step.channels);
  for (SignalPiece& piece : data.pieces) {
    const double end = piece.time(piece.time.size() - 1) - step.time;
    const auto kept = static_cast<Index>((piece.time.array() <= end).count());
    if (kept < 2) {
      context.fail(fmt::format("advance by {:g} s is longer than a piece of {:.4g} s", step.time,
                               end + step.time - piece.time(0)));
    }
    const Eigen::VectorXd at = piece.time.head(kept).array() + step.time;
    for (const Index channel : channels) {
      const Eigen::VectorXd values = interpolated(piece.time, piece.values.col(channel), at);
      piece.values.col(channel).head(kept) = values;
    }
    piece.time.conservativeResize(kept);
    piece.values.conservativeResize(kept, Eigen::NoChange);
  }
}

}  // namespace graybox
