#include "diagnosis/force_balance/balance_hypotheses.hpp"

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

#include "diagnosis/force_balance/shape_refinement.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

// Every joint has friction; then come loads; then what may stand in for a load, offsets and coupled
// joints.
int rank_of(std::string_view law, const CandidatePlace& place) {
  const bool is_friction = law == "viscous" || law == "coulomb";
  if (is_friction) return place.is_compound ? 2 : 0;
  if (law == "payload" || law == "inertia" || law == "gravity") return 1;
  if (law == "offset") return place.location.load.empty() ? 2 : 1;
  return kRareRank;
}

// None for a payload, which all joints carry.
std::vector<std::size_t> coordinates_of(const CandidatePlace& place) {
  std::vector<std::size_t> coordinates;
  for (Index j = 0; j < place.location.output.size(); ++j) {
    if (place.location.output(j) != 0.0) coordinates.push_back(static_cast<std::size_t>(j));
  }
  return coordinates;
}

bool is_within_ranges(const PlacedLaw& law) {
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    const ParameterRange range = law.entry->parameters[i].range;
    const double value = law.parameters[i];
    if (range == ParameterRange::kPositive && !(value > 0.0)) return false;
    if (range == ParameterRange::kNonNegative && !(value >= 0.0)) return false;
    if (range == ParameterRange::kUnitInterval && !(value >= 0.0 && value <= 1.0)) return false;
  }
  return true;
}

// A spring on a lever that is short beside its anchor's distance gives a torque that is a sine of
// the angle, which is a weight's. So does one whose anchor is near beside its lever: the two may
// change places.
bool has_lever(const PlacedLaw& law) {
  constexpr double kShortest = 0.01;  // of the distance
  double distance = 0.0, lever = 0.0;
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    const std::string_view name = law.entry->parameters[i].name;
    if (name == "anchor_distance") distance = law.parameters[i];
    if (name == "lever_length") lever = law.parameters[i];
  }
  if (distance == 0.0) return true;  // the law has none
  return std::min(lever, distance) >= kShortest * std::max(lever, distance);
}

// The period of a ripple; none for other laws.
std::optional<double> wave_of(const PlacedLaw& law) {
  if (law.entry->name != "ripple") return {};
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    if (law.entry->parameters[i].name == "period") return law.parameters[i];
  }
  return {};
}

// A ripple that comes back about once in a turn of the axis: a weight does so, too, and exactly.
bool is_weight(const PlacedLaw& law) {
  const std::optional<double> wave = wave_of(law);
  return wave && law.place->turns && law.place->may_lift && is_about_a_turn(*wave);
}

}  // namespace

bool tells_standing(const ForceBalanceData& data) {
  constexpr double kHeld = 0.2;  // of the forces that act
  const double held = data.standing.held();
  return held > 0.0 &&
         held > kHeld * data.estimation.root_mean_squares(data.estimation.measured)(0);
}

BalanceHypotheses::BalanceHypotheses(const ForceBalanceData& data) : data_(data) {
  for (const CandidatePlace& place : data_.places) {
    scales_.push_back(motion_scale(place, data_.estimation));
    scales_.back().stands_under_force = tells_standing(data_);
    for (const LawEntry* entry : force_balance_laws(place, data_.position_is_recorded)) {
      hypotheses_.push_back({.place = place.location.name,
                             .location = place.yaml,
                             .law = entry->name,
                             .special_cases = special_cases_of(*entry, false),
                             .is_compound = place.is_compound,
                             .repeatable = entry->name == "ripple",
                             .characteristic = characteristic_of(*entry, place),
                             .acts_on = coordinates_of(place),
                             .rank = rank_of(entry->name, place)});
      entries_.push_back(entry);
      place_of_.push_back(scales_.size() - 1);
    }
  }
}

PlacedLaw BalanceHypotheses::placed(std::size_t hypothesis, std::vector<double> parameters,
                                    const Eigen::VectorXd& inverse_gains) const {
  PlacedLaw law{&place(hypothesis), entries_[hypothesis], std::move(parameters)};
  if (law.place->location.is_flange) law.inverse_gains = inverse_gains;
  return law;
}

std::string BalanceHypotheses::trouble_with(const PlacedLaw& law) const {
  if (!is_within_ranges(law)) return "a law's parameter leaves its range";
  // A spring that yields may come to a shape that it can have. In the end it must have one
  // (law_rejection.hpp).
  if (law.entry->name != "bouc_wen" && !keeps_order(*law.entry, law.parameters)) {
    return "friction at rest is less than when sliding: no Stribeck effect";
  }
  if (!slides(law)) return "a friction never slides: it is a damper here";
  if (!comes_back(law)) return "less than a wave of a ripple was recorded: it is a spring here";
  if (!is_shown(law)) return "a ripple is shorter than the samples show";
  if (is_weight(law)) return "a ripple of about a turn is a weight";
  if (!has_lever(law)) {
    return "a balancer's lever or anchor is next to nothing: its torque is a weight's";
  }
  if (!is_within_reach(law)) return "a payload is farther from the flange than the robot is long";
  return "";
}

const MotionScale& BalanceHypotheses::scale_of(const PlacedLaw& law) const {
  return scales_[static_cast<std::size_t>(law.place - data_.places.data())];
}

bool BalanceHypotheses::slides(const PlacedLaw& law) const {
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    if (law.entry->parameters[i].name == "transition_velocity" &&
        law.parameters[i] > widest_transition(scale_of(law))) {
      return false;
    }
  }
  return true;
}

bool BalanceHypotheses::is_within_reach(const PlacedLaw& law) const {
  if (law.entry->use != LawUse::kPayload) return true;
  double length = data_.robot.flange.translation().norm();
  for (const RobotJoint& joint : data_.robot.joints) length += joint.origin.translation().norm();
  const auto& p = law.parameters;
  return Eigen::Vector3d(p[1], p[2], p[3]).norm() <= length;
}

// A wave that was not recorded as a whole is a guess.
bool BalanceHypotheses::comes_back(const PlacedLaw& law) const {
  const std::optional<double> wave = wave_of(law);
  return !wave || *wave <= scale_of(law).range;
}

bool BalanceHypotheses::is_shown(const PlacedLaw& law) const {
  const std::optional<double> wave = wave_of(law);
  return !wave || *wave >= scale_of(law).shown_wave;
}

}  // namespace graybox
