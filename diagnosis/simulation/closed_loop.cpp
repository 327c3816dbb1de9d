#include "diagnosis/simulation/closed_loop.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

// u(t) of the PI controller from the errors so far.
class ControllerState {
 public:
  ControllerState(const PiController& controller, double sample_time)
      : proportional_(controller.proportional),
        rate_(sample_time * controller.integral_time.cwiseInverse()),
        sum_(Eigen::VectorXd::Zero(proportional_.size())) {}

  // The integral includes the newest error, as (1 - q^-1)^-1 does.
  Eigen::VectorXd operator()(const Eigen::VectorXd& error) {
    sum_ += error;
    return proportional_.cwiseProduct(error + rate_.cwiseProduct(sum_));
  }

 private:
  Eigen::VectorXd proportional_, rate_, sum_;
};

// v(t) = (n(t) - n(t-1)) / T_s + white noise.
class OutputNoise {
 public:
  OutputNoise(Eigen::Index size, const ClosedLoopOptions& options, double sample_time)
      : random_(options.seed),
        slope_(std::sqrt(options.noise_psd_slope) / sample_time),
        white_(options.white_noise),
        last_(draw(size)) {}

  Eigen::VectorXd operator()() {
    Eigen::VectorXd newest = draw(last_.size());
    Eigen::VectorXd noise = slope_ * (newest - last_);
    last_ = std::move(newest);
    if (white_.size() > 0) noise += white_.cwiseProduct(draw(white_.size()));
    return noise;
  }

 private:
  Eigen::VectorXd draw(Eigen::Index size) {
    Eigen::VectorXd values(size);
    for (double& value : values) value = random_.normal();
    return values;
  }

  Random random_;
  double slope_;
  Eigen::VectorXd white_;
  Eigen::VectorXd last_;
};

// When to look up from the work.
class Breaks {
 public:
  // Samples since the last break where one is due, else -1.
  Eigen::Index due(Eigen::Index sample) {
    const Clock::time_point now = Clock::now();
    if (sample > 0 && now < next_) return -1;
    next_ = now + std::chrono::milliseconds(50);
    return sample - std::exchange(last_, sample);
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point next_;
  Eigen::Index last_ = 0;
};

void check(const Plant& plant, const std::optional<PiController>& controller,
           const Eigen::MatrixXd& reference, const ClosedLoopOptions& options) {
  if (reference.rows() != plant.input_count() ||
      (controller && (plant.input_count() != plant.output_count() ||
                      controller->proportional.size() != plant.input_count()))) {
    throw InputError(fmt::format(
        "closed loop: {} references, {} controllers, {} inputs and {} outputs must be as many",
        reference.rows(), controller ? controller->proportional.size() : 0, plant.input_count(),
        plant.output_count()));
  }
  if (options.periods == 0) throw InputError("closed loop: periods must be at least 1");
  if (!(options.noise_psd_slope >= 0.0))
    throw InputError("closed loop: noise must not be negative");
  if (options.white_noise.size() != 0 && options.white_noise.size() != plant.output_count()) {
    throw InputError("closed loop: white noise needs a standard deviation for each output");
  }
}

}  // namespace

Recording simulate_closed_loop(Plant& plant, const std::optional<PiController>& controller,
                               double sample_time, const Eigen::MatrixXd& reference,
                               const ClosedLoopOptions& options,
                               const std::function<bool()>& keep_going,
                               const std::function<void(Eigen::Index)>& progress) {
  check(plant, controller, reference, options);
  const Eigen::Index period = reference.cols();
  const auto settling = static_cast<Eigen::Index>(options.settling_periods) * period;
  const auto recorded = static_cast<Eigen::Index>(options.periods) * period;
  Recording recording{Eigen::MatrixXd(plant.input_count(), recorded),
                      Eigen::MatrixXd(plant.input_count(), recorded),
                      Eigen::MatrixXd(plant.output_count(), recorded)};
  plant.restart();
  std::optional<ControllerState> control;
  if (controller) control.emplace(*controller, sample_time);
  OutputNoise noise(plant.output_count(), options, sample_time);
  Breaks breaks;
  for (Eigen::Index t = 0; t < settling + recorded; ++t) {
    if (const Eigen::Index done = breaks.due(t); done >= 0) {
      if (progress) progress(done);
      if (keep_going && !keep_going()) return {};
    }
    const auto r = reference.col(t % period);
    const Eigen::VectorXd y = plant.output() + noise();
    if (!y.allFinite()) throw UnstableMotion("the motion grows without bound");
    const Eigen::VectorXd u = control ? (*control)(r - y) : Eigen::VectorXd(r);
    if (t >= settling) {
      recording.reference.col(t - settling) = r;
      recording.input.col(t - settling) = u;
      recording.output.col(t - settling) = y;
    }
    plant.advance(u);
  }
  return recording;
}

}  // namespace graybox
