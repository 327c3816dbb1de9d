#include "graybox/diagnosis/periodic_mismatch/law_pictures.hpp"

#include <algorithm>

#include "graybox/diagnosis/periodic_mismatch/period_transform.hpp"
#include "graybox/diagnosis/periodic_mismatch/periodic_law.hpp"
#include "graybox/diagnosis/periodic_mismatch/place_observer.hpp"
#include "graybox/diagnosis/periodic_mismatch/steady_state.hpp"

namespace graybox {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXd;

std::vector<ForcePicture> law_pictures(const PlantFamily& family, const PeriodicData& data,
                                       const ModelState& model, std::size_t first) {
  constexpr Index kPoints = 1500;
  std::vector<ForcePicture> pictures(model.laws.size() - first);
  std::vector<double> largest(pictures.size(), -1.0);
  SteadyStateSolver solver(family, data, {});
  MatrixXcd answer;
  PeriodicMotion motion, left;
  VectorXd law_force;
  for (const MeasuredRecord& record : data.estimation) {
    solver.solve(model, record, nullptr);
    for (std::size_t l = 0; l < pictures.size(); ++l) {
      const ActingLaw& law = model.laws[first + l];
      const Location& place = law.place->location;
      ForcePicture& picture = pictures[l];
      const PeriodicLaw periodic(*law.entry, law.parameters);
      if (place.kind != LocationKind::kElement || is_body(*law.place, *law.entry) ||
          periodic.is_linear()) {
        continue;
      }
      answer_at(solver, model, record, place, answer);
      const SteadyPlaceMotion seen =
          PlaceObserver(solver, model, data, true).observe(record, place, answer);
      solver.motion_of(seen.deflection, motion);
      solver.motion_of(seen.force, left);
      periodic.force(motion, law_force);
      if (law_force.norm() <= largest[l]) continue;
      largest[l] = law_force.norm();
      picture.deflection_unit = place.units.deflection;
      picture.rate_unit = place.units.deflection + "/s";
      picture.force_unit = place.units.force;
      const Index step = std::max<Index>(1, law_force.size() / kPoints);
      for (auto* values :
           {&picture.deflection, &picture.rate, &picture.force, &picture.law_force}) {
        values->clear();
      }
      for (Index t = 0; t < law_force.size(); t += step) {
        picture.deflection.push_back(motion.deflection(t));
        picture.rate.push_back(motion.rate(t));
        picture.force.push_back(law_force(t) + left.deflection(t));
        picture.law_force.push_back(law_force(t));
      }
    }
  }
  return pictures;
}

}  // namespace graybox
