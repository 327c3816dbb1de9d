#include "diagnosis/prediction_verdict/confounded_sizes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

namespace graybox {
namespace {

using Eigen::Index;

struct PlainForce {
  std::string_view law, is_absent, beside, remedy;
};
constexpr std::array kForces{
    PlainForce{"offset", "carries no constant force", "a constant force",
               "Record it standing under its drive, or with other accelerations"},
    PlainForce{"gravity", "lifts no weight", "a weight",
               "Record it standing under its drive, or with other accelerations"},
    PlainForce{"coulomb", "has no dry friction", "dry friction",
               "Record several speeds, slow and fast"},
    PlainForce{"viscous", "has no viscous friction", "viscous friction",
               "Record several speeds, slow and fast"}};

struct Size {
  std::string name, unit;
  double value = 0.0, other = 0.0, error = 0.0;  // without the force, beside it, and that one's
  double ratio = 0.0;                            // by which the force makes it less sure
};

// The parameter of the model found that is least sure beside this law: moved, or with a larger
// error.
std::optional<Size> least_sure(const JudgedModel& found, const JudgedModel& beside) {
  constexpr double kTimes = 5.0;                // of the error without the law
  constexpr double kMoved = 0.2, kLoose = 0.5;  // of the value
  std::optional<Size> most;
  for (std::size_t i = 0; i < found.fit.free.size(); ++i) {
    const std::size_t index = found.fit.free[i];
    if (index >= found.fit.model.own_parameters()) continue;
    const auto at = std::ranges::find(beside.fit.free, index);
    if (at == beside.fit.free.end()) continue;
    const LumpedParameter& own = found.fit.model.model.parameters[index];
    const double other = beside.fit.model.model.parameters[index].value;
    const double error = found.deviations(static_cast<Index>(i));
    const double beside_error = beside.deviations(at - beside.fit.free.begin());
    if (!(error > 0.0) || error > std::abs(own.value)) continue;  // said to be not determined
    const double moved = std::abs(other - own.value), least = kTimes * error;
    const bool has_moved = moved > std::max(least, kMoved * std::abs(own.value));
    const bool is_loose = beside_error > std::max(least, kLoose * std::abs(own.value));
    const double ratio = std::max(moved, beside_error) / error;
    if ((!has_moved && !is_loose) || (most && ratio < most->ratio)) continue;
    most = Size{own.name, own.unit, own.value, other, beside_error, ratio};
  }
  return most;
}

// Dampings of masses that move at one speed: there friction of every kind is one constant force.
std::vector<std::string> of_one_speed(const PredictionOutcome& from) {
  constexpr double kMoves = 0.1, kOneSpeed = 1.3;  // of the fastest; fast over slow
  std::vector<std::string> sentences;
  const LumpedModel& model = from.final->found().fit.model.model;
  const Eigen::MatrixXd motion = from.final->motion();
  const std::size_t own = std::min(from.stated->parts.size(), model.parts.size());
  for (std::size_t i = 0; i < own; ++i) {
    const Element& part = model.parts[i];
    const bool is_free = !model.parameters[from.final->found().fit.model.first_parameter(i)].fixed;
    if (part.law_name != "viscous" || part.location.kind != LocationKind::kElement || !is_free) {
      continue;
    }
    const Eigen::VectorXd rate = motion.rightCols(motion.cols() / 2) * part.location.input;
    std::vector<double> speeds;
    for (const double v : rate) speeds.push_back(std::abs(v));
    std::ranges::sort(speeds);
    const auto slowest = std::ranges::lower_bound(speeds, kMoves * speeds.back());
    const auto moving = static_cast<double>(speeds.end() - slowest);
    const double slow = *(slowest + static_cast<Index>(0.1 * moving)),
                 fast = *(slowest + static_cast<Index>(0.9 * moving));
    if (!(slow > 0.0) || fast > kOneSpeed * slow) continue;
    sentences.push_back(fmt::format(
        "{} moves at about one speed, so the damping of {} may as well be dry friction or a "
        "constant force. Record several speeds, slow and fast.",
        part.location.name, part.name));
  }
  return sentences;
}

// A parameter with the forces beside which it is not sure, and its value beside the worst of them.
struct Doubt {
  Size size;
  std::string place, absences;
  PlainForce worst;
};

void add_doubt(const Size& size, const std::string& place, const PlainForce& force,
               std::vector<Doubt>& doubts) {
  const auto known = std::ranges::find_if(doubts, [&](const Doubt& doubt) {
    return doubt.size.name == size.name && doubt.place == place;
  });
  if (known == doubts.end()) {
    doubts.push_back({size, place, std::string(force.is_absent), force});
    return;
  }
  known->absences += fmt::format(" and {}", force.is_absent);
  if (size.ratio <= known->size.ratio) return;
  known->size = size;
  known->worst = force;
}

}  // namespace

std::vector<std::string> confounded_sizes(const PredictionOutcome& from) {
  constexpr double kCarried = 3.0;  // times the largest force
  std::vector<std::string> sentences = of_one_speed(from);
  const JudgedModel& found = from.final->found();
  if (!sentences.empty() || !is_short(*from.data) || found.deviations.size() == 0) return sentences;
  const std::vector<Hypothesis>& all = from.hypotheses->hypotheses();
  std::vector<Doubt> doubts;
  for (const PlainForce& force : kForces) {
    for (std::size_t h = 0; h < all.size(); ++h) {
      const bool is_of_machine = all[h].location.find("kind: element") != std::string::npos;
      const bool is_asked =
          all[h].law == force.law && is_of_machine && from.hypotheses->is_plain(h) &&
          std::ranges::count(found.fit.model.laws, h, &PlacedFinding::hypothesis) == 0;
      if (!is_asked) continue;
      const JudgedModel beside = from.final->beside(h);
      if (!beside.fit.usable || beside.fit.cost > found.fit.cost) continue;
      const double level = beside.fit.model.model.parts.back().parameters[0];
      if (std::abs(level) > kCarried * from.data->largest_force()) continue;
      const std::optional<Size> size = least_sure(found, beside);
      if (size) add_doubt(*size, all[h].place, force, doubts);
    }
  }
  for (const Doubt& doubt : doubts) {
    sentences.push_back(fmt::format(
        "{} is {:.3g} {} only if {} {}: beside {} it is {:.3g}{}, and these recordings do not tell "
        "which. {}.",
        doubt.size.name, doubt.size.value, doubt.size.unit, doubt.place, doubt.absences,
        doubt.worst.beside, doubt.size.other,
        std::isfinite(doubt.size.error) ? fmt::format(" ± {:.2g}", doubt.size.error) : "",
        doubt.worst.remedy));
  }
  return sentences;
}

}  // namespace graybox
