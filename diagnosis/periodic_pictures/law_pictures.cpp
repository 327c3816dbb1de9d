#include "diagnosis/periodic_pictures/law_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "diagnosis/harmonic_balance/place_observer.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr Index kPoints = 1500;
constexpr double kNoiseShare = 1.0 / 3.0;  // of the law's rms
constexpr double kSeenShare = 0.8;         // of the law's power

// What the residual asks for beside the law, at the lines that say it.
struct RemainingForce {
  VectorXcd lines;
  double variance = 0.0;  // of its noise, over time
  double seen = 0.0;      // share of the law's power at these lines
};

// In time a line X of a period of N samples has the mean square 2 |X|^2 / N.
double mean_square(double power, const PeriodicData& data) {
  return 2.0 * power / static_cast<double>(data.period);
}

RemainingForce remaining_force(const PeriodicData& data, const MatrixXcd& residual,
                               const MatrixXcd& answer, const VectorXcd& law, double law_rms) {
  RemainingForce result{VectorXcd::Zero(data.last_line + 1), 0.0, 0.0};
  std::vector<std::pair<double, Index>> by_noise;
  double power = 0.0, seen = 0.0;
  for (Index k = data.first_line; k <= data.last_line; ++k) {
    const double gain = answer.col(k).squaredNorm();
    if (gain > 0.0) by_noise.emplace_back(2.0 / gain, k);
    power += std::norm(law(k));
  }
  std::ranges::sort(by_noise);
  const double limit = kNoiseShare * kNoiseShare * law_rms * law_rms;
  for (const auto& [noise, k] : by_noise) {
    const double variance = mean_square(noise, data);
    if (result.variance + variance > limit) break;
    result.variance += variance;
    result.lines(k) = -answer.col(k).dot(residual.col(k)) / answer.col(k).squaredNorm();
    seen += std::norm(law(k));
  }
  if (power > 0.0) result.seen = seen / power;
  return result;
}

double rms(const VectorXd& values) {
  return values.norm() / std::sqrt(static_cast<double>(values.size()));
}

// One law in one recording.
ForcePicture picture_of(SteadyStateSolver& solver, const PeriodicData& data,
                        const MatrixXcd& answer, const SteadyPlaceMotion& seen,
                        const Location& place, const PeriodicLaw& periodic) {
  PeriodicMotion motion, left;
  VectorXd law_force;
  solver.motion_of(seen.deflection, motion);
  periodic.force(motion, law_force);
  VectorXcd law_lines;
  solver.force_lines(periodic, seen.deflection, motion, law_lines);
  const RemainingForce rest =
      remaining_force(data, solver.state().residual, answer, law_lines, rms(law_force));
  solver.motion_of(rest.lines, left);
  const bool is_seen = rest.seen >= kSeenShare;
  ForcePicture picture{
      0, place.units.deflection, place.units.deflection + "/s", place.units.force, {}, {}, {}, {}};
  if (is_seen) picture.force_deviation = std::sqrt(rest.variance);
  const Index step = std::max<Index>(1, law_force.size() / kPoints);
  for (Index t = 0; t < law_force.size(); t += step) {
    picture.deflection.push_back(motion.deflection(t));
    picture.rate.push_back(motion.rate(t));
    picture.law_force.push_back(law_force(t));
    if (is_seen) picture.force.push_back(law_force(t) + left.deflection(t));
  }
  return picture;
}

double largest_force(const ForcePicture& picture) {
  double square = 0.0;
  for (const double force : picture.law_force) square += force * force;
  return std::sqrt(square);
}

}  // namespace

std::vector<ForcePicture> law_pictures(const PlantFamily& family, const PeriodicData& data,
                                       const ModelState& model, std::size_t first) {
  std::vector<ForcePicture> pictures(model.laws.size() - first);
  SteadyStateSolver solver(family, data, {});
  MatrixXcd answer;
  for (const MeasuredRecord& record : data.estimation) {
    solver.solve(model, record, nullptr);
    for (std::size_t l = 0; l < pictures.size(); ++l) {
      const ActingLaw& law = model.laws[first + l];
      const Location& place = law.place->location;
      const PeriodicLaw periodic(*law.entry, law.parameters);
      if (place.kind != LocationKind::kElement || is_body(*law.place, *law.entry) ||
          periodic.is_linear()) {
        continue;
      }
      answer_at(solver, model, record, place, answer);
      const SteadyPlaceMotion seen =
          PlaceObserver(solver, model, data, false).observe(record, place, answer);
      ForcePicture picture = picture_of(solver, data, answer, seen, place, periodic);
      if (largest_force(picture) > largest_force(pictures[l])) pictures[l] = std::move(picture);
    }
  }
  return pictures;
}

}  // namespace graybox
