#include "diagnosis/final_fit/plainer_laws.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "diagnosis/final_fit/held_out_judging.hpp"
#include "diagnosis/predictor/left_out_blocks.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

using Eigen::VectorXd;

// A spring that hardens passes for one with a clearance, which is soft in its middle, too. With the
// plain spring alone the search would not come back to it.
bool take_sum_with(LastFit& last, const JudgedModel& plainer, const PlacedFinding& rich,
                   std::size_t plain) {
  constexpr std::array kOfPosition{"cubic_spring", "gravity"};
  constexpr double kBetter = 0.8;  // of the cost
  const std::vector<Hypothesis>& all = last.hypotheses->hypotheses();
  for (std::size_t h = 0; h < all.size(); ++h) {
    const bool may_be =
        all[h].place == all[plain].place && std::ranges::count(kOfPosition, all[h].law) > 0 &&
        h != rich.hypothesis &&
        std::ranges::count(last.found.fit.model.laws, h, &PlacedFinding::hypothesis) == 0;
    if (!may_be) continue;
    JudgedModel sum = last.with_law(plainer, h);
    if (!sum.fit.usable || !(sum.fit.cost < kBetter * last.found.fit.cost)) continue;
    if (!(z_between(last.found.fit, sum.fit) > kMissedLaw)) continue;
    last.accepted[plain] = last.accepted[h] = last.accepted_as(rich.hypothesis);
    last.found = std::move(sum);
    return true;
  }
  return false;
}

// `bare` with the plainer law, at the size that the richer one has by the same name.
JudgedModel with_sizes_of(const LastFit& last, const PlacedFinding& rich,
                          const ExtendedLumpedModel& bare, std::size_t hypothesis) {
  const Element& part = last.found.fit.model.model.parts[rich.part];
  const LawEntry& entry = *find_law(part.law_name, false);
  JudgedModel best;
  for (const LawExtension& start : last.hypotheses->extensions(bare, last.motion())) {
    if (start.hypothesis != hypothesis || start.replaces) continue;
    const LawEntry& plainer = *find_law(start.law, false);
    for (std::size_t p = 0; p < plainer.parameters.size(); ++p) {
      const auto named =
          std::ranges::find(entry.parameters, plainer.parameters[p].name, &LawParameter::name);
      if (start.direction[p] == 0.0 || named == entry.parameters.end()) continue;
      const auto at = static_cast<std::size_t>(named - entry.parameters.begin());
      const double amplitude = (part.parameters[at] - start.base[p]) / start.direction[p];
      JudgedModel each = last.judged(extended(bare, start, amplitude), kLastFitIterations);
      if (!each.fit.usable || (best.fit.usable && best.fit.cost <= each.fit.cost)) continue;
      best = std::move(each);
    }
  }
  return best;
}

// A model that is no better near and foretells more far ahead, in the fit's recordings and in those
// kept out. Without these nothing is said.
bool predicts_further(const LastFit& last, JudgedModel& plainer) {
  constexpr double kFewer = 0.95;  // of the error
  judge_held_out(last, plainer);
  JudgedModel richer = last.found;
  judge_held_out(last, richer);
  if (last.judged_by.horizon == last.task.horizon || !plainer.held_out_error ||
      !richer.held_out_error) {
    return false;
  }
  const VectorXd& scale = last.data->output_scale();
  const auto is_less = [&](const VectorXd& one, const VectorXd& other) {
    return relative_size(one, scale) < kFewer * relative_size(other, scale);
  };
  return is_less(plainer.error, richer.error) &&
         is_less(*plainer.held_out_error, *richer.held_out_error);
}

bool take_plainer_law(LastFit& last, std::size_t law) {
  const PlacedFinding placed = last.found.fit.model.laws[law];
  const std::vector<Hypothesis>& all = last.hypotheses->hypotheses();
  const Hypothesis& rich = all[placed.hypothesis];
  if (rich.special_cases.empty()) return false;
  // Without the law a fit may leave its valley: the plainer one begins beside both.
  const ExtendedLumpedModel bare = without_part(last.found.fit.model, placed.part);
  const JudgedModel without = last.judged(bare, kLastFitIterations);
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].place != rich.place || std::ranges::count(rich.special_cases, all[h].law) == 0) {
      continue;
    }
    JudgedModel plainer = with_sizes_of(last, placed, bare, h);
    if (without.fit.usable) {
      JudgedModel other = last.with_law(without, h);
      const bool is_better =
          other.fit.usable && (!plainer.fit.usable || other.fit.cost < plainer.fit.cost);
      if (is_better) plainer = std::move(other);
    }
    if (!plainer.fit.usable) continue;
    if (last.z_over(plainer) >= kMissedLaw && !predicts_further(last, plainer)) {
      if (take_sum_with(last, plainer, placed, h)) return true;
      continue;
    }
    last.accepted[h] = last.accepted_as(placed.hypothesis);
    last.found = std::move(plainer);
    return true;
  }
  return false;
}

// The model with a friction that turns at once in place of this one, from the best of these levels.
JudgedModel with_steep_friction(const LastFit& last, const PlacedFinding& gradual,
                                const std::array<double, 3>& levels) {
  const ExtendedLumpedModel bare = without_part(last.found.fit.model, gradual.part);
  JudgedModel best;
  for (const LawExtension& start : last.hypotheses->extensions(bare, last.motion())) {
    if (start.hypothesis != gradual.hypothesis || start.replaces || !start.fixed[1]) continue;
    for (const double level : levels) {
      if (!(level > 0.0)) continue;
      JudgedModel steep = last.judged(extended(bare, start, level), kLastFitIterations);
      const bool is_better =
          steep.fit.usable && (!best.fit.usable || steep.fit.cost < best.fit.cost);
      if (is_better) best = std::move(steep);
    }
  }
  return best;
}

// Dry friction that slides over gradually, where one that turns at once predicts as well: over the
// short windows of the search other errors make it gradual. Where the mass stood still under a
// drive one that turns at once is there, and may predict a little worse.
bool take_steep_friction(LastFit& last, std::size_t law) {
  constexpr double kLittleWorse = 2.0;  // of the cost
  const PlacedFinding placed = last.found.fit.model.laws[law];
  const ExtendedLumpedModel& model = last.found.fit.model;
  const std::size_t transition = model.first_parameter(placed.part) + 1;
  const bool is_gradual = model.model.parts[placed.part].law_name == "coulomb" &&
                          std::ranges::count(last.found.fit.free, transition) > 0;
  if (!is_gradual) return false;
  const double level = model.model.parameters[transition - 1].value,
               held = last.hypotheses->held_at_standstill();
  JudgedModel steep = with_steep_friction(last, placed, {level, 0.5 * level, held});
  if (!steep.fit.usable) return false;
  const bool must_hold = held > 0.0 && steep.fit.cost < kLittleWorse * last.found.fit.cost;
  if (!must_hold && last.z_over(steep) >= kMissedLaw && !predicts_further(last, steep))
    return false;
  last.found = std::move(steep);
  return true;
}

// Where inertia is small, a drive that does not answer to small commands moves a mass as dry
// friction there does. Every machine has that; few have such a drive.
bool take_friction_for_dead_drive(LastFit& last, std::size_t law) {
  constexpr double kRarer = 4.0;     // z of a drive that is believed to be dead
  constexpr double kNoWorse = 1.02;  // of the error kept out
  const PlacedFinding placed = last.found.fit.model.laws[law];
  const Element& part = last.found.fit.model.model.parts[placed.part];
  if (part.law_name != "dead_zone" || part.location.kind != LocationKind::kActuator) return false;
  const std::vector<Hypothesis>& all = last.hypotheses->hypotheses();
  const JudgedModel without =
      last.judged(without_part(last.found.fit.model, placed.part), kLastFitIterations);
  if (!without.fit.usable) return false;
  JudgedModel best;
  std::size_t taken = 0;
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].law != "coulomb" || !last.hypotheses->is_plain(h)) continue;
    JudgedModel other = last.with_law(without, h);
    if (!other.fit.usable || (best.fit.usable && best.fit.cost <= other.fit.cost)) continue;
    best = std::move(other);
    taken = h;
  }
  if (!best.fit.usable || last.z_over(best) >= kRarer) return false;
  judge_held_out(last, best);
  judge_held_out(last, last.found);
  if (best.held_out_error && last.found.held_out_error &&
      relative_size(*best.held_out_error, best.held_out_scale) >
          kNoWorse * relative_size(*last.found.held_out_error, last.found.held_out_scale)) {
    return false;
  }
  last.accepted[taken] = last.accepted_as(placed.hypothesis);
  last.found = std::move(best);
  return true;
}

// A law that fits as well as its rivals and raises the error kept out, as a constant force for the
// dry friction of motion one way: the rival that lowers that error most takes its place.
bool take_rival_that_holds(LastFit& last, std::size_t law) {
  constexpr double kRaised = 1.05, kHolds = 0.7, kAsWell = 2.0;  // of the error; z
  const PlacedFinding placed = last.found.fit.model.laws[law];
  const auto accepted = std::ranges::find(last.findings->laws, last.accepted_as(placed.hypothesis),
                                          &AcceptedLaw::hypothesis);
  if (!last.data->has_validation() || accepted == last.findings->laws.end()) return false;
  const JudgedModel without =
      last.judged(without_part(last.found.fit.model, placed.part), kLastFitIterations);
  const auto after = law_error_held_out(last, last.found),
             before = law_error_held_out(last, without);
  if (!after || !before) return false;
  const VectorXd& scale = last.data->output_scale();
  const double alone = relative_size(before->error, scale);
  if (relative_size(after->error, scale) < kRaised * alone) return false;
  double least = kHolds * alone;
  std::optional<JudgedModel> best;
  for (const TriedLaw& tried : accepted->rivals) {
    JudgedModel rival = last.with_law(without, tried.hypothesis);
    const auto error = rival.fit.usable ? law_error_held_out(last, rival) : std::nullopt;
    if (!error || relative_size(error->error, scale) >= least || last.z_over(rival) >= kAsWell) {
      continue;
    }
    least = relative_size(error->error, scale);
    last.accepted[tried.hypothesis] = accepted->hypothesis;
    best = std::move(rival);
  }
  if (best) last.found = *std::move(best);
  return best.has_value();
}

// Over a part of its turn a weight pulls back as a spring does. Every arm has a weight.
bool take_weight_for_spring(LastFit& last, std::size_t law) {
  JudgedModel weight = fit_with_weight_for_spring(last, law);
  if (!weight.fit.usable) return false;
  if (last.z_over(weight) >= kMissedLaw && !predicts_further(last, weight)) return false;
  last.accepted[weight.fit.model.laws.back().hypothesis] =
      last.accepted_as(last.found.fit.model.laws[law].hypothesis);
  last.found = std::move(weight);
  return true;
}

}  // namespace

std::vector<std::size_t> places_elsewhere(const LastFit& last, std::size_t hypothesis) {
  const std::vector<Hypothesis>& all = last.hypotheses->hypotheses();
  const auto is_late = [](const Hypothesis& each) {
    return each.law == "lag" || each.law == "delay";
  };
  std::vector<std::size_t> others;
  for (std::size_t h = 0; h < all.size(); ++h) {
    const bool is_there =
        std::ranges::count(last.found.fit.model.laws, h, &PlacedFinding::hypothesis) > 0;
    const bool is_alike =
        all[h].law == all[hypothesis].law && all[h].place != all[hypothesis].place &&
        last.hypotheses->location(h).kind == last.hypotheses->location(hypothesis).kind;
    const bool are_late = is_late(all[h]) && is_late(all[hypothesis]);
    if (!is_there && (is_alike || are_late)) others.push_back(h);
  }
  return others;
}

JudgedModel fit_with_weight_for_spring(const LastFit& last, std::size_t law) {
  const ExtendedLumpedModel& model = last.found.fit.model;
  const std::size_t part = model.laws[law].part;
  const std::string& name = model.model.parts[part].law_name;
  if (name != "stiffness" && name != "cubic_spring" && name != "dead_zone") return {};
  const auto weight = last.hypotheses->weight_like(model, part, last.motion());
  if (!weight) return {};
  return last.judged(extended(without_part(model, part), *weight, 1.0), kLastFitIterations);
}

bool take_better_places(LastFit& last) {
  constexpr double kBetter = 0.97;  // of the cost
  bool has_moved = false;
  for (std::size_t l = 0; l < last.found.fit.model.laws.size(); ++l) {
    const PlacedFinding law = last.found.fit.model.laws[l];
    const JudgedModel poorer =
        last.judged(without_part(last.found.fit.model, law.part), kLastFitIterations);
    if (!poorer.fit.usable) continue;
    for (const std::size_t other : places_elsewhere(last, law.hypothesis)) {
      JudgedModel moved = last.with_law(poorer, other);
      if (!moved.fit.usable || !(moved.fit.cost < kBetter * last.found.fit.cost)) continue;
      if (!(z_between(last.found.fit, moved.fit) > 0.0)) continue;
      last.accepted[other] = last.accepted_as(law.hypothesis);
      last.found = std::move(moved);
      has_moved = true;
    }
  }
  return has_moved;
}

bool take_plainer_laws(LastFit& last) {
  bool has_changed = false;
  for (std::size_t l = 0; l < last.found.fit.model.laws.size();) {
    const bool is_plainer = take_plainer_law(last, l) || take_steep_friction(last, l) ||
                            take_friction_for_dead_drive(last, l) ||
                            take_rival_that_holds(last, l) || take_weight_for_spring(last, l);
    has_changed |= is_plainer;
    l = is_plainer ? 0 : l + 1;
  }
  return has_changed;
}

}  // namespace graybox
