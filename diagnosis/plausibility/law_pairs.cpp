#include "diagnosis/plausibility/law_pairs.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

namespace graybox {
namespace {

constexpr double kOpposite = -0.95;  // correlation of two forces
constexpr double kCancelled = 0.2;   // of each force, left by both
// Shares of half the motion, and of the slope in the middle.
constexpr double kMiddle = 1.0 / 3.0, kEnds = 2.0 / 3.0, kSteep = 0.5;

// A weight turns round, too, and may: it is no spring.
bool is_spring(const LawTrace& law) {
  constexpr std::array kSprings{"stiffness", "cubic_spring", "dead_zone", "backlash"};
  return std::ranges::any_of(kSprings,
                             [&](const char* spring) { return law.name.starts_with(spring); });
}

// The slope of a line through points, by least squares; 0 for fewer than three.
struct SlopeOf {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;

  void add(double at, double value) {
    n += 1.0;
    x += at;
    y += value;
    xx += at * at;
    xy += at * value;
  }
  [[nodiscard]] double value() const {
    const double square = n * xx - x * x;
    return n > 2.0 && square > 0.0 ? (n * xy - x * y) / square : 0.0;
  }
};

}  // namespace

bool sets_rest(const LawTrace& force, std::span<const LawTrace> laws) {
  return force.name.starts_with("offset") && std::ranges::any_of(laws, [&](const LawTrace& law) {
           return law.place == force.place && law.name.starts_with("stiffness");
         });
}

bool cancel(const LawTrace& first, const LawTrace& second) {
  if (sets_rest(first, {&second, 1}) || sets_rest(second, {&first, 1})) return false;
  const bool is_one_place = first.place == second.place;
  const std::vector<double>& a = is_one_place ? first.force : first.acting;
  const std::vector<double>& b = is_one_place ? second.force : second.acting;
  if (a.empty() || a.size() != b.size()) return false;
  const auto size = static_cast<Eigen::Index>(a.size());
  const Eigen::Map<const Eigen::VectorXd> of_first(a.data(), size), of_second(b.data(), size);
  const double norm_1 = of_first.norm(), norm_2 = of_second.norm();
  if (!(norm_1 > 0.0) || !(norm_2 > 0.0)) return false;
  return of_first.dot(of_second) < kOpposite * norm_1 * norm_2 &&
         (of_first + of_second).norm() < kCancelled * std::min(norm_1, norm_2);
}

bool turns_round(const LawTrace& first, const LawTrace& second) {
  const std::size_t samples = first.deflection.size();
  const bool is_known =
      samples > 0 && first.conservative.size() == samples && second.conservative.size() == samples;
  if (first.place != second.place || !is_known) return false;
  if (!is_spring(first) || !is_spring(second)) return false;
  const auto [low, high] = std::ranges::minmax(first.deflection);
  SlopeOf middle, below, above;
  for (std::size_t t = 0; t < samples; ++t) {
    const double share = (2.0 * first.deflection[t] - low - high) / (high - low);
    const double force = first.conservative[t] + second.conservative[t];
    if (std::abs(share) < kMiddle) middle.add(share, force);
    if (share > kEnds) above.add(share, force);
    if (share < -kEnds) below.add(share, force);
  }
  const double pulls = middle.value(), pushes = std::min(below.value(), above.value());
  return pulls > 0.0 && pushes < -kSteep * pulls;
}

}  // namespace graybox
