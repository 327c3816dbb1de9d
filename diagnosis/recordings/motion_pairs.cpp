#include "diagnosis/recordings/motion_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "diagnosis/recordings/late_signal.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kFewest = 500;
constexpr double kAlike = 0.5;       // correlation in time, below which a pair is not looked at
constexpr double kOneMotion = 0.15;  // of the deviation, left
constexpr double kOneAxis = 0.02;    // the same of two outputs: joints may move in step,
constexpr double kAxisGain = 0.05;   // and then differ by a factor
constexpr double kGain = 0.02;
constexpr double kErrors = 4.0;
constexpr double kLate = 0.2;   // samples
constexpr double kFalls = 0.7;  // of the misfit
constexpr double kNoRate = 0.5;
constexpr Index kShifts = 8;  // samples by which channels are shifted to see if they are alike

enum class PairKind { kRate, kReference, kSame };

struct Pair {
  std::size_t from, to;
  PairKind kind;
  LateComparison comparison;
};

VectorXd centred(const VectorXd& values) { return values.array() - values.mean(); }

// Largest correlation over a few shifts, without sign.
double likeness(const VectorXd& x, const VectorXd& y) {
  double best = 0.0;
  for (Index shift = -kShifts; shift <= kShifts; shift += 2) {
    const Index size = x.size() - std::abs(shift);
    const VectorXd a = centred(x.segment(std::max<Index>(0, -shift), size));
    const VectorXd b = centred(y.segment(std::max<Index>(0, shift), size));
    const double norm = a.norm() * b.norm();
    if (norm > 0.0) best = std::max(best, std::abs(a.dot(b)) / norm);
  }
  return best;
}

class PairFinder {
 public:
  PairFinder(const Signals& data, const SignalPiece& piece)
      : data_(data), piece_(piece), sample_time_(*data.sample_time) {}

  // The best partner of a channel.
  [[nodiscard]] std::optional<Pair> partner_of(std::size_t to) const {
    const VectorXd y = piece_.values.col(static_cast<Index>(to));
    double most = kAlike;
    std::optional<std::pair<std::size_t, PairKind>> best;
    for (std::size_t from = 0; moves(y) && from < data_.signals.size(); ++from) {
      const std::optional<PairKind> kind = kind_of(from, to);
      if (!kind) continue;
      const VectorXd x = source(from, *kind);
      const double alike = moves(x) ? likeness(x, y) : 0.0;
      if (alike <= most) continue;
      most = alike;
      best = {from, *kind};
    }
    if (!best) return {};
    const auto [from, kind] = *best;
    return Pair{from, to, kind, compare_late(source(from, kind), y, sample_time_)};
  }

  // The only velocity and position of one kind, which are not one motion.
  [[nodiscard]] std::optional<double> misfit_of_only_pair(std::size_t to) const {
    std::optional<std::size_t> only;
    for (std::size_t from = 0; from < data_.signals.size(); ++from) {
      if (kind_of(from, to) != PairKind::kRate) continue;
      if (only) return {};
      only = from;
    }
    if (!only) return {};
    const VectorXd x = source(*only, PairKind::kRate),
                   y = piece_.values.col(static_cast<Index>(to));
    if (!moves(x) || !moves(y)) return {};
    return compare_late(x, y, sample_time_).best().misfit;
  }

 private:
  [[nodiscard]] std::optional<PairKind> kind_of(std::size_t from, std::size_t to) const {
    if (from == to) return {};
    const Signal &x = data_.signals[from], &y = data_.signals[to];
    if (y.role == ChannelRole::kReference) return {};
    const bool motion = x.unit.starts_with("rad") || x.unit == "m" || x.unit.starts_with("m/");
    if (motion && x.role != ChannelRole::kReference && y.unit == unit_of_derivative(x.unit)) {
      return PairKind::kRate;
    }
    if (x.unit != y.unit) return {};
    if (x.role == ChannelRole::kReference) {  // motion follows its reference as a loop does
      return motion ? std::nullopt : std::optional(PairKind::kReference);
    }
    const bool encoders =
        motion && x.role == ChannelRole::kOutput && y.role == ChannelRole::kOutput;
    return encoders && from < to ? std::optional(PairKind::kSame) : std::nullopt;
  }
  [[nodiscard]] VectorXd source(std::size_t from, PairKind kind) const {
    const VectorXd values = piece_.values.col(static_cast<Index>(from));
    return kind == PairKind::kRate ? time_derivative(piece_.time, values) : values;
  }
  [[nodiscard]] static bool moves(const VectorXd& values) {
    return values.allFinite() && values.maxCoeff() > values.minCoeff();
  }

  const Signals& data_;
  const SignalPiece& piece_;
  double sample_time_;
};

// ---- words --------------------------------------------------------------------------------------

std::string partner_words(const Signals& data, const Pair& pair) {
  const std::string& name = data.signals[pair.from].name;
  return pair.kind == PairKind::kRate ? "the rate of " + name : name;
}

Finding finding_of(const std::string& source, const Signals& data, const Pair& pair,
                   const char* check, double strength, const std::string& what,
                   std::string otherwise, std::string mend) {
  const std::string& channel = data.signals[pair.to].name;
  const double time = data.pieces.front().time(0);
  Finding finding = data_fault(
      check, channel,
      fmt::format("{}: {} {} (from {:g} s on; {:.2g} % of it is left, {:.2g} as recorded),", source,
                  channel, what, time, 100.0 * pair.comparison.best().misfit,
                  100.0 * pair.comparison.in_time.misfit),
      strength, std::move(otherwise), std::move(mend));
  finding.time = time;
  return finding;
}

bool is_one_motion(const Pair& pair) {
  const LateFit& fit = pair.comparison.best();
  if (pair.kind != PairKind::kSame) return fit.misfit <= kOneMotion;
  return fit.misfit <= kOneAxis && std::abs(std::abs(fit.gain) - 1.0) <= kAxisGain;
}

void add_late(const std::string& source, const Signals& data, const Pair& pair,
              std::vector<Finding>& findings) {
  const LateFit& fit = pair.comparison.best();
  const double threshold = std::max(kErrors * fit.late_error, kLate * *data.sample_time);
  const double size = std::abs(fit.late);
  if (size <= threshold || fit.misfit > kFalls * pair.comparison.in_time.misfit) return;
  const bool delay = pair.comparison.delayed.misfit < pair.comparison.lagged.misfit;
  const std::string law = !pair.comparison.tells_delay_from_lag()
                              ? "delay or lag"
                              : (delay ? "a delay rather than a lag" : "a lag rather than a delay");
  const std::string what =
      fmt::format("is {} by {:.4g} +- {:.2g} ms against {} ({})", fit.late > 0 ? "late" : "early",
                  1e3 * size, 1e3 * fit.late_error, partner_words(data, pair), law);
  const bool follows = pair.kind == PairKind::kReference;
  const std::string& late = data.signals[fit.late > 0 ? pair.to : pair.from].name;
  findings.push_back(finding_of(
      source, data, pair, "late channel", size / threshold, what,
      follows ? "the true lag of an actuator, which belongs into the model"
              : "a filter in the drive, or a part between the two that yields",
      follows
          ? fmt::format("take {} as input, or give the model's actuator this delay or lag", late)
          : fmt::format("preprocess: [{{kind: advance, of: [{}], time: {:.4g}}}]", late, size)));
}

void add_gain(const std::string& source, const Signals& data, const Pair& pair,
              std::vector<Finding>& findings) {
  const LateFit& fit = pair.comparison.best();
  const std::string& channel = data.signals[pair.to].name;
  if (fit.gain < 0.0) {
    findings.push_back(
        finding_of(source, data, pair, "sign", -fit.gain / std::max(kErrors * fit.gain_error, 1e-9),
                   fmt::format("has the opposite sign of {}", partner_words(data, pair)),
                   "the other of the two being reversed",
                   fmt::format("preprocess: [{{kind: sign, of: [{}]}}]", channel)));
  }
  const double off = std::abs(std::abs(fit.gain) - 1.0);
  const double threshold = std::max(kGain, kErrors * fit.gain_error);
  if (pair.kind == PairKind::kSame || off <= threshold) return;
  findings.push_back(
      finding_of(source, data, pair, "gain", off / threshold,
                 fmt::format("is {:.4g} +- {:.1g} times {}", std::abs(fit.gain), fit.gain_error,
                             partner_words(data, pair)),
                 pair.kind == PairKind::kRate
                     ? "a sample_time that is wrong by this factor, a gear, another unit"
                     : "a gear between the two, or another unit",
                 fmt::format("preprocess: [{{kind: scale, of: [{}], factor: {:.5g}}}]", channel,
                             1.0 / std::abs(fit.gain))));
}

void add_no_rate(const std::string& source, const Signals& data, std::size_t to, double misfit,
                 std::vector<Finding>& findings) {
  const std::string& channel = data.signals[to].name;
  findings.push_back(
      data_fault("rate", channel,
                 fmt::format("{}: {} is not the derivative of the position beside it: {:.2g} % of "
                             "it is left,",
                             source, channel, 100.0 * misfit),
                 misfit / kNoRate, "the velocity of another body",
                 "leave it out, or preprocess: derivative of the position"));
}

}  // namespace

void find_late_channels(const std::string& source, const Signals& data,
                        std::vector<Finding>& findings) {
  if (!data.sample_time || data.pieces.empty()) return;
  const SignalPiece& longest = *std::ranges::max_element(
      data.pieces, {}, [](const SignalPiece& piece) { return piece.time.size(); });
  if (longest.time.size() < kFewest) return;
  const PairFinder finder(data, longest);
  for (std::size_t to = 0; to < data.signals.size(); ++to) {
    const std::optional<Pair> pair = finder.partner_of(to);
    if (pair && is_one_motion(*pair)) {
      add_gain(source, data, *pair, findings);
      add_late(source, data, *pair, findings);
      continue;
    }
    const std::optional<double> misfit = finder.misfit_of_only_pair(to);
    if (misfit && *misfit > kNoRate) add_no_rate(source, data, to, *misfit, findings);
  }
}

}  // namespace graybox
