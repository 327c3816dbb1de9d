#include "diagnosis/simulation/integrated_plant.hpp"

#include <arkode/arkode_erkstep.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

// More than a held input of one sample ever needs; beyond, the model has become unstable.
constexpr long kMaxStepsPerSample = 5000;
constexpr long kSamplesOfMean = 100;
constexpr double kMostMeanSteps = 1000.0;
// Each is kept in memory.
constexpr double kMostDelayedSamples = 1e6;

struct Context {
  Context() {
    if (SUNContext_Create(nullptr, &handle) != 0) throw std::runtime_error("SUNDIALS: no context");
  }
  ~Context() { SUNContext_Free(&handle); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  SUNContext handle = nullptr;
};

// Times of the sample that a delay splits: delay = (whole + part) T_s.
struct Delay {
  std::size_t whole = 0;
  double part = 0.0;  // of a sample, 0 <= part < 1
};

std::vector<Delay> split(const Eigen::VectorXd& delays, double sample_time) {
  std::vector<Delay> result;
  for (const double delay : delays) {
    const double samples = delay / sample_time;
    if (samples > kMostDelayedSamples) {
      throw InputError(
          fmt::format("elements: a delay of {:g} s is more than {:g} samples of {:g} s; "
                      "make it at most {:g} s",
                      delay, kMostDelayedSamples, sample_time, kMostDelayedSamples * sample_time));
    }
    double whole = std::floor(samples);
    double part = samples - whole;
    if (part > 1.0 - 1e-9) {  // rounding of a whole number of samples
      whole += 1.0;
      part = 0.0;
    } else if (part < 1e-9) {
      part = 0.0;
    }
    result.push_back({static_cast<std::size_t>(whole), part});
  }
  return result;
}

// The last values of one signal, newest first.
class History {
 public:
  History(std::size_t size, double value) : values_(size, value) {}
  void push(double value) {
    newest_ = (newest_ + values_.size() - 1) % values_.size();
    values_[newest_] = value;
  }
  [[nodiscard]] double ago(std::size_t samples) const {
    return values_[(newest_ + samples) % values_.size()];
  }

 private:
  std::vector<double> values_;
  std::size_t newest_ = 0;
};

// The equations of motion of a plant under held inputs. State: (q, q', states of the laws).
class PlantMotion {
 public:
  PlantMotion(std::unique_ptr<Mechanism> mechanism, ElementDynamics elements)
      : mechanism_(std::move(mechanism)),
        elements_(std::move(elements)),
        coordinates_(mechanism_->coordinate_count()),
        q_(coordinates_),
        velocity_(coordinates_),
        force_(coordinates_),
        acceleration_(coordinates_),
        law_states_(elements_.state_count()),
        law_rates_(elements_.state_count()),
        held_(mechanism_->input_count()),
        input_(mechanism_->input_count()),
        output_(mechanism_->output_count()) {}

  [[nodiscard]] const Mechanism& mechanism() const { return *mechanism_; }
  [[nodiscard]] const ElementDynamics& elements() const { return elements_; }
  [[nodiscard]] Eigen::Index state_count() const {
    return 2 * coordinates_ + elements_.state_count();
  }

  // Writes the state of rest, and holds the command that keeps it.
  void rest(const PlantStart& start, Eigen::VectorXd& state) {
    q_ = start.coordinates;
    velocity_.setZero();
    mechanism_->measure(q_, velocity_, output_);
    elements_.rest(q_, start.command, output_, law_states_);
    state << q_, velocity_, law_states_;
    held_ = start.command;
  }

  void hold(Eigen::Index input, double value) { held_(input) = value; }

  [[nodiscard]] Eigen::VectorXd sensed(const double* state) {
    unpack(state);
    mechanism_->measure(q_, velocity_, output_);
    elements_.sense(output_, law_states_, law_rates_);
    return output_;
  }

  void rate_of(const double* state, double* rate) {
    unpack(state);
    force_.setZero();
    elements_.add_force(q_, velocity_, law_states_, force_, law_rates_);
    input_ = held_;
    elements_.act(input_, law_states_, law_rates_);
    mechanism_->accelerate(q_, velocity_, input_, force_, acceleration_);
    if (elements_.senses()) {
      mechanism_->measure(q_, velocity_, output_);
      elements_.sense(output_, law_states_, law_rates_);
    }
    Eigen::Map<Eigen::VectorXd>(rate, state_count()) << velocity_, acceleration_, law_rates_;
  }

 private:
  void unpack(const double* state) {
    q_ = Eigen::Map<const Eigen::VectorXd>(state, coordinates_);
    velocity_ = Eigen::Map<const Eigen::VectorXd>(state + coordinates_, coordinates_);
    law_states_ = Eigen::Map<const Eigen::VectorXd>(state + 2 * coordinates_, law_states_.size());
  }

  std::unique_ptr<Mechanism> mechanism_;
  ElementDynamics elements_;
  Eigen::Index coordinates_;
  Eigen::VectorXd q_, velocity_, force_, acceleration_, law_states_, law_rates_;
  Eigen::VectorXd held_, input_, output_;
};

class IntegratedPlant final : public Plant {
 public:
  IntegratedPlant(std::unique_ptr<Mechanism> mechanism, ElementDynamics elements, PlantStart start,
                  double sample_time, const IntegratorOptions& options)
      : motion_(std::move(mechanism), std::move(elements)),
        start_(std::move(start)),
        sample_time_(sample_time),
        input_delays_(split(motion_.elements().input_delays(), sample_time)),
        output_delays_(split(motion_.elements().output_delays(), sample_time)),
        state_(motion_.state_count()) {
    find_stops();
    restart();
    vector_ = N_VMake_Serial(state_.size(), state_.data(), context_.handle);
    memory_ = vector_ == nullptr ? nullptr : ERKStepCreate(rate, 0.0, vector_, context_.handle);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS: no memory for the integrator");
    ERKStepSetUserData(memory_, this);
    ERKStepSetErrHandlerFn(memory_, keep_quiet, nullptr);
    ERKStepSetTableNum(memory_, ARKODE_DORMAND_PRINCE_7_4_5);
    ERKStepSStolerances(memory_, options.relative_tolerance, options.absolute_tolerance);
    ERKStepSetMaxNumSteps(memory_, kMaxStepsPerSample);
  }
  ~IntegratedPlant() override {
    ERKStepFree(&memory_);
    N_VDestroy(vector_);
  }
  IntegratedPlant(const IntegratedPlant&) = delete;
  IntegratedPlant& operator=(const IntegratedPlant&) = delete;

  [[nodiscard]] Eigen::Index input_count() const override {
    return motion_.mechanism().input_count();
  }
  [[nodiscard]] Eigen::Index output_count() const override {
    return motion_.mechanism().output_count();
  }

  void restart() override {
    motion_.rest(start_, state_);
    step_ = 0.0;
    const Eigen::VectorXd measured = motion_.sensed(state_.data());
    inputs_.clear();
    outputs_.clear();
    for (std::size_t j = 0; j < input_delays_.size(); ++j) {
      inputs_.emplace_back(input_delays_[j].whole + 2,
                           start_.command(static_cast<Eigen::Index>(j)));
    }
    for (std::size_t j = 0; j < output_delays_.size(); ++j) {
      outputs_.emplace_back(output_delays_[j].whole + 1, measured(static_cast<Eigen::Index>(j)));
    }
  }

  // A sensor that is late by (whole + part) samples shows what it saw that long ago.
  [[nodiscard]] Eigen::VectorXd output() const override {
    Eigen::VectorXd result(output_count());
    for (std::size_t j = 0; j < outputs_.size(); ++j) {
      result(static_cast<Eigen::Index>(j)) = outputs_[j].ago(output_delays_[j].whole);
    }
    return result;
  }

  void advance(const Eigen::VectorXd& input) override {
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(j);
      inputs_[j].push(start_.command(i) + input(i));
    }
    double from = 0.0;
    for (const double stop : stops_) {
      hold_inputs(from);
      integrate((stop - from) * sample_time_);
      record_outputs(stop);
      from = stop;
    }
    require_bearable_steps();
  }

 private:
  // Where the input of some actuator jumps or some sensor looks, as parts of the sample, up to 1.
  void find_stops() {
    stops_.push_back(1.0);
    for (const Delay& delay : input_delays_) {
      if (delay.part > 0.0) stops_.push_back(delay.part);
    }
    for (const Delay& delay : output_delays_) {
      if (delay.part > 0.0) stops_.push_back(1.0 - delay.part);
    }
    std::ranges::sort(stops_);
    stops_.erase(std::unique(stops_.begin(), stops_.end()), stops_.end());
  }

  void hold_inputs(double part_of_sample) {
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      const Delay& delay = input_delays_[j];
      const bool has_arrived = part_of_sample >= delay.part;
      motion_.hold(static_cast<Eigen::Index>(j),
                   inputs_[j].ago(delay.whole + (has_arrived ? 0 : 1)));
    }
  }

  void record_outputs(double part_of_sample) {
    Eigen::VectorXd measured;
    for (std::size_t j = 0; j < outputs_.size(); ++j) {
      if (part_of_sample != 1.0 - output_delays_[j].part) continue;
      if (measured.size() == 0) measured = motion_.sensed(state_.data());
      outputs_[j].push(measured(static_cast<Eigen::Index>(j)));
    }
  }

  // Fast parts (stiff springs, hard friction) cost steps without end where others need a few.
  void require_bearable_steps() {
    if (++samples_ % kSamplesOfMean != 0) return;
    long steps = 0;
    ERKStepGetNumSteps(memory_, &steps);
    const double mean = static_cast<double>(steps - steps_before_) / kSamplesOfMean;
    steps_before_ = steps;
    if (mean > kMostMeanSteps) fail_too_stiff(mean);
  }
  [[noreturn]] static void fail_too_stiff(double steps) {
    throw UnstableMotion(
        fmt::format("too stiff: {:.0f} steps a sample and more are needed, {:.0f} are the limit; a "
                    "stiffness, damping or friction is far too large, or sample_time too long",
                    steps, kMostMeanSteps));
  }

  // The input jumps at each stop: the integrator starts anew there, with the step it had before.
  void integrate(double duration) {
    ERKStepReset(memory_, 0.0, vector_);
    ERKStepSetInitStep(memory_, std::min(step_, duration));  // 0: ARKODE's own choice
    ERKStepSetStopTime(memory_, duration);
    double reached = 0.0;
    const int flag = ERKStepEvolve(memory_, duration, vector_, &reached, ARK_NORMAL);
    if (flag == ARK_TOO_MUCH_WORK) fail_too_stiff(kMaxStepsPerSample);
    if (flag < 0 || !state_.allFinite()) {
      throw UnstableMotion(fmt::format(
          "the motion is unstable or too fast for the integrator (ARKODE flag {})", flag));
    }
    ERKStepGetCurrentStep(memory_, &step_);
  }

  // Failures come back as flags.
  static void keep_quiet(int, const char*, const char*, char*, void*) {}

  static int rate(double /*time*/, N_Vector state, N_Vector rate, void* plant) {
    auto& self = *static_cast<IntegratedPlant*>(plant);
    double* values = N_VGetArrayPointer(rate);
    self.motion_.rate_of(N_VGetArrayPointer(state), values);
    const bool is_finite =
        Eigen::Map<const Eigen::VectorXd>(values, self.state_.size()).allFinite();
    return is_finite ? 0 : 1;  // 1: try a shorter step
  }

  PlantMotion motion_;
  PlantStart start_;
  double sample_time_;
  std::vector<Delay> input_delays_, output_delays_;
  std::vector<History> inputs_, outputs_;
  std::vector<double> stops_;
  Eigen::VectorXd state_;  // the integrator's vector looks at it
  long samples_ = 0;
  long steps_before_ = 0;
  Context context_;
  N_Vector vector_ = nullptr;
  void* memory_ = nullptr;
  double step_ = 0.0;  // s, that the integrator would take next
};

}  // namespace

std::unique_ptr<Plant> integrated_plant(std::unique_ptr<Mechanism> mechanism,
                                        ElementDynamics elements, PlantStart start,
                                        double sample_time, const IntegratorOptions& options) {
  return std::make_unique<IntegratedPlant>(std::move(mechanism), std::move(elements),
                                           std::move(start), sample_time, options);
}

}  // namespace graybox
