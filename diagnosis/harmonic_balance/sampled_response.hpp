// What a plant of linear equations of motion does at the lines of a period, its input held between
// samples:
//
//   D(w) q = h(w) B u + f,   D = K + j w C - w^2 M,   y = (S_0 + j w S_1) q + A(w) u.
//
// Images. A held input has the spectrum h(w_m) u at all w_m = w + m w_s, w_s the sample rate, and
// sampling folds them back: A = sum over m != 0 of h(w_m) (S_0 + j w_m S_1) D(w_m)^-1 B. Above all
// modes, with (j w)^-1 = s,
//
//   D^-1 = s^2 (a_1 + a_2 s + a_3 s^2 + ...),   M a_1 = I,
//   M a_{n+1} = -C a_n - K a_{n-1}, a_0 = 0,
//
// which converges where |w_m| is above the plant's fastest pole. Images that are not well above it
// are taken as they are, of the others six terms are summed. As h(w_m) = (1 - e^(-j w T_s)) / (j
// w_m T_s), only sums of 1/w_m^p, p = 2 ... 9, are needed. For p = 2 the sum is in closed form,
// (pi/w_s)^2 / sin^2(pi w/w_s) - 1/w^2; the others are summed directly. Without A (three parts in a
// thousand of G at 3 % of the sample rate) recordings with little noise would reject the true
// model.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <functional>
#include <span>
#include <vector>

namespace graybox {

// The change of M, C, K and q at rest with one parameter; empty where there is none.
struct PlantDerivative {
  Eigen::MatrixXd mass, damping, stiffness;
  Eigen::VectorXd rest{};
};

struct LinearPlant {
  Eigen::MatrixXd mass, damping, stiffness;          // M, C, K
  Eigen::MatrixXd input;                             // B
  Eigen::MatrixXd position_output, velocity_output;  // S_0, S_1
  Eigen::VectorXd rest;                              // q at rest; the equations count from it
  Eigen::VectorXd holding_input;  // at rest, beyond the recorded one: u of an actuator's law
  // Coordinates whose mean is what it is whatever forces act on them: the control holds them
  // (motors of a robot), or nothing does, and a sensor tells where they stood.
  std::vector<bool> held;
  std::vector<PlantDerivative> derivatives;  // by each parameter of the model
};

// D(w)^-1; at w = 0 that of K without the held coordinates, the pseudo-inverse where K is singular.
[[nodiscard]] Eigen::MatrixXcd receptance(const LinearPlant& plant, double w);

// A(w) of one plant.
class HeldImages {
 public:
  HeldImages(const LinearPlant& plant, double sample_time);

  // A(w), n_y x n_u, and its derivatives by the plant's parameters where they are asked for.
  [[nodiscard]] Eigen::MatrixXcd response(
      double w, std::vector<Eigen::MatrixXcd>* derivatives = nullptr) const;
  // The column of A of one input that passes through H(w) between its hold and the plant (a delay,
  // a lag): the sum of the images with H(w_m) at each.
  [[nodiscard]] Eigen::VectorXcd filtered(
      Eigen::Index input, double w,
      const std::function<std::complex<double>(double)>& filter) const;

 private:
  static constexpr int kTerms = 6;
  // Images either side that are taken as they are.
  [[nodiscard]] int direct_images(double w) const;
  // S_0 a_n B and S_1 a_n B, or their derivatives.
  struct Terms {
    std::vector<Eigen::MatrixXd> position, velocity;
  };
  [[nodiscard]] Eigen::MatrixXcd summed(const Terms& terms, std::span<const double> sums) const;
  // D(w_m)^-1 f
  [[nodiscard]] Eigen::MatrixXcd moved(double image, const Eigen::MatrixXcd& force) const;
  // (S_0 / (j w_m) + S_1) q
  [[nodiscard]] Eigen::MatrixXcd seen(double image, const Eigen::MatrixXcd& coordinates) const;

  LinearPlant plant_;
  double sample_time_;
  double fastest_pole_ = 0.0;  // rad/s
  Terms terms_;
  std::vector<Terms> derivatives_;
};

// (S_0 + j w S_1) D^-1 B h + A: the response from recorded inputs to recorded outputs.
[[nodiscard]] Eigen::MatrixXcd sampled_response(const LinearPlant& plant, double w,
                                                double sample_time);

}  // namespace graybox
