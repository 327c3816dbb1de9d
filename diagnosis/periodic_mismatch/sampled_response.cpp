#include "graybox/diagnosis/periodic_mismatch/sampled_response.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <numbers>

#include "graybox/problems/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

constexpr int kHighestPower = 6;
constexpr int kImages = 60;  // either side, of sums that fall as 1/m^3 or faster

constexpr int kFilteredImages = 150;

// Sums of 1/w_m^p over m != 0.
std::array<double, kHighestPower + 1> image_sums(double w, double sample_rate) {
  std::array<double, kHighestPower + 1> sums{};
  for (int m = kImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double inverse = 1.0 / (w + sign * m * sample_rate);
      double power = inverse * inverse;
      for (int p = 3; p <= kHighestPower; ++p) {
        power *= inverse;
        sums[static_cast<std::size_t>(p)] += power;
      }
    }
  }
  const double half_turn = std::numbers::pi / sample_rate;
  const double sine = std::sin(half_turn * w);
  sums[2] = half_turn * half_turn / (sine * sine) - 1.0 / (w * w);
  return sums;
}

Eigen::MatrixXcd static_receptance(const LinearPlant& plant) {
  const Index n = plant.stiffness.rows();
  std::vector<Index> free;
  for (Index i = 0; i < n; ++i) {
    if (plant.held.empty() || !plant.held[static_cast<std::size_t>(i)]) free.push_back(i);
  }
  Eigen::MatrixXcd result = Eigen::MatrixXcd::Zero(n, n);
  const Eigen::MatrixXd stiffness = plant.stiffness(free, free);
  result(free, free) =
      stiffness.completeOrthogonalDecomposition().pseudoInverse().cast<Complex>().eval();
  return result;
}

}  // namespace

Eigen::MatrixXcd receptance(const LinearPlant& plant, double w) {
  if (w == 0.0) return static_receptance(plant);
  Eigen::MatrixXcd dynamic(plant.mass.rows(), plant.mass.cols());
  dynamic.real() = plant.stiffness - w * w * plant.mass;
  dynamic.imag() = w * plant.damping;
  return dynamic.partialPivLu().inverse();
}

Eigen::MatrixXcd image_response(const LinearPlant& plant, double w, double sample_time) {
  constexpr Complex i(0.0, 1.0);
  const auto sums = image_sums(w, 2.0 * std::numbers::pi / sample_time);
  const Eigen::LLT<Eigen::MatrixXd> mass(plant.mass);
  Eigen::MatrixXd term = mass.solve(plant.input);
  Eigen::MatrixXd before = Eigen::MatrixXd::Zero(term.rows(), term.cols());
  const Complex hold = (1.0 - std::polar(1.0, -w * sample_time)) / sample_time;
  Eigen::MatrixXcd result = Eigen::MatrixXcd::Zero(plant.velocity_output.rows(), term.cols());
  for (int n = 1; n <= 3; ++n) {
    // h D^-1 = hold s^(n+2) a_n, and another j w_m = 1/s for velocities.
    const auto power = static_cast<std::size_t>(n) + 2;
    const Complex velocity = hold * sums[power - 1] / std::pow(i, n + 1);
    const Complex position = hold * sums[power] / std::pow(i, n + 2);
    result += velocity * (plant.velocity_output * term) + position * (plant.position_output * term);
    const Eigen::MatrixXd next = mass.solve(-plant.damping * term - plant.stiffness * before);
    before = term;
    term = next;
  }
  return result;
}

Eigen::VectorXcd filtered_image_response(const LinearPlant& plant, Index input, double w,
                                         double sample_time,
                                         const std::function<Complex(double)>& filter) {
  constexpr Complex i(0.0, 1.0);
  const double sample_rate = 2.0 * std::numbers::pi / sample_time;
  std::array<Complex, 4> sums{};  // of H/w_m^p, p = 2 ... 5
  for (int m = kFilteredImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double image = w + sign * m * sample_rate;
      Complex term = filter(image) / image;
      for (Complex& sum : sums) sum += term /= image;
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> mass(plant.mass);
  const Complex hold = (1.0 - std::polar(1.0, -w * sample_time)) / sample_time;
  Eigen::VectorXd term = mass.solve(plant.input.col(input));
  Eigen::VectorXd before = Eigen::VectorXd::Zero(term.size());
  Eigen::VectorXcd result = Eigen::VectorXcd::Zero(plant.velocity_output.rows());
  for (int n = 1; n <= 3; ++n) {
    const auto power = static_cast<std::size_t>(n);
    result += hold * sums[power - 1] / std::pow(i, n + 1) * (plant.velocity_output * term) +
              hold * sums[power] / std::pow(i, n + 2) * (plant.position_output * term);
    const Eigen::VectorXd next = mass.solve(-plant.damping * term - plant.stiffness * before);
    before = term;
    term = next;
  }
  return result;
}

Eigen::MatrixXcd sampled_response(const LinearPlant& plant, double w, double sample_time) {
  const Eigen::MatrixXcd states =
      receptance(plant, w) * (hold_factor(w, sample_time) * plant.input.cast<Complex>());
  return plant.position_output * states + Complex(0.0, w) * (plant.velocity_output * states) +
         image_response(plant, w, sample_time);
}

}  // namespace graybox
