#include "diagnosis/prediction_error/unmodelled_force.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

double largest_ratio(const std::vector<HorizonError>& horizons, VectorXd HorizonError::*expected) {
  double largest = 0.0;
  for (const HorizonError& each : horizons) {
    largest = std::max(largest, (each.error.array() / (each.*expected).array()).maxCoeff());
  }
  return largest;
}

}  // namespace

UnmodelledForce::UnmodelledForce(const PredictionData& data, const PredictionFindings& findings,
                                 const ExtendedLumpedModel& model, int threads)
    : output_scale_(data.output_scale()) {
  force_ = likeliest_force(data, model, findings.intensity, threads);
  if (force_) {
    share_ = force_->rms() / data.force_scale();
    structures_ = latent_structures(data, ExperimentRole::kEstimation, model.model, *force_);
  }
  std::vector<Index> horizons;
  for (const Rung& rung : findings.rungs) {
    horizons.push_back(findings.samples_of(data, rung.horizon));
  }
  const DisturbanceForce disturbance = force_ ? force_->disturbance : DisturbanceForce{};
  const auto error_at = [&](Index horizon) -> std::optional<HorizonError> {
    const PredictionTask task = data.windows(horizon);
    const PredictionFitter fitter(data, task, findings.intensity, threads);
    const VectorXd& weights = data.output_scale();
    const PredictionFit fit = fitter.fit(model, weights, {}, horizon == 0 ? 5 : 0, horizon == 0);
    if (!fit.usable) return {};
    return HorizonError{horizon, fitter.errors(fit, weights), fitter.errors_by_noise(fit, weights),
                        fitter.errors_by_noise(fit, weights, disturbance)};
  };
  for (const Index horizon : horizons) {
    if (auto error = error_at(horizon)) horizons_.push_back(*std::move(error));
  }
  if (auto error = error_at(data.shortest())) whole_ = *std::move(error);
}

const LatentStructure* UnmodelledForce::structure() const {
  constexpr double kAsMuch = 0.6;
  const auto is_told = [](const LatentStructure& structure) {
    return structure.z > kToldStructure && structure.share > kLeastStructure;
  };
  const auto most = std::ranges::find_if(structures_, is_told);
  if (most == structures_.end()) return nullptr;
  // A curve may draw what a constant of each recording does: positions differ between them, too.
  const auto plainest = std::ranges::find_if(structures_, [&](const LatentStructure& structure) {
    return structure.on == kOfRecording && is_told(structure) &&
           structure.share > kAsMuch * most->share;
  });
  return plainest == structures_.end() ? &*most : &*plainest;
}

double UnmodelledForce::structured_share() const {
  const LatentStructure* const most = structure();
  return most == nullptr ? 0.0 : share_ * std::sqrt(std::min(most->share, 1.0));
}

double UnmodelledForce::multiple_of_noise() const {
  return largest_ratio(horizons_, &HorizonError::by_noise);
}

double UnmodelledForce::multiple_of_rest() const {
  return largest_ratio(horizons_, &HorizonError::by_rest);
}

bool UnmodelledForce::costs_at_most(double share, const HorizonError& at) const {
  if (at.error.size() == 0) return false;
  const Eigen::ArrayXd by_force =
      (at.by_rest.array().square() - at.by_noise.array().square()).max(0.0).sqrt();
  // What the error is not, the force has not cost.
  return (by_force.min(at.error.array()) <= share * output_scale_.array()).all();
}

std::optional<Index> UnmodelledForce::foreseeable(double share) const {
  std::optional<Index> longest;
  for (const HorizonError& each : horizons_) {
    if (costs_at_most(share, each)) longest = each.horizon;
  }
  return longest;
}

double UnmodelledForce::unexpected_in_the_end() const {
  if (whole_.error.size() == 0) return 0.0;
  const Eigen::ArrayXd share = whole_.error.array() / output_scale_.array();
  const auto is_expected = whole_.error.array() <= kNoiseMultiple * whole_.by_rest.array();
  return is_expected.select(0.0, share).maxCoeff();
}

bool UnmodelledForce::is_foreseeable_to_the_end(double share) const {
  return costs_at_most(share, whole_);
}

}  // namespace graybox
