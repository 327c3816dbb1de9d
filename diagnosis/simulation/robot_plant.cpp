#include <arkode/arkode_erkstep.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>

#include <stdexcept>

#include "graybox/diagnosis/simulation/plant.hpp"
#include "graybox/problems/robot_dynamics.hpp"

namespace graybox {
namespace {

// More than a held input of one sample ever needs; beyond, the model has become unstable.
constexpr long kMaxStepsPerSample = 2000;

struct Context {
  Context() {
    if (SUNContext_Create(nullptr, &handle) != 0) throw std::runtime_error("SUNDIALS: no context");
  }
  ~Context() { SUNContext_Free(&handle); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  SUNContext handle = nullptr;
};

class RobotPlant : public Plant {
 public:
  RobotPlant(const RobotModel& robot, const Eigen::VectorXd& joint_angles,
             const IntegratorOptions& options)
      : dynamics_(robot),
        sample_time_(robot.sample_time),
        inputs_(robot.motor_count()),
        rest_(dynamics_.rest(joint_angles)),
        holding_torque_(dynamics_.holding_torque(rest_)),
        state_(rest_),
        rate_(rest_.size()),
        torque_(holding_torque_),
        no_force_(Eigen::VectorXd::Zero(dynamics_.degrees_of_freedom())) {
    vector_ = N_VMake_Serial(state_.size(), state_.data(), context_.handle);
    memory_ = vector_ == nullptr ? nullptr : ERKStepCreate(rate, 0.0, vector_, context_.handle);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS: no memory for the integrator");
    ERKStepSetUserData(memory_, this);
    ERKStepSetTableNum(memory_, ARKODE_DORMAND_PRINCE_7_4_5);
    ERKStepSStolerances(memory_, options.relative_tolerance, options.absolute_tolerance);
    ERKStepSetMaxNumSteps(memory_, kMaxStepsPerSample);
  }
  ~RobotPlant() override {
    ERKStepFree(&memory_);
    N_VDestroy(vector_);
  }
  RobotPlant(const RobotPlant&) = delete;
  RobotPlant& operator=(const RobotPlant&) = delete;

  [[nodiscard]] Eigen::Index input_count() const override { return inputs_; }
  [[nodiscard]] Eigen::Index output_count() const override { return inputs_; }
  void restart() override { state_ = rest_; }
  [[nodiscard]] Eigen::VectorXd output() const override { return dynamics_.motor_velocity(state_); }

  // The input jumps at each sample: the integrator starts anew there, and stops at the next one.
  void advance(const Eigen::VectorXd& input) override {
    torque_ = holding_torque_ + input;
    ERKStepReset(memory_, 0.0, vector_);
    ERKStepSetStopTime(memory_, sample_time_);
    double reached = 0.0;
    const int flag = ERKStepEvolve(memory_, sample_time_, vector_, &reached, ARK_NORMAL);
    if (flag < 0 || !state_.allFinite()) {
      throw std::runtime_error(
          fmt::format("the integrator gave up within a sample (ARKODE flag {}): the robot's motion "
                      "is unstable or too fast",
                      flag));
    }
  }

 private:
  static int rate(double /*time*/, N_Vector state, N_Vector rate, void* plant) {
    auto& self = *static_cast<RobotPlant*>(plant);
    const Eigen::Index size = self.state_.size();
    self.argument_ = Eigen::Map<const Eigen::VectorXd>(N_VGetArrayPointer(state), size);
    self.dynamics_.rate(self.argument_, self.torque_, self.no_force_, self.rate_);
    Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(rate), size) = self.rate_;
    return self.rate_.allFinite() ? 0 : 1;  // 1: try a shorter step
  }

  RobotDynamics dynamics_;
  double sample_time_;
  Eigen::Index inputs_;
  Eigen::VectorXd rest_, holding_torque_;
  Eigen::VectorXd state_;  // the integrator's vector looks at it
  Eigen::VectorXd argument_, rate_, torque_, no_force_;
  Context context_;
  N_Vector vector_ = nullptr;
  void* memory_ = nullptr;
};

}  // namespace

std::unique_ptr<Plant> robot_plant(const RobotModel& robot, const Eigen::VectorXd& joint_angles,
                                   const IntegratorOptions& options) {
  return std::make_unique<RobotPlant>(robot, joint_angles, options);
}

}  // namespace graybox
