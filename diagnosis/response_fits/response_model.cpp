#include "diagnosis/response_fits/response_model.hpp"

#include <Eigen/LU>
#include <complex>
#include <cstddef>
#include <utility>

#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;

// With D(theta) = D_0 + sum_p k_p (theta_p - theta_0p) b_p b_p^T, G = j w h S D^-1 B and
// dG/dtheta_p = -j w h k_p (S D^-1 b_p) (b_p^T D^-1 B), where S = B^T and D is symmetric.
class RobotLocalResponse : public LocalResponse {
 public:
  RobotLocalResponse(const RobotModel& robot, const LocalModel& model, Eigen::VectorXd theta)
      : robot_(robot),
        model_(model),
        base_theta_(std::move(theta)),
        stiffness_(model.stiffness),
        dynamic_(model.mass.rows(), model.mass.cols()),
        input_(model.input.cast<Complex>()),
        states_(model.input.rows(), model.input.cols()),
        factor_(model.mass.rows()) {}

  void set_parameters(const Eigen::VectorXd& theta) override {
    stiffness_ = model_.stiffness;
    for (std::size_t p = 0; p < model_.parameters.size(); ++p) {
      const Eigen::VectorXd& b = location(p);
      stiffness_ += nominal(p) * (theta(index(p)) - base_theta_(index(p))) * b * b.transpose();
    }
  }

  void evaluate(double w, Eigen::MatrixXcd& response,
                std::vector<ResponseDerivative>* derivatives) override {
    dynamic_.real() = stiffness_ - w * w * model_.mass;
    dynamic_.imag() = w * model_.damping;
    factor_.compute(dynamic_);
    states_ = factor_.solve(input_);
    const Complex velocity = Complex(0.0, w) * hold_factor(w, robot_.sample_time);
    response.noalias() = velocity * (input_.transpose() * states_);
    if (derivatives == nullptr) return;
    derivatives->resize(model_.parameters.size());
    for (std::size_t p = 0; p < model_.parameters.size(); ++p) {
      ResponseDerivative& derivative = (*derivatives)[p];
      derivative.columns.noalias() = states_.transpose() * location(p);
      derivative.rows = derivative.columns.transpose();
      derivative.columns *= -velocity * nominal(p);
    }
  }

  ResponseNoise noise(double w) override {
    Eigen::MatrixXcd response;
    evaluate(w, response, nullptr);
    return closed_loop_noise(robot_, w, response);
  }

 private:
  static Eigen::Index index(std::size_t p) { return static_cast<Eigen::Index>(p); }
  [[nodiscard]] const Eigen::VectorXd& location(std::size_t p) const {
    return model_.elements[model_.parameters[p]].location;
  }
  // The stiffness for theta_p = 1; the local model was built with theta_0.
  [[nodiscard]] double nominal(std::size_t p) const {
    return model_.elements[model_.parameters[p]].value / base_theta_(index(p));
  }

  const RobotModel& robot_;
  LocalModel model_;
  Eigen::VectorXd base_theta_;
  Eigen::MatrixXd stiffness_;
  Eigen::MatrixXcd dynamic_, input_, states_;
  Eigen::PartialPivLU<Eigen::MatrixXcd> factor_;
};

}  // namespace

Eigen::MatrixXcd RobotResponseModel::inverse_controller(double w) const {
  return controller_response(robot_.controller, w, robot_.sample_time).cwiseInverse().asDiagonal();
}

std::unique_ptr<LocalResponse> RobotResponseModel::linearise(const Eigen::VectorXd& position,
                                                             const Eigen::VectorXd& theta) const {
  const RobotModel scaled = with_stiffness_factors(robot_, theta);
  return std::make_unique<RobotLocalResponse>(robot_, LocalModelBuilder(scaled).build(position),
                                              theta);
}

}  // namespace graybox
