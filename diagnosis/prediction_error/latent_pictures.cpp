#include "diagnosis/prediction_error/latent_pictures.hpp"

#include "diagnosis/prediction_error/ripple_trials.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

bool acts_where(const Element& law, Index coordinate) {
  const bool is_force = law.location.kind == LocationKind::kElement && law.law;
  if (!is_force || law.law->state_count() > 0 || law.location.driver >= 0) return false;
  const VectorXd& b = law.location.output;
  return (b.array() != 0.0).count() == 1 && b(coordinate) == 1.0;
}

ForcePicture picture_of(const Element& law, const LatentForce& force) {
  ForcePicture picture;
  picture.deflection_unit = law.location.units.deflection;
  picture.rate_unit = law.location.units.deflection + "/s";
  picture.force_unit = law.location.units.force;
  picture.force_deviation = force.band;
  const Index own = force.disturbance.coordinate, coordinates = force.motion.cols() / 2;
  for (const Index k : moving_samples(force)) {
    const double z = force.motion(k, own), rate = force.motion(k, coordinates + own);
    const double of_law = law.law->force(z, rate, {});
    picture.deflection.push_back(z);
    picture.rate.push_back(rate);
    picture.law_force.push_back(of_law);
    picture.force.push_back(of_law - force.force(k));  // a law's force is against its direction
  }
  return picture;
}

}  // namespace

std::vector<ForcePicture> latent_pictures(const ExtendedLumpedModel& model,
                                          const LatentForce& force) {
  std::vector<ForcePicture> pictures;
  for (const PlacedFinding& law : model.laws) {
    const Element& part = model.model.parts[law.part];
    ForcePicture picture;
    if (acts_where(part, force.disturbance.coordinate)) picture = picture_of(part, force);
    picture.hypothesis = law.hypothesis;
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

}  // namespace graybox
