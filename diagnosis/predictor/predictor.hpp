// Predictor: what a lumped model says of the next measurements, sample by sample.
//
//   e_k = y_k - y(x_k),     x_k <- x_k + K e_k,
//
// x = (q, q', states of laws, lags of sensors, earlier outputs of late sensors). A filter corrects
// at every sample. Forecasts branch off from it, one after the other, each h samples long. Nothing
// is corrected in a forecast, and its e_k are what counts. h = 1 is the innovations form (Ljung,
// System Identification, 2nd ed. 1999, ch. 4). h = 0, the free run, has no filter (output error).
//
// Between samples one step of Runge and Kutta (4th order) or several. Dry friction is a set, not a
// curve: at rest it holds with any force up to its level. What moves along b slides on with F(v)
// against its direction. What rests and is pulled by less than F(0+) holds, exactly. Within a step
// it comes to rest where its velocity, straight in time, passes zero. It breaks away where the
// pull, straight in time, passes the level. So predictions depend on parameters without jumps, and
// no transition velocity makes the equations stiff. A transition that is wide enough to be seen, h
// F b' M^-1 b / v_t < 4, is the law's curve as it is. The step is then divided, so that none passes
// more than half of the transition. So is friction of imposed motion, where v is not the model's to
// change. Where a rectifying sensor reads a negative signal, more of the
// reading is less of the signal, and e_k is taken with the other sign. A lag or a resonance of a
// sensor is exact for outputs that are straight within a step, where what is held jumps between
// two. A late sensor reads what the state was then, and is corrected there, since earlier outputs
// are part of the state.
//
// A disturbance is one state more: a force that holds within a sample and dies away from one to the
// next, which the filter follows as far as the gain lets it.
//
//   Predictor predictor(model, sample_time, steps);
//   predictor.run(drive, outputs, {first, h}, gain, initial, errors);   // false: out of all bounds
//
// One object serves one thread; run() allocates nothing but the results. Cost: 4 (1 + laws) law
// evaluations a step, once in free run and for h = 1, else twice: for filter and forecasts.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "diagnosis/output_error/node_inputs.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

// Forecasts of `horizon` samples, from sample `first` on one after the other. 0: the free run.
// `skipped`, where not null, is of each forecast: those that nobody asks for.
struct Forecasts {
  Eigen::Index first = 0, horizon = 0;
  const std::vector<std::uint8_t>* skipped = nullptr;
  [[nodiscard]] bool skips(Eigen::Index forecast) const {
    return skipped != nullptr && (*skipped)[static_cast<std::size_t>(forecast)] != 0;
  }
};

// A force that no input shows: one with memory, d_(k+1) = exp(-T/memory) d_k + white noise, and one
// without, that is another in every sample.
struct DisturbanceForce {
  Eigen::Index coordinate = -1;          // -1: none
  double deviation = 0.0, memory = 0.0;  // N or N m, s
  double white = 0.0;                    // deviation of the one without memory
  [[nodiscard]] bool is_there() const { return coordinate >= 0; }
};

class Predictor {
 public:
  // A disturbance acts on a coordinate that moves freely.
  Predictor(const LumpedModel& model, double sample_time, int steps_per_sample,
            const DisturbanceForce& disturbance = {});

  [[nodiscard]] Eigen::Index state_count() const { return states_; }
  [[nodiscard]] const DisturbanceForce& disturbance() const { return disturbance_; }
  [[nodiscard]] Eigen::Index disturbance_state() const { return disturbance_state_; }
  [[nodiscard]] Eigen::Index free_count() const { return n_; }  // coordinates that are not imposed
  [[nodiscard]] Eigen::Index output_count() const {
    return static_cast<Eigen::Index>(outputs_.size());
  }

  // The measured `outputs` and the `errors` are samples x outputs; errors before the first forecast
  // are the filter's, those of forecasts that were skipped are zero. The `gain` is states x
  // outputs, or empty: no sample corrects. The `initial` values are q and q' of the free
  // coordinates. The `states`, if not null, are samples x (q, q' of all coordinates): of the
  // filter, after each correction.
  bool run(const NodeInputs& drive, const Eigen::MatrixXd& outputs, const Forecasts& forecasts,
           const Eigen::MatrixXd& gain, const Eigen::VectorXd& initial, Eigen::MatrixXd& errors,
           Eigen::MatrixXd* states = nullptr);

  // For the gain: one sample onward from `state` without inputs, linear elements and sensors alone,
  // with a constant force on a coordinate or none (-1); and what is measured in that state.
  void linear_step(Eigen::VectorXd& state, Eigen::Index pushed = -1, double force = 1.0);
  void linear_outputs(const Eigen::VectorXd& state, Eigen::VectorXd& outputs);

 private:
  using Coefficients = std::vector<std::pair<Eigen::Index, double>>;  // coordinate, coefficient
  struct Placed {
    std::shared_ptr<const Law> law;
    Coefficients in, out;
    Eigen::Index driver = -1;  // the input in place of the deflection
    Eigen::Index first_state = 0;
    std::size_t states = 0;
    bool is_set_valued = false;
    bool is_linear = false;  // counts for the gain
    // How set-valued friction acts within a step.
    enum class Mode : std::int8_t { kUndecided, kSlides, kHolds };
    Mode mode = Mode::kUndecided;
    double rate = 0.0, direction = 1.0, pull = 0.0;  // at its start
    double mobility = 0.0;                           // b' M^-1 b
    Eigen::VectorXd velocity_by;                     // M^-1 b, of the free coordinates
  };
  struct Sensor {
    enum class Kind : std::int8_t { kLaw, kLag, kRateLimit, kResonance };
    Kind kind = Kind::kLaw;
    std::shared_ptr<const Law> law;
    Eigen::Index driver = -1;
    double time_constant = 0.0;     // of a lag, or of a rate limit
    double limit = 0.0;             // of a rate limit
    std::vector<double> resonance;  // its parameters
    // Of its states, from one sample to the next: what is kept, what the signal and its change add.
    Eigen::Matrix2d kept;
    Eigen::Vector2d by_signal, by_change;
    Eigen::Index state = 0;
    double turned_below_zero = 1.0;  // slope of a rectifier there
  };
  struct Late {
    double samples = 0.0;
    Eigen::Index first = 0, length = 0;  // of the earlier outputs among the states
  };

  void split_coordinates(const LumpedModel& model);
  void place_laws(const LumpedModel& model);
  void place_sensors(const LumpedModel& model);
  void place_resonance(const Element& part, Sensor& sensor);
  [[nodiscard]] double after(const Sensor& sensor, double signal) const;  // of one with states
  void follow(const Sensor& sensor, double before, double now);
  [[nodiscard]] Placed placed(const Element& part) const;
  void allocate();
  void start(const Eigen::VectorXd& initial, const double* inputs);
  void spread(const double* x, const double* inputs);
  void rates(const double* x, const double* inputs, double* dx);
  void hold_still(double* dx);
  void add_forces(const double* x, const double* inputs, double* dx);
  // Velocity at the place of a set-valued friction, and its level as an acceleration there, now.
  [[nodiscard]] double rate_of(const Placed& law) const;
  [[nodiscard]] double level_of(const Placed& law, double direction, const double* inputs) const;
  void push(const Placed& law, double change);  // of its velocity
  void choose_friction(const double* inputs);
  void settle_friction(double step, const double* inputs);
  void break_away(double step, const double* inputs);
  void step(const NodeInputs& drive, Eigen::Index step);
  void interpolate(const NodeInputs& drive, Eigen::Index step, double share, Eigen::Index column);
  void advance(double h, const double* at_start, const double* at_middle, const double* at_end);
  void between_samples(const NodeInputs& drive, Eigen::Index sample);
  // From sample `from` to `to`, which is not read: the filter, or a forecast. False: out of bounds.
  struct Recorded {
    const NodeInputs* drive;
    const Eigen::MatrixXd* outputs;
    const Eigen::MatrixXd* gain;  // null: a forecast
    Eigen::MatrixXd* errors;      // null: not kept
    Eigen::MatrixXd* states;      // null: not kept
  };
  bool advance(const Recorded& recorded, Eigen::Index from, Eigen::Index to);
  void remember();
  void return_to_remembered();
  [[nodiscard]] double output_of(std::size_t output, const double* inputs) const;
  // Through the laws of the sensors up to their delays; what lags follow goes to `followed`.
  void sense(const double* inputs, std::vector<double>& followed);
  void delay();
  void correct(const Eigen::MatrixXd& gain);
  void shift_registers();
  void follow_lags();
  void store_states(Eigen::Index sample, const double* inputs, Eigen::MatrixXd& states);

  double sample_time_, step_;
  int steps_;
  struct Substeps {
    int count = 1;           // of a step
    Eigen::MatrixXd inputs;  // inputs x (start, middle, end of a substep)
  } substeps_;
  bool linear_ = false;  // for the gain
  Eigen::Index disturbance_state_ = -1;
  double disturbance_kept_ = 0.0;  // from one sample to the next
  Eigen::Index pushed_ = -1;
  double push_ = 0.0;
  bool has_set_valued_ = false;
  Eigen::Index n_ = 0, m_ = 0, states_ = 0;
  std::vector<Eigen::Index> free_, slot_, position_, velocity_, acceleration_;
  std::vector<bool> imposed_;
  Eigen::MatrixXd mass_, damping_, stiffness_, inverse_mass_;
  std::vector<LumpedInput> inputs_;
  std::vector<LumpedOutput> outputs_;
  DisturbanceForce disturbance_;
  bool needs_forces_ = false;  // an output is an acceleration or a force
  std::vector<Placed> laws_;
  std::vector<Placed> measured_;              // of outputs that are an element's force
  std::vector<std::vector<Sensor>> sensors_;  // by output
  std::vector<Late> late_;

  struct Slopes {
    Eigen::VectorXd k1, k2, k3, k4, trial;  // of the method of Runge and Kutta
  } slopes_;
  Eigen::VectorXd x_;
  Eigen::VectorXd q_, v_, a_, force_;  // of all coordinates
  Eigen::VectorXd y_, kept_y_, error_;
  Eigen::VectorXd remembered_x_, remembered_y_;  // where a forecast branches off
  std::vector<double> remembered_followed_;
  Eigen::VectorXd turned_;  // -1 where a sensor reads less when its signal grows, else 1
  std::vector<double> followed_before_, followed_;
  std::vector<double> no_inputs_;
};

}  // namespace graybox
