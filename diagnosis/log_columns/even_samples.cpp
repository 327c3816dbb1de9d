#include "diagnosis/log_columns/even_samples.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/recordings/sample_interpolation.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kGap = 5.5;  // sample times

struct GaplessSamples {
  Index first = 0, count = 0;
};

// The longest one whose steps are at most that long.
GaplessSamples longest_stretch(const Eigen::VectorXd& times, double longest_step) {
  GaplessSamples best;
  for (Index first = 0, end = 0; first < times.size(); first = end) {
    for (end = first + 1; end < times.size() && times(end) - times(end - 1) <= longest_step;) ++end;
    if (end - first > best.count) best = {first, end - first};
  }
  return best;
}

}  // namespace

EvenSamples::EvenSamples(const LogRecording& recording, const LogTime& time)
    : every_(time.every), from_(time.from), step_(time.sample_time) {
  if (time.column.empty() || time.is_even || !(step_ > 0.0)) return;
  const LogColumn& column = recording.at(time.file, time.column);
  const Eigen::VectorXd all = time.seconds() * column.values;
  const Index kept = (all.size() - from_ + every_ - 1) / every_;
  times_ = all(Eigen::seqN(from_, kept, every_));
  if (times_.size() < 2) return;
  const Index steps_taken = times_.size() - 1;
  const double usual = longest_step(times_.tail(steps_taken) - times_.head(steps_taken));
  const GaplessSamples stretch = longest_stretch(times_, std::max(kGap * step_, usual));
  constexpr Index kFewest = 5;
  if (stretch.count < kFewest) {
    times_.resize(0);
    return;
  }
  first_ = stretch.first;
  count_ = stretch.count;
  const double duration = times_(first_ + count_ - 1) - times_(first_);
  const auto steps = static_cast<Index>(std::floor(duration / step_ + 1e-6));
  at_ = times_(first_) + step_ * Eigen::ArrayXd::LinSpaced(steps + 1, 0.0, double(steps));
  at_(steps) = std::min(at_(steps), times_(first_ + count_ - 1));
}

Eigen::VectorXd EvenSamples::of(const Eigen::VectorXd& values) const {
  const Index kept = (values.size() - from_ + every_ - 1) / every_;
  const Eigen::VectorXd thinned = values(Eigen::seqN(from_, kept, every_));
  if (times_.size() == 0 || times_.size() != kept) return thinned;
  return interpolated(times_.segment(first_, count_), thinned.segment(first_, count_), at_);
}

Eigen::VectorXd without_gaps(Eigen::VectorXd values) {
  double before = 0.0;
  for (const double value : values) {
    if (std::isfinite(value)) {
      before = value;
      break;
    }
  }
  for (double& value : values) before = value = std::isfinite(value) ? value : before;
  return values;
}

}  // namespace graybox
