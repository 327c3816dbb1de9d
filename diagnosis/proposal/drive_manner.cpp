#include "diagnosis/proposal/drive_manner.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/lost_sign.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

constexpr double kHardly = 0.1;
constexpr double kAgree = 0.9;
constexpr Eigen::Index kOver = 5;  // samples, of accelerations

struct Extent {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  double sum = 0.0, squares = 0.0, count = 0.0;
  double negative = 0.0, negative_squares = 0.0;  // of them
  std::vector<double> ends = {};                  // the first and the last of each recording

  void add(const Eigen::VectorXd& values) {
    if (values.size() > 0) ends.insert(ends.end(), {values(0), values(values.size() - 1)});
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      lowest = std::min(lowest, value);
      highest = std::max(highest, value);
      sum += value;
      squares += value * value;
      count += 1.0;
      if (value < 0.0) {
        negative += 1.0;
        negative_squares += value * value;
      }
    }
  }
  [[nodiscard]] bool has_one_sign() const { return lowest >= 0.0 || highest <= 0.0; }
  // But for few samples, and small ones: noise about zero, a short pulse.
  [[nodiscard]] bool has_nearly_one_sign() const {
    constexpr double kFew = 0.02;
    const double few = std::min(negative, count - negative),
                 small = std::min(negative_squares, squares - negative_squares);
    return few <= kFew * count && small <= kFew * squares;
  }
  // Off, or nearly, where a recording begins or ends: a step, as no supply makes.
  [[nodiscard]] bool steps() const {
    constexpr double kOff = 0.5;
    const double largest = std::max(std::abs(lowest), std::abs(highest));
    return std::ranges::any_of(ends, [&](double end) { return std::abs(end) < kOff * largest; });
  }
  [[nodiscard]] double variation() const {
    const double mean = sum / std::max(count, 1.0);
    const double variance = squares / std::max(count, 1.0) - mean * mean;
    return mean == 0.0 ? HUGE_VAL : std::sqrt(std::max(variance, 0.0)) / std::abs(mean);
  }
};

// Without gaps, and with the sign that a number lost which was read as unsigned.
Eigen::VectorXd values_of(const LogColumn& drive) {
  const Eigen::VectorXd values = without_gaps(drive.values);
  const std::optional<CounterWrap> wrap = find_wrap(values / drive.words.unit_factor, 0.0);
  return wrap ? unwrapped(values, wrap->period * drive.words.unit_factor) : values;
}

bool is_measured_motion(const LogColumn& column) {
  const LogQuantity quantity = column.words.quantity;
  return (quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity) &&
         !column.words.is_reference && column.moves();
}

// What a motion has that a force may follow: its rate, the change of that, and the position.
std::vector<Eigen::VectorXd> followed(const LogColumn& motion) {
  const Eigen::VectorXd values = without_gaps(motion.values);
  const bool is_position = motion.words.quantity == LogQuantity::kPosition;
  const Eigen::VectorXd rate = is_position ? central_steps(values) : values;
  Eigen::VectorXd change = Eigen::VectorXd::Zero(rate.size());
  for (Eigen::Index k = kOver; k + kOver < rate.size(); ++k) {
    change(k) = rate(k + kOver) - rate(k - kOver);
  }
  std::vector<Eigen::VectorXd> list{rate, change};
  if (is_position) list.push_back(values);
  return list;
}

// The drive beside the rate of one motion, of all recordings one behind the other: one may go there
// and the next one back.
class JoinedRecordings {
 public:
  void add(const LogColumn& drive, const LogColumn& motion) {
    if (drive.values.size() != motion.values.size()) return;
    if (motion_.empty()) motion_ = motion.name;
    if (motion.name != motion_) return;
    append(values_of(drive), drive_);
    append(followed(motion).front(), rate_);
  }
  [[nodiscard]] bool go_both_ways() const { return moves_both_ways(rate_); }
  // Whether a drive of nearly one sign lost it: its few samples of the other one count as zeros.
  [[nodiscard]] bool have_lost_sign() const {
    const Eigen::VectorXd drive = drive_.sum() < 0.0 ? Eigen::VectorXd(drive_.cwiseMin(0.0))
                                                     : Eigen::VectorXd(drive_.cwiseMax(0.0));
    return find_lost_sign(drive, rate_).has_value();
  }

 private:
  static void append(const Eigen::VectorXd& values, Eigen::VectorXd& all) {
    const Eigen::Index before = all.size();
    all.conservativeResize(before + values.size());
    all.tail(values.size()) = values;
  }

  std::string motion_;
  Eigen::VectorXd drive_, rate_;
};

void compare(const LogColumn& drive, const LogColumn& motion, bool& both_ways,
             DriveManner& manner) {
  if (drive.values.size() != motion.values.size()) return;
  const std::vector<Eigen::VectorXd> list = followed(motion);
  const Eigen::VectorXd values = values_of(drive);
  both_ways = both_ways || moves_both_ways(list.front());
  manner.lost_sign = manner.lost_sign || find_lost_sign(values, list.front()).has_value();
  for (const Eigen::VectorXd& each : list) {
    manner.follows = std::max(manner.follows, std::abs(correlation(values, each)));
  }
}

Eigen::VectorXd steps_between(const Eigen::VectorXd& values) {
  return values.tail(values.size() - 1) - values.head(values.size() - 1);
}

struct LeastSquares {
  Eigen::VectorXd values, left;

  LeastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right)
      : values(columns.colPivHouseholderQr().solve(right)), left(right - columns * values) {}
};

// Whether the second differences of a position are a multiple of it, and a constant.
bool swings_at_one_frequency(const Eigen::VectorXd& position) {
  constexpr double kLeft = 0.1;
  const Eigen::VectorXd bends = steps_between(steps_between(position));
  Eigen::MatrixXd columns = Eigen::MatrixXd::Ones(bends.size(), 2);
  columns.col(0) = position.segment(1, bends.size());
  const double deviation = (bends.array() - bends.mean()).matrix().norm();
  return LeastSquares(columns, bends).left.norm() <= kLeft * deviation;
}

// A step at the drive's sign, where it has both.
bool has_both_signs(const Eigen::VectorXd& drive) {
  constexpr double kFew = 0.05;  // of the rows
  const auto least = kFew * static_cast<double>(drive.size());
  return static_cast<double>((drive.array() > 0.0).count()) >= least &&
         static_cast<double>((drive.array() < 0.0).count()) >= least;
}

}  // namespace

DriveManner manner_of_drive(const LogColumn& drive, const std::vector<LogRecording>& recordings) {
  DriveManner manner;
  Extent extent;
  JoinedRecordings joined;
  bool both_ways = false;
  for (const LogRecording& recording : recordings) {
    const auto here = std::ranges::find_if(recording.columns, [&](const LogColumn& column) {
      return column.file == drive.file && column.name == drive.name;
    });
    if (here == recording.columns.end()) continue;
    extent.add(values_of(*here));
    for (const LogColumn& column : recording.columns) {
      if (!is_measured_motion(column)) continue;
      compare(*here, column, both_ways, manner);
      joined.add(*here, column);
    }
  }
  manner.variation = extent.variation();
  manner.hardly_moves = extent.has_one_sign() && !extent.steps() && manner.variation < kHardly;
  manner.has_one_sign = extent.has_one_sign() && both_ways;
  manner.has_nearly_one_sign = extent.has_nearly_one_sign() && (both_ways || joined.go_both_ways());
  manner.lost_sign = (manner.lost_sign && extent.has_one_sign()) ||
                     (manner.has_nearly_one_sign && joined.have_lost_sign());
  if (both_ways || joined.go_both_ways()) {
    manner.sign_bit = find_sign_bit(without_gaps(drive.values) / drive.words.unit_factor);
  }
  if (manner.sign_bit) manner.has_one_sign = manner.has_nearly_one_sign = manner.lost_sign = false;
  return manner;
}

bool disagree(const LogColumn& a, const LogColumn& b) {
  return std::abs(correlation(values_of(a), values_of(b))) < kAgree;
}

std::optional<double> left_of_feedback(const Eigen::VectorXd& drive,
                                       const std::vector<Eigen::VectorXd>& measured) {
  constexpr Eigen::Index kFewest = 10;  // samples a coefficient
  const Eigen::Index n = drive.size();
  Eigen::MatrixXd columns = Eigen::MatrixXd::Ones(n, std::ssize(measured) + 1);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    if (measured[k].size() != n) return {};
    columns.col(static_cast<Eigen::Index>(k)) = measured[k];
  }
  const double deviation = (drive.array() - drive.mean()).matrix().norm();
  if (n <= kFewest * columns.cols() || !(deviation > 0.0)) return {};
  const Eigen::VectorXd left = drive - columns * columns.colPivHouseholderQr().solve(drive);
  return left.norm() / deviation;
}

std::optional<double> left_of_position_feedback(const Eigen::VectorXd& drive,
                                                const Eigen::VectorXd& position) {
  constexpr Eigen::Index kFewest = 50;
  constexpr double kOfOthers = 0.25, kOfPosition = 0.5, kOfSteps = 0.5;
  const Eigen::Index n = drive.size() - 1;
  if (n < kFewest || position.size() != drive.size() || has_few_levels(drive)) return {};
  if (!drive.allFinite() || !position.allFinite() || swings_at_one_frequency(position)) return {};
  const Eigen::VectorXd right = drive.tail(n);
  const bool has_step = has_both_signs(right);
  Eigen::MatrixXd columns(n, has_step ? 4 : 3);  // the position, its rate, the step, a constant
  columns.col(0) = position.tail(n);
  columns.col(1) = steps_between(position);
  if (has_step) columns.col(2) = right.array().sign();
  columns.rightCols(1).setOnes();
  Eigen::MatrixXd plain = Eigen::MatrixXd::Ones(n, 2);
  plain.col(0) = columns.col(0);
  const LeastSquares all(columns, right);
  const double left = all.left.norm(), deviation = (right.array() - right.mean()).matrix().norm();
  const bool brakes = all.values(0) < 0.0 && all.values(1) < 0.0;
  if (!brakes || (has_step && !(all.values(2) > 0.0))) return {};
  const double of_others = LeastSquares(columns.rightCols(columns.cols() - 1), right).left.norm(),
               of_position = LeastSquares(plain, right).left.norm();
  if (!(left <= kOfOthers * of_others) || !(left <= kOfPosition * of_position)) return {};
  if (!(steps_between(all.left).norm() <= kOfSteps * steps_between(right).norm())) return {};
  return left / deviation;
}

std::string doubt_words(const LogColumn& drive, const DriveManner& manner) {
  if (manner.hardly_moves) {
    const LogQuantity quantity = drive.words.quantity;
    const bool may_be_supply =
        quantity == LogQuantity::kVoltage || quantity == LogQuantity::kCommand;
    return fmt::format("moves by {:.2g} % of its mean and never changes its sign{}",
                       100.0 * manner.variation, may_be_supply ? ", as a supply does" : "");
  }
  return "never changes its sign while the axis moves both ways, and does not follow its motion";
}

}  // namespace graybox
