#include "diagnosis/log_columns/column_rates.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <vector>

#include "diagnosis/recordings/late_signal.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestSamples = 50;
constexpr Eigen::Index kFewestOfComparison = 200;  // compare_late()

constexpr double kWorstMisfit = 0.5;
constexpr double kTolerance = 1.125;  // a factor; the candidates' are further apart

double factor_of(const std::string& unit) {
  const Unit* known = find_unit(unit);
  return known == nullptr ? 1.0 : known->factor;
}

// Above one: how far the factor is from that of the units.
double distance(double factor, const std::string& position, const std::string& velocity) {
  const double ratio = factor * factor_of(position) / factor_of(velocity);
  return ratio > 0.0 ? std::max(ratio, 1.0 / ratio) : INFINITY;
}

// SI first; kinds of motion do not mix. Turns only where they are stated, or go with rpm.
std::vector<MotionUnits> candidates(MotionKind motion, bool with_turns) {
  std::vector<MotionUnits> list;
  if (motion != MotionKind::kLinear) {
    for (const std::string position : {"rad", "deg", "turn"}) {
      for (const std::string velocity : {"rad/s", "deg/s", "rpm", "turn/s"}) {
        const bool has_turns = velocity == "turn/s" || (position == "turn" && velocity != "rpm");
        if (!with_turns && has_turns) continue;
        list.push_back({position, velocity, true, false, ""});
      }
    }
  }
  if (motion != MotionKind::kRotary) {
    for (const char* position : {"m", "mm"}) {
      for (const char* velocity : {"m/s", "mm/s"}) {
        list.push_back({position, velocity, true, false, ""});
      }
    }
  }
  return list;
}

bool are_one_joint(const LogColumn& a, const LogColumn& b) {
  return a.words.index == b.words.index && a.words.side == b.words.side && a.joint == b.joint &&
         !a.words.is_reference && !b.words.is_reference;
}

// The one unit of time with which the pair agrees: what has no unit is first taken for SI.
std::string time_unit_of_rate(double factor, const ColumnWords& position,
                              const ColumnWords& velocity) {
  const bool is_linear = position.motion == MotionKind::kLinear;
  const auto or_si = [](const std::string& unit, const char* si) {
    return unit.empty() ? std::string(si) : unit;
  };
  for (const bool as_si : {true, false}) {
    std::vector<std::string> fitting;
    for (const char* unit : {"s", "ms", "us", "ns"}) {
      const double scaled = factor / factor_of(unit);
      const MotionUnits units =
          as_si ? units_by_rate(scaled, or_si(position.unit, is_linear ? "m" : "rad"),
                                or_si(velocity.unit, is_linear ? "m/s" : "rad/s"), position.motion)
                : units_by_rate(scaled, position.unit, velocity.unit, position.motion);
      if (units.is_found) fitting.emplace_back(unit);
    }
    if (fitting.size() == 1) return fitting.front();
  }
  return "";
}

// Means over so many samples, those beside each where there are as many.
Eigen::VectorXd smoothed(const Eigen::VectorXd& values, Eigen::Index over) {
  Eigen::VectorXd means(values.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const Eigen::Index from = std::max<Eigen::Index>(0, k - over / 2),
                       to = std::min(values.size() - 1, k + over / 2);
    means(k) = values.segment(from, to - from + 1).mean();
  }
  return means;
}

// Least squares of the rate on the velocity, shifted by whole samples: for short logs.
RateFit fit_short_rate(const Eigen::VectorXd& rate, const Eigen::VectorXd& velocity, double step) {
  constexpr Eigen::Index kOver = 5, kLatest = 8, kEarliest = 2;
  const Eigen::VectorXd x = smoothed(velocity, kOver), y = smoothed(rate, kOver);
  RateFit best{0.0, 0.0, INFINITY};
  for (Eigen::Index late = -kEarliest; late <= kLatest; ++late) {
    const Eigen::Index n = x.size() - kEarliest - kLatest;
    Eigen::ArrayXd a = x.segment(kEarliest + late, n), b = y.segment(kEarliest, n);
    a -= a.mean();
    b -= b.mean();
    const double square = a.square().sum();
    if (!(square > 0.0) || !(b.square().sum() > 0.0)) continue;
    const double factor = (a * b).sum() / square;
    const double misfit = std::sqrt((b - factor * a).square().sum() / b.square().sum());
    if (misfit < best.misfit) best = {factor, static_cast<double>(late) * step, misfit};
  }
  return best;
}

// The factor of the velocity in the position's rate, by integrals beside a drift; 0 where that
// does not tell it. The noise of a differentiated position makes the factor of the rates too large.
double factor_of_integral(const Eigen::VectorXd& position, const Eigen::VectorXd& velocity,
                          double step) {
  constexpr double kClearly = 0.02;  // of the squares may be left
  const Eigen::Index n = position.size();
  Eigen::MatrixX2d line(n, 2);
  line.col(0).setOnes();
  line.col(1).setLinSpaced(n, -1.0, 1.0);
  Eigen::VectorXd integral = Eigen::VectorXd::Zero(n);
  for (Eigen::Index k = 1; k < n; ++k) {
    integral(k) = integral(k - 1) + 0.5 * step * (velocity(k) + velocity(k - 1));
  }
  const auto qr = line.householderQr();
  const Eigen::VectorXd way = position - line * qr.solve(position),
                        own = integral - line * qr.solve(integral);
  const double square = own.squaredNorm();
  if (!(square > 0.0)) return 0.0;
  const double factor = own.dot(way) / square;
  return (way - factor * own).squaredNorm() < kClearly * way.squaredNorm() ? factor : 0.0;
}

}  // namespace

std::pair<Eigen::VectorXd, bool> without_wraps(const Eigen::VectorXd& position, double turn) {
  const std::optional<CounterWrap> wrap = find_wrap(position, turn);
  if (!wrap) return {position, false};
  return {unwrapped(position, wrap->period), true};
}

void name_by_rates(std::vector<LogRecording>& recordings, double step) {
  constexpr double kSurely = 0.2;  // of the misfit
  std::vector<LogColumn>& columns = recordings.front().columns;
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const LogQuantity quantity = columns[k].words.quantity;
    if (quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity) return;
    if (quantity == LogQuantity::kUnknown && columns[k].moves()) open.push_back(k);
  }
  constexpr std::size_t kMost = 12;  // pairs take time
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const std::size_t position : open) {
    for (const std::size_t velocity : open) {
      if (position == velocity || open.size() > kMost) continue;
      const auto fit = fit_rate(columns[position].values, columns[velocity].values, step);
      if (fit && fit->misfit < kSurely) pairs.emplace_back(position, velocity);
    }
  }
  if (pairs.size() != 1) return;
  const auto [position, velocity] = pairs.front();
  const std::string position_name = columns[position].name, velocity_name = columns[velocity].name;
  for (LogRecording& recording : recordings) {
    for (LogColumn& column : recording.columns) {
      if (column.name == position_name) {
        column.words.quantity = LogQuantity::kPosition;
        column.evidence = "its rate is '" + velocity_name + "'";
      } else if (column.name == velocity_name) {
        column.words.quantity = LogQuantity::kVelocity;
        column.evidence = "it is the rate of '" + position_name + "'";
      }
    }
  }
}

std::optional<RateFit> fit_rate(const Eigen::VectorXd& position, const Eigen::VectorXd& velocity,
                                double step) {
  const Eigen::Index n = position.size();
  if (n < kFewestSamples || n != velocity.size() || !position.allFinite() ||
      !velocity.allFinite()) {
    return {};
  }
  const Eigen::VectorXd rate = (position.tail(n - 2) - position.head(n - 2)) / (2.0 * step);
  const Eigen::VectorXd inner = velocity.segment(1, n - 2);
  const auto moves = [](const Eigen::VectorXd& x) {
    return (x.array() - x.mean()).square().mean();
  };
  if (!(moves(rate) > 0.0) || !(moves(inner) > 0.0)) return {};
  if (n - 2 < kFewestOfComparison) {
    const RateFit fit = fit_short_rate(rate, inner, step);
    if (!(fit.misfit < kWorstMisfit) || fit.factor == 0.0) return {};
    return fit;
  }
  const LateFit fit = compare_late(rate, inner, step).best();
  if (!(fit.misfit < kWorstMisfit) || fit.gain == 0.0) return {};
  RateFit result{1.0 / fit.gain, fit.late, fit.misfit};
  const bool is_in_time = std::abs(fit.late) <= 2.0 * step;
  if (const double factor = factor_of_integral(position, velocity, step);
      is_in_time && factor * result.factor > 0.0) {
    result.factor = factor;
  }
  return result;
}

MotionUnits units_by_rate(double factor, const std::string& position, const std::string& velocity,
                          MotionKind motion) {
  MotionUnits best{position, velocity, false, true, ""};
  double nearest = kTolerance;
  const double size = std::abs(factor);
  // A hair's breadth is no reason to leave SI.
  constexpr double kClearly = 0.98;
  const bool with_turns = position == "turn" || velocity == "turn/s";
  for (const MotionUnits& each : candidates(motion, with_turns)) {
    if (!position.empty() && each.position != position) continue;
    if (!velocity.empty() && each.velocity != velocity) continue;
    const double off = distance(size, each.position, each.velocity);
    if (off - 1.0 >= kClearly * (nearest - 1.0)) continue;
    nearest = off;
    best = each;
  }
  if (best.contradicts && !position.empty() && !velocity.empty()) {
    const double off = distance(size, position, velocity);
    if (off < kTolerance) best = {position, velocity, true, false, ""};
  }
  if (best.is_found) {
    best.why = fmt::format("the rate of the position is {:.3g} times the velocity", factor);
  }
  return best;
}

std::string time_unit_by_rates(const LogRecording& recording, double step) {
  for (const LogColumn& position : recording.columns) {
    if (position.words.quantity != LogQuantity::kPosition || !position.moves()) continue;
    for (const LogColumn& velocity : recording.columns) {
      if (velocity.words.quantity != LogQuantity::kVelocity || !velocity.moves() ||
          !are_one_joint(position, velocity) || position.words.unit == "counts") {
        continue;
      }
      const std::optional<RateFit> fit = fit_rate(position.values, velocity.values, step);
      if (!fit) continue;
      return time_unit_of_rate(fit->factor, position.words, velocity.words);
    }
  }
  return "";
}

}  // namespace graybox
