// ResponseModel: what a fit needs of a model: the frequency response and its derivatives by the
// parameters, near one position at a time. LocalResponse is that model linearised at one position;
// each has its own workspace, so different positions may be evaluated by different threads.
//
//   const RobotResponseModel model(robot);
//   const auto local = model.linearise(position, theta);   // operating point of this theta
//   local->set_parameters(theta);
//   local->evaluate(w, response, &derivatives);           // dG/dtheta_p = columns * rows
//
// Operating point. linearise() finds the static equilibrium for the theta it is given; evaluate()
// keeps it while theta varies, so that derivatives are exact and rank one (local_model.hpp). A fit
// linearises again from time to time (maximum_likelihood.hpp).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/response_fits/response_measurement.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// dG/dtheta_p as a product of n_y x r and r x n_u: one spring, damper or mass gives rank r = 1. A
// model without such structure sets columns = dG/dtheta_p and rows = I.
struct ResponseDerivative {
  Eigen::MatrixXcd columns;
  Eigen::MatrixXcd rows;
};

class LocalResponse {
 public:
  virtual ~LocalResponse() = default;

  virtual void set_parameters(const Eigen::VectorXd& theta) = 0;

  // G(w; theta), and dG/dtheta_p for every p unless `derivatives` is null.
  virtual void evaluate(double w, Eigen::MatrixXcd& response,
                        std::vector<ResponseDerivative>* derivatives) = 0;

  // The noise that one experiment has at w if the present theta is true. Asked for where a
  // measurement does not bring its own.
  [[nodiscard]] virtual ResponseNoise noise(double w) = 0;
};

class ResponseModel {
 public:
  virtual ~ResponseModel() = default;

  [[nodiscard]] virtual std::vector<std::string> parameter_names() const = 0;
  [[nodiscard]] virtual Eigen::Index output_count() const = 0;  // n_y
  [[nodiscard]] virtual Eigen::Index input_count() const = 0;   // n_u

  // F^-1 at w, n_u x n_y, where the experiments are made under feedback u = F (r - y); an empty
  // matrix where they are not, or F is unknown.
  [[nodiscard]] virtual Eigen::MatrixXcd inverse_controller(double w) const = 0;

  // Throws InputError for a position or theta that the model can't take (no equilibrium).
  [[nodiscard]] virtual std::unique_ptr<LocalResponse> linearise(
      const Eigen::VectorXd& position, const Eigen::VectorXd& theta) const = 0;
};

// The flexible robot with its parametrised springs scaled by theta. The noise is that of (12).
class RobotResponseModel : public ResponseModel {
 public:
  // Keeps a reference to the robot.
  explicit RobotResponseModel(const RobotModel& robot) : robot_(robot) {}

  [[nodiscard]] std::vector<std::string> parameter_names() const override {
    return robot_.parameter_names();
  }
  [[nodiscard]] Eigen::Index output_count() const override { return robot_.motor_count(); }
  [[nodiscard]] Eigen::Index input_count() const override { return robot_.motor_count(); }
  [[nodiscard]] Eigen::MatrixXcd inverse_controller(double w) const override;
  [[nodiscard]] std::unique_ptr<LocalResponse> linearise(
      const Eigen::VectorXd& position, const Eigen::VectorXd& theta) const override;

 private:
  const RobotModel& robot_;
};

}  // namespace graybox
