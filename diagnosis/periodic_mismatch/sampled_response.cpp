#include "graybox/diagnosis/periodic_mismatch/sampled_response.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "graybox/problems/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

constexpr int kImages = 60;  // either side, of sums that fall as 1/m^3 or faster
constexpr int kFilteredImages = 150;
constexpr int kMostDirectImages = 20;
// Images from so many times the fastest pole on are summed as series.
constexpr double kClear = 8.0;

// The plant's fastest pole, from its state matrix.
double fastest_pole(const LinearPlant& plant) {
  const Index n = plant.mass.rows();
  const Eigen::LLT<Eigen::MatrixXd> mass(plant.mass);
  Eigen::MatrixXd state = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  state.topRightCorner(n, n).setIdentity();
  state.bottomLeftCorner(n, n) = -mass.solve(plant.stiffness);
  state.bottomRightCorner(n, n) = -mass.solve(plant.damping);
  return state.eigenvalues().cwiseAbs().maxCoeff();
}

// Adds 1/w_m^p to sums[p - 2].
template <typename Value>
void add_powers(double image, Value first, std::span<Value> sums) {
  for (Value& sum : sums) {
    first /= image;
    sum += first;
  }
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

HeldImages::HeldImages(const LinearPlant& plant, double sample_time)
    : mass_(plant.mass),
      damping_(plant.damping),
      stiffness_(plant.stiffness),
      input_(plant.input),
      position_output_(plant.position_output),
      velocity_output_(plant.velocity_output),
      sample_time_(sample_time),
      fastest_pole_(fastest_pole(plant)) {
  const Eigen::LLT<Eigen::MatrixXd> mass(mass_);
  Eigen::MatrixXd term = mass.solve(input_);
  Eigen::MatrixXd before = Eigen::MatrixXd::Zero(term.rows(), term.cols());
  for (int n = 1; n <= kTerms; ++n) {
    position_terms_.emplace_back(position_output_ * term);
    velocity_terms_.emplace_back(velocity_output_ * term);
    const Eigen::MatrixXd next = mass.solve(-damping_ * term - stiffness_ * before);
    before = term;
    term = next;
  }
}

int HeldImages::direct_images(double w) const {
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const double needed = (kClear * fastest_pole_ + w) / sample_rate - 1.0;
  return static_cast<int>(std::clamp(std::ceil(needed), 0.0, double{kMostDirectImages}));
}

Eigen::MatrixXcd HeldImages::direct_image(double image, const Eigen::MatrixXd& input) const {
  Eigen::MatrixXcd dynamic(mass_.rows(), mass_.cols());
  dynamic.real() = stiffness_ - image * image * mass_;
  dynamic.imag() = image * damping_;
  const Eigen::MatrixXcd moved = dynamic.partialPivLu().solve(input.cast<Complex>());
  const Complex rate(0.0, image);
  return (position_output_ * moved + rate * (velocity_output_ * moved)) / rate;
}

Eigen::MatrixXcd HeldImages::response(double w) const {
  constexpr Complex i(0.0, 1.0);
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const int direct = direct_images(w);
  std::array<double, kTerms + 2> sums{};  // p = 2 ... 9
  const double half_turn = std::numbers::pi / sample_rate;
  const double sine = std::sin(half_turn * w);
  sums[0] = half_turn * half_turn / (sine * sine) - 1.0 / (w * w);
  Eigen::MatrixXcd result = Eigen::MatrixXcd::Zero(velocity_output_.rows(), input_.cols());
  for (int m = kImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double image = w + sign * m * sample_rate;
      if (m <= direct) {
        sums[0] -= 1.0 / (image * image);
        result += direct_image(image, input_);
      } else {
        add_powers<double>(image, 1.0 / (image * image), std::span(sums).subspan(1));
      }
    }
  }
  for (int n = 1; n <= kTerms; ++n) {
    // h D^-1 = hold s^(n+2) a_n, and another j w_m = 1/s for velocities.
    const auto term = static_cast<std::size_t>(n) - 1;
    result += sums[term] / std::pow(i, n + 1) * velocity_terms_[term] +
              sums[term + 1] / std::pow(i, n + 2) * position_terms_[term];
  }
  return (1.0 - std::polar(1.0, -w * sample_time_)) / sample_time_ * result;
}

Eigen::VectorXcd HeldImages::filtered(Index input, double w,
                                      const std::function<Complex(double)>& filter) const {
  constexpr Complex i(0.0, 1.0);
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const int direct = direct_images(w);
  std::array<Complex, kTerms + 2> sums{};  // of H/w_m^p, p = 2 ... 9
  Eigen::VectorXcd result = Eigen::VectorXcd::Zero(velocity_output_.rows());
  for (int m = kFilteredImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double image = w + sign * m * sample_rate;
      if (m <= direct) {
        result += filter(image) * direct_image(image, input_.col(input)).col(0);
      } else {
        add_powers<Complex>(image, filter(image) / image, sums);
      }
    }
  }
  for (int n = 1; n <= kTerms; ++n) {
    const auto term = static_cast<std::size_t>(n) - 1;
    result += sums[term] / std::pow(i, n + 1) * velocity_terms_[term].col(input) +
              sums[term + 1] / std::pow(i, n + 2) * position_terms_[term].col(input);
  }
  return (1.0 - std::polar(1.0, -w * sample_time_)) / sample_time_ * result;
}

Eigen::MatrixXcd sampled_response(const LinearPlant& plant, double w, double sample_time) {
  const Eigen::MatrixXcd states =
      receptance(plant, w) * (hold_factor(w, sample_time) * plant.input.cast<Complex>());
  return plant.position_output * states + Complex(0.0, w) * (plant.velocity_output * states) +
         HeldImages(plant, sample_time).response(w);
}

}  // namespace graybox
