#include "diagnosis/predictor/told_law.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

using Eigen::Index;
using Eigen::VectorXd;

ToldSize told_size(const PredictionFit& fit, const VectorXd& deviations, const PlacedFinding& law,
                   double errors) {
  const Element& part = fit.model.model.parts[law.part];
  const LawEntry& entry = *find_law(part.law_name, part.location.kind != LocationKind::kElement);
  const auto is_force = [](const LawParameter& each) { return each.unit.starts_with('F'); };
  const bool has_force = std::ranges::any_of(entry.parameters, is_force);
  const std::size_t first = fit.model.first_parameter(law.part);
  ToldSize told;
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    if (fit.free[i] < first || fit.free[i] >= first + part.parameters.size()) continue;
    if (has_force && !is_force(entry.parameters[fit.free[i] - first])) continue;
    told.is_free = true;
    const double value = std::abs(fit.model.model.parameters[fit.free[i]].value);
    told.is_told = told.is_told || value > errors * deviations(static_cast<Index>(i));
  }
  return told;
}

namespace {

bool swings(const Element& part) { return part.law_name == "mode" || part.law_name == "resonance"; }

// Hz: the second parameter of what swings.
double frequency_of(const Element& part) { return part.parameters[1]; }

}  // namespace

bool has_told_parameter(const PredictionFit& fit, const VectorXd& deviations,
                        const PlacedFinding& law, double errors) {
  const std::size_t first = fit.model.first_parameter(law.part);
  const std::size_t count = fit.model.model.parts[law.part].parameters.size();
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const std::size_t index = fit.free[i];
    if (index < first || index >= first + count) continue;
    const double value = fit.model.model.parameters[index].value;
    if (std::abs(value) > errors * deviations(static_cast<Eigen::Index>(i))) return true;
  }
  return false;
}

bool swings_too_slowly(const PredictionFit& fit, const PlacedFinding& law,
                       const PredictionData& data) {
  constexpr double kFewestPeriods = 2.0;
  const Element& part = fit.model.model.parts[law.part];
  if (!swings(part)) return false;
  Index longest = 0;
  for (const OutputErrorRecording& recording : data.recordings()) {
    if (recording.role == ExperimentRole::kEstimation) {
      longest = std::max(longest, recording.time.size());
    }
  }
  const double seconds = static_cast<double>(longest) * data.sample_time();
  return frequency_of(part) * seconds < kFewestPeriods;
}

bool is_late_at_bound(const PredictionFit& fit, const PlacedFinding& law) {
  constexpr double kNearly = 0.999;
  const std::string& name = fit.model.model.parts[law.part].law_name;
  if (name != "lag" && name != "delay") return false;
  if (fit.model.model.outputs.size() > 1) return false;
  const std::size_t time = fit.model.first_parameter(law.part);
  return fit.model.model.parameters[time].value > kNearly * fit.model.space[time].high;
}

bool turns_its_drive(const PredictionFit& fit, const PlacedFinding& law) {
  const Element& part = fit.model.model.parts[law.part];
  const bool is_gain = part.law_name == "gain" && part.location.kind == LocationKind::kActuator;
  // The reference of a curve is the largest input: there the gain is 1 + curvature.
  return (is_gain || part.law_name == "curved_gain") && part.parameters[0] <= -1.0;
}

namespace {

// Zero twice but for the rounding of a resampling, as counts of an encoder are that stands still;
// noise about an offset is not.
bool rests_at_zero(const VectorXd& readings) {
  constexpr double kRounding = 1e-6;  // of the largest
  const double zero = kRounding * readings.cwiseAbs().maxCoeff();
  for (Index k = 1; k < readings.size(); ++k) {
    if (std::abs(readings(k - 1)) <= zero && std::abs(readings(k)) <= zero) return true;
  }
  return false;
}

}  // namespace

bool contradicts_its_zero(const PredictionFit& fit, const PlacedFinding& law,
                          const PredictionData& data) {
  constexpr double kFarOff = 0.1;  // of the largest reading
  const Element& part = fit.model.model.parts[law.part];
  if (part.law_name != "offset" || part.location.kind != LocationKind::kSensor) return false;
  const Index channel = part.location.channel;
  using enum LumpedOutput::Quantity;
  if (fit.model.model.outputs[static_cast<std::size_t>(channel)].quantity != kVelocity)
    return false;
  double largest = 0.0;
  int from_zero = 0;  // recordings; a resampling keeps but the first of two zeros
  for (const OutputErrorRecording& recording : data.recordings()) {
    const VectorXd readings = recording.outputs.col(channel);
    if (readings.size() == 0) continue;
    if (readings(0) == 0.0) ++from_zero;
    if (rests_at_zero(readings) || from_zero > 1) return true;
    largest = std::max(largest, readings.cwiseAbs().maxCoeff());
  }
  return std::abs(part.parameters[0]) > kFarOff * largest;
}

bool is_on_no_machine(const PredictionFit& fit, const PlacedFinding& law,
                      const PredictionData& data) {
  const Element& part = fit.model.model.parts[law.part];
  const LawEntry& entry = *find_law(part.law_name, part.location.kind != LocationKind::kElement);
  return !keeps_order(entry, part.parameters) || swings_too_slowly(fit, law, data) ||
         is_late_at_bound(fit, law) || turns_its_drive(fit, law) ||
         contradicts_its_zero(fit, law, data);
}

bool has_loose_frequency(const PredictionFit& fit, const VectorXd& deviations,
                         const PlacedFinding& law) {
  constexpr double kLoose = 0.3;  // standard error over value
  if (!swings(fit.model.model.parts[law.part])) return false;
  const std::size_t frequency = fit.model.first_parameter(law.part) + 1;
  const auto at = std::ranges::find(fit.free, frequency);
  if (at == fit.free.end()) return false;
  const double value = fit.model.model.parameters[frequency].value;
  return !(deviations(at - fit.free.begin()) < kLoose * std::abs(value));
}

bool is_longer_than_the_way(const PredictionFit& fit, const PlacedFinding& law,
                            const Eigen::MatrixXd& motion) {
  const Element& part = fit.model.model.parts[law.part];
  if (part.law_name != "ripple" || part.location.kind != LocationKind::kElement) return false;
  const VectorXd way = motion.leftCols(motion.cols() / 2) * part.location.input;
  return std::abs(part.parameters[1]) > way.maxCoeff() - way.minCoeff();
}

}  // namespace graybox
