// A parameter of a law that changes with what it should not depend on: with the time, as friction
// that fades while a machine warms up; with the position, as friction of a worn guide.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace graybox {

struct LawTrend {
  enum class On : std::uint8_t { kTime, kPosition, kSpeed, kDirection };
  std::size_t law = 0, parameter = 0;  // of those found, in their order
  On on = On::kTime;
  // First and last; least and most along the way; fast and slow; backwards and forwards. In the
  // parameter's unit.
  double from = 0.0, to = 0.0;
  double z = 0.0;        // slope over its standard error
  std::string law_at{};  // "coulomb at axis"
  // What only the change explains of its channel, rms over that of the signal; NaN: not known.
  double of_signal = std::numeric_limits<double>::quiet_NaN();
};

// What a parameter may change with: a value each sample, over one from least to most.
struct TrendCovariate {
  LawTrend::On on = LawTrend::On::kTime;
  Eigen::VectorXd values;
};

// Where samples tell a parameter: `told` is what each adds to its information. One step of a drive
// tells a delay there alone, and nothing of how it changes with time.
class ToldRange {
 public:
  ToldRange(const Eigen::VectorXd& covariate, const Eigen::VectorXd& told);
  // Whether what tells the parameter is spread over enough of the covariate: a standard deviation
  // of a tenth of its range.
  [[nodiscard]] bool is_wide() const;
  // The parameter at the ends of what tells it, on a line through `value` at its mean.
  struct Ends {
    double from = 0.0, to = 0.0;
  };
  [[nodiscard]] Ends ends(double value, double slope) const;

 private:
  double range_ = 0.0, mean_ = 0.0, deviation_ = 0.0, least_ = 0.0, most_ = 0.0;
};

// A line and a wave over the way that was gone; none where nothing moves.
void append_position_covariates(const Eigen::VectorXd& position,
                                std::vector<TrendCovariate>& covariates);
// The direction that has less of a motion: its share of the squared velocities.
[[nodiscard]] double lesser_way(const Eigen::VectorXd& rate);
inline constexpr double kOneWay = 0.01;  // of a lesser way: it may be noise

// Slow or fast; there or back, where it moves both ways.
void append_rate_covariates(const Eigen::VectorXd& rate, std::vector<TrendCovariate>& covariates);

// Time within a recording, over the longest recording's length: -1/2 ... 1/2 at most. A value for
// each sample of all recordings of so many samples, one after another.
[[nodiscard]] Eigen::VectorXd time_covariate(const std::vector<Eigen::Index>& samples);

}  // namespace graybox
