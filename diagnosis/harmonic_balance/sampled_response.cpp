#include "diagnosis/harmonic_balance/sampled_response.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "problems/mechanisms/frequency_response.hpp"

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
  if (free.empty()) return result;
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
    : plant_(plant), sample_time_(sample_time), fastest_pole_(fastest_pole(plant)) {
  const Eigen::LLT<Eigen::MatrixXd> mass(plant.mass);
  const auto keep = [&](const Eigen::MatrixXd& term, Terms& terms) {
    terms.position.emplace_back(plant.position_output * term);
    terms.velocity.emplace_back(plant.velocity_output * term);
  };
  const auto times = [](const Eigen::MatrixXd& change, const Eigen::MatrixXd& term) {
    return change.size() > 0 ? Eigen::MatrixXd(change * term)
                             : Eigen::MatrixXd::Zero(term.rows(), term.cols());
  };
  std::vector<Eigen::MatrixXd> series{Eigen::MatrixXd::Zero(plant.input.rows(), plant.input.cols()),
                                      mass.solve(plant.input)};
  for (int n = 1; n <= kTerms; ++n) {
    keep(series.back(), terms_);
    series.emplace_back(
        mass.solve(-plant.damping * series.back() - plant.stiffness * series[series.size() - 2]));
  }
  for (const PlantDerivative& change : plant.derivatives) {
    Terms& terms = derivatives_.emplace_back();
    Eigen::MatrixXd before = series.front();
    Eigen::MatrixXd term = mass.solve(-times(change.mass, series[1]));
    for (std::size_t n = 1; n <= kTerms; ++n) {
      keep(term, terms);
      const Eigen::MatrixXd next = mass.solve(
          -times(change.mass, series[n + 1]) - times(change.damping, series[n]) -
          times(change.stiffness, series[n - 1]) - plant.damping * term - plant.stiffness * before);
      before = term;
      term = next;
    }
  }
}

int HeldImages::direct_images(double w) const {
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const double needed = (kClear * fastest_pole_ + w) / sample_rate - 1.0;
  return static_cast<int>(std::clamp(std::ceil(needed), 0.0, double{kMostDirectImages}));
}

Eigen::MatrixXcd HeldImages::moved(double image, const Eigen::MatrixXcd& force) const {
  Eigen::MatrixXcd dynamic(plant_.mass.rows(), plant_.mass.cols());
  dynamic.real() = plant_.stiffness - image * image * plant_.mass;
  dynamic.imag() = image * plant_.damping;
  return dynamic.partialPivLu().solve(force);
}

Eigen::MatrixXcd HeldImages::seen(double image, const Eigen::MatrixXcd& coordinates) const {
  return plant_.position_output * coordinates / Complex(0.0, image) +
         plant_.velocity_output * coordinates;
}

Eigen::MatrixXcd HeldImages::summed(const Terms& terms, std::span<const double> sums) const {
  constexpr Complex i(0.0, 1.0);
  Eigen::MatrixXcd result =
      Eigen::MatrixXcd::Zero(plant_.velocity_output.rows(), plant_.input.cols());
  for (std::size_t n = 0; n < kTerms; ++n) {
    // h D^-1 = hold s^(n+2) a_n, and another j w_m = 1/s for velocities.
    const auto power = static_cast<int>(n) + 2;
    result += sums[n] / std::pow(i, power) * terms.velocity[n] +
              sums[n + 1] / std::pow(i, power + 1) * terms.position[n];
  }
  return result;
}

Eigen::MatrixXcd HeldImages::response(double w, std::vector<Eigen::MatrixXcd>* derivatives) const {
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const int direct = direct_images(w);
  std::array<double, kTerms + 2> sums{};  // p = 2 ... 9
  const double half_turn = std::numbers::pi / sample_rate;
  const double sine = std::sin(half_turn * w);
  sums[0] = half_turn * half_turn / (sine * sine) - 1.0 / (w * w);
  for (int m = kImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double image = w + sign * m * sample_rate;
      if (m > direct) {
        add_powers<double>(image, 1.0 / (image * image), std::span(sums).subspan(1));
      } else {
        sums[0] -= 1.0 / (image * image);
      }
    }
  }
  Eigen::MatrixXcd result = summed(terms_, sums);
  if (derivatives != nullptr) {
    derivatives->clear();
    for (const Terms& terms : derivatives_) derivatives->push_back(summed(terms, sums));
  }
  for (int m = -direct; m <= direct; ++m) {
    if (m == 0) continue;
    const double image = w + m * sample_rate;
    const Eigen::MatrixXcd motion = moved(image, plant_.input.cast<Complex>());
    result += seen(image, motion);
    for (std::size_t p = 0; derivatives != nullptr && p < derivatives->size(); ++p) {
      const PlantDerivative& change = plant_.derivatives[p];
      Eigen::MatrixXcd force = Eigen::MatrixXcd::Zero(motion.rows(), motion.cols());
      if (change.mass.size() > 0) force += image * image * (change.mass * motion);
      if (change.damping.size() > 0) force -= Complex(0.0, image) * (change.damping * motion);
      if (change.stiffness.size() > 0) force -= change.stiffness * motion;
      (*derivatives)[p] += seen(image, moved(image, force));
    }
  }
  const Complex hold = (1.0 - std::polar(1.0, -w * sample_time_)) / sample_time_;
  if (derivatives != nullptr) {
    for (Eigen::MatrixXcd& derivative : *derivatives) derivative *= hold;
  }
  return hold * result;
}

Eigen::VectorXcd HeldImages::filtered(Index input, double w,
                                      const std::function<Complex(double)>& filter) const {
  constexpr Complex i(0.0, 1.0);
  const double sample_rate = 2.0 * std::numbers::pi / sample_time_;
  const int direct = direct_images(w);
  std::array<Complex, kTerms + 2> sums{};  // of H/w_m^p, p = 2 ... 9
  Eigen::VectorXcd result = Eigen::VectorXcd::Zero(plant_.velocity_output.rows());
  for (int m = kFilteredImages; m >= 1; --m) {
    for (const int sign : {-1, 1}) {
      const double image = w + sign * m * sample_rate;
      if (m <= direct) {
        const Eigen::VectorXcd force = plant_.input.col(input).cast<Complex>();
        result += filter(image) * seen(image, moved(image, force)).col(0);
      } else {
        add_powers<Complex>(image, filter(image) / image, sums);
      }
    }
  }
  for (int n = 1; n <= kTerms; ++n) {
    const auto term = static_cast<std::size_t>(n) - 1;
    result += sums[term] / std::pow(i, n + 1) * terms_.velocity[term].col(input) +
              sums[term + 1] / std::pow(i, n + 2) * terms_.position[term].col(input);
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
