#include "bench/challenge/score_challenge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <sstream>

#include "bench/challenge/same_system.hpp"
#include "bench/study/environment.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/files/json_file.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kLargestClass = 3;
constexpr double kNoiseFloor = 1.1;     // chi-square over degrees of freedom, held-out
constexpr double kLargestError = 0.15;  // over the signal, held-out, in any motion

double number_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>()
                                                   : std::numeric_limits<double>::quiet_NaN();
}

AnsweredLaw law_from(const Json& json, const std::string& law_name) {
  AnsweredLaw law{json.at("place").get<std::string>(), law_name, {}};
  const auto parameters = json.find("parameters");
  if (parameters == json.end()) return law;
  for (const auto& [name, estimate] : parameters->items()) {
    law.parameters[name] = {number_in(estimate, "value"), number_in(estimate, "standard_error")};
  }
  return law;
}

// The law at its place, and at others where it is the same system. Nor have alternatives that are
// only named, without parameters, a system of their own: such recordings can't tell them from the
// one before.
void add_members(const Json& json, std::vector<AnsweredLaw>& members) {
  const auto law = json.at("law").get<std::string>();
  members.push_back(law_from(json, law));
  members.back().is_same_system = members.back().parameters.empty();
  const auto places = json.find("same_at");
  if (places == json.end()) return;
  for (const Json& place : *places) {
    members.push_back(law_from(place, law));
    members.back().is_same_system = true;
  }
}

bool counts_systems(const CaseTruth& truth) { return set_of(truth.family) != kPeriodicSet; }

std::size_t systems_in(const CaseTruth& truth, const std::vector<AnsweredLaw>& members) {
  if (!counts_systems(truth)) {
    return static_cast<std::size_t>(
        std::ranges::count(members, false, &AnsweredLaw::is_same_system));
  }
  std::set<std::string> systems;
  for (const AnsweredLaw& law : members) {
    if (!law.is_same_system) systems.insert(system_of(truth, law.place, law.law));
  }
  return std::max<std::size_t>(systems.size(), members.empty() ? 0 : 1);
}

// What a class counts as.
std::size_t size_of(const CaseTruth& truth, const std::vector<AnsweredLaw>& members) {
  return counts_systems(truth) ? systems_in(truth, members) : members.size();
}

// A number of fit.after.validation, if all of it is there.
double validation_of(const Json& verdict, const char* name) {
  const Json* at = &verdict;
  for (const char* key : {"fit", "after", "validation"}) {
    const auto found = at->is_object() ? at->find(key) : at->end();
    if (found == at->end() || !found->is_object()) return std::numeric_limits<double>::quiet_NaN();
    at = &*found;
  }
  return number_in(*at, name);
}

bool names(const AnsweredLaw& law, const HiddenEffect& effect) {
  return law.place == effect.place && law.law == effect.law;
}

bool is_same(const CaseTruth& truth, const AnsweredLaw& law, const HiddenEffect& effect) {
  return names(law, effect) ||
         (counts_systems(truth) &&
          system_of(truth, law.place, law.law) == system_of(truth, effect.place, effect.law));
}

bool holds(const CaseTruth& truth, const std::vector<AnsweredLaw>& effect_class,
           const HiddenEffect& effect) {
  return std::ranges::any_of(effect_class,
                             [&](const AnsweredLaw& law) { return is_same(truth, law, effect); });
}

// By the very law and place, whose parameters can be compared.
const AnsweredLaw* member_of(const std::vector<AnsweredLaw>& effect_class,
                             const HiddenEffect& effect) {
  const auto found = std::ranges::find_if(
      effect_class, [&](const AnsweredLaw& law) { return names(law, effect); });
  return found == effect_class.end() ? nullptr : &*found;
}

// A dry friction that differs by direction, answered as a dry friction and an offset at its place:
// both become one effect of that name. Only where the truth is so, and the answer does not say it.
Answer with_asymmetric_friction(const CaseTruth& truth, Answer answer) {
  if (!counts_systems(truth) || truth.effects.size() != 1 ||
      truth.effects[0].law != "asymmetric_coulomb") {
    return answer;
  }
  const HiddenEffect& effect = truth.effects[0];
  const auto find = [&](const char* law) {
    HiddenEffect part = effect;
    part.law = law;
    return std::ranges::find_if(answer.effects, [&](const std::vector<AnsweredLaw>& members) {
      return !members.empty() && is_same(truth, members.front(), part);
    });
  };
  const auto friction = find("coulomb"), offset = find("offset");
  if (friction == answer.effects.end() || offset == answer.effects.end()) return answer;
  friction->front() = {effect.place, effect.law, {}};
  answer.effects.erase(offset);
  return answer;
}

// The effects of the answer whose class holds each true effect, the smallest class first; none
// twice.
std::vector<const std::vector<AnsweredLaw>*> classes_with(const CaseTruth& truth,
                                                          const Answer& answer) {
  std::vector<const std::vector<AnsweredLaw>*> found;
  std::set<const void*> used;
  for (const HiddenEffect& effect : truth.effects) {
    const std::vector<AnsweredLaw>* best = nullptr;
    for (const auto& candidate : answer.effects) {
      if (!holds(truth, candidate, effect) || used.contains(&candidate)) continue;
      if (best == nullptr || size_of(truth, candidate) < size_of(truth, *best)) best = &candidate;
    }
    if (best != nullptr) used.insert(best);
    found.push_back(best);
  }
  return found;
}

// Angles are the same a turn on.
double distance(const TrueParameter& parameter, double value) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double difference = value - parameter.value;
  return std::abs(parameter.unit == "rad" ? std::remainder(difference, kTurn) : difference);
}

void compare_parameters(const HiddenEffect& effect, const AnsweredLaw& law, ScoredCase& scored) {
  for (const TrueParameter& parameter : effect.parameters) {
    const auto found = law.parameters.find(parameter.name);
    if (!parameter.compared || found == law.parameters.end()) continue;
    if (!std::isfinite(found->second.standard_error)) {
      ++scored.undetermined;
      continue;
    }
    const double error = distance(parameter, found->second.value);
    ++scored.parameters;
    if (error <= 3.0 * found->second.standard_error) ++scored.within_three;
  }
}

bool is_final(const Answer& answer) {
  return answer.verdict == "explained" || answer.verdict == "ambiguous";
}

std::string outcome_of_one(const ScoredCase& scored, bool found) {
  const std::string& verdict = scored.answer.verdict;
  if (verdict == "none" || verdict == "unknown") return verdict;
  const std::size_t size = counts_systems(scored.truth) ? scored.systems : scored.class_size;
  if (found && size > kLargestClass) return "in_large_class";
  if (found) return scored.named_alone ? "right" : "in_class";
  return verdict == "explained" ? "wrong_confident" : "wrong_ambiguous";
}

std::string outcome_of_two(const CaseTruth& truth,
                           const std::vector<const std::vector<AnsweredLaw>*>& found,
                           const Answer& answer) {
  if (answer.verdict == "none") return "none";
  const auto count = std::ranges::count_if(found, [&](const auto* each) {
    return each != nullptr && size_of(truth, *each) <= kLargestClass;
  });
  if (count == 2 && is_final(answer)) return "both";
  if (answer.verdict == "unknown") return "unknown";
  return count >= 1 ? "one" : answer.verdict == "explained" ? "wrong_confident" : "wrong_ambiguous";
}

std::string outcome_outside(const Answer& answer) {
  if (answer.verdict == "none" || answer.verdict == "unknown") return answer.verdict;
  return answer.predicts ? "nearest_law" : "nearest_law_fails";
}

}  // namespace

Interval wilson_interval(const Rate& rate) {
  if (rate.of == 0) return {};
  const double z = normal_quantile(0.975), n = static_cast<double>(rate.of), p = rate.value();
  const double middle = p + z * z / (2.0 * n);
  const double half = z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
  const double scale = 1.0 + z * z / n;
  return {std::max(0.0, (middle - half) / scale), std::min(1.0, (middle + half) / scale)};
}

Answer read_answer(const fs::path& folder) {
  Answer answer;
  answer.validation = answer.error_kept_out = std::numeric_limits<double>::quiet_NaN();
  std::ifstream record_stream(folder / "run.json");
  const Json record = Json::parse(record_stream, nullptr, false);
  if (!record.is_object() || record.value("status", "") != "answered") return answer;
  answer.seconds = record.value("seconds", 0.0);
  answer.confined = record.value("confined", false);
  const fs::path file = folder / "verdict.json";
  const Json verdict = read_json_file<Json>(file.string());
  try {
    answer.verdict = verdict.at("verdict").get<std::string>();
    answer.predicts = verdict.value("predicts_kept_out", true);
    for (const Json& effect : verdict.at("physics")) {
      std::vector<AnsweredLaw> members;
      add_members(effect, members);
      for (const char* more : {"alternatives", "generalisations"}) {
        const auto others = effect.find(more);
        if (others == effect.end()) continue;
        for (const Json& other : *others) add_members(other, members);
      }
      answer.effects.push_back(std::move(members));
    }
    answer.validation = validation_of(verdict, "chi_square_per_dof");
    answer.error_kept_out = 0.01 * validation_of(verdict, "nrmse");  // given in per cent
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: is no verdict: {}", file.string(), error.what()));
  }
  const std::array<std::string, 4> known{"none", "explained", "ambiguous", "unknown"};
  if (std::ranges::find(known, answer.verdict) == known.end()) {
    throw InputError(fmt::format("{}: unknown verdict '{}'", file.string(), answer.verdict));
  }
  answer.given = true;
  return answer;
}

ScoredCase score_case(const CaseTruth& truth, const Answer& given) {
  const Answer answer = with_asymmetric_friction(truth, given);
  ScoredCase scored{truth, answer};
  if (!answer.given) {
    scored.outcome = "no_answer";
    return scored;
  }
  scored.extra = answer.effects.size() > truth.effects.size();
  for (const HiddenEffect& effect : truth.effects) {
    scored.place_right |= !answer.effects.empty() && !answer.effects[0].empty() &&
                          answer.effects[0][0].place == effect.place;
  }
  const auto found = classes_with(truth, answer);
  scored.named_alone = answer.verdict == "explained" && answer.effects.size() == 1 &&
                       truth.effects.size() == 1 &&
                       is_same(truth, answer.effects[0][0], truth.effects[0]);
  for (std::size_t e = 0; e < found.size(); ++e) {
    if (found[e] == nullptr) continue;
    scored.class_size = std::max(scored.class_size, found[e]->size());
    scored.systems = std::max(scored.systems, systems_in(truth, *found[e]));
    const AnsweredLaw* member = member_of(*found[e], truth.effects[e]);
    if (member != nullptr) compare_parameters(truth.effects[e], *member, scored);
  }
  scored.all_listed = !found.empty() && std::ranges::count(found, nullptr) == 0;
  scored.named_as_system =
      is_final(answer) && !found.empty() && !(scored.extra && truth.kind == CaseKind::kOneEffect) &&
      std::ranges::count(found, nullptr) == 0 && scored.systems <= kLargestClass;
  switch (truth.kind) {
    case CaseKind::kNothing:
      scored.outcome = answer.verdict == "none" ? "right" : "false_alarm";
      break;
    case CaseKind::kOneEffect:
      scored.outcome = outcome_of_one(scored, found.front() != nullptr);
      break;
    case CaseKind::kTwoEffects:
      scored.outcome = outcome_of_two(truth, found, answer);
      break;
    case CaseKind::kOutside:
      scored.outcome = outcome_outside(answer);
      break;
  }
  return scored;
}

namespace {

bool is_named_first(const ScoredCase& scored) {
  return scored.truth.kind == CaseKind::kOneEffect && !scored.answer.effects.empty() &&
         names(scored.answer.effects[0][0], scored.truth.effects[0]);
}

}  // namespace

Score score_challenge(const ScoreOptions& options) {
  const ChallengeHeader header = read_header(options.cases);
  UnsealedTruth truth = unseal(options.truth, header);
  const auto check = [&](const fs::path& answers) {
    std::ifstream stream(answers / "run.json");
    const Json stamp = Json::parse(stream, nullptr, false);
    if (!stamp.is_object() || stamp.value("format", "") != "graybox-answers/1") {
      throw InputError(fmt::format("{}: is no folder of answers", answers.string()));
    }
    if (stamp.value("truth_sha256", "") != header.truth_sha256) {
      throw InputError(fmt::format("{}: holds answers to another challenge", answers.string()));
    }
  };
  check(options.answers);
  if (!options.left_out.empty()) check(options.left_out);
  Score score{truth.origin, header.truth_sha256, {}, {}, 0};
  for (const CaseTruth& each : truth.cases) {
    if (!fs::exists(options.answers / each.name / "run.json")) ++score.not_run;
    score.cases.push_back(score_case(each, read_answer(options.answers / each.name)));
    if (!options.left_out.empty() && is_named_first(score.cases.back()) &&
        fs::exists(options.left_out / each.name / "run.json")) {
      score.left_out.push_back(score_case(each, read_answer(options.left_out / each.name)));
    }
  }
  return score;
}

namespace {

template <typename Choose, typename Hit>
Rate rate_of(const std::vector<ScoredCase>& cases, const Choose& choose, const Hit& hit) {
  Rate rate;
  for (const ScoredCase& each : cases) {
    if (!choose(each)) continue;
    ++rate.of;
    if (hit(each)) ++rate.hits;
  }
  return rate;
}

bool is_kind(const ScoredCase& each, CaseKind kind) { return each.truth.kind == kind; }
bool is_detectable_one(const ScoredCase& each) {
  return is_kind(each, CaseKind::kOneEffect) && each.truth.detectable();
}
bool is_hidden(const ScoredCase& each) {
  return !is_kind(each, CaseKind::kNothing) && !each.truth.detectable();
}
bool is_named(const ScoredCase& each) {
  return each.outcome == "right" || (each.outcome == "in_class" && !each.extra);
}
bool is_named_as_system(const ScoredCase& each) { return each.named_as_system; }
// All effects are in classes of at most 3, also of an answer whose verdict is `unknown`.
bool is_found(const ScoredCase& each) { return each.all_listed && each.systems <= kLargestClass; }
bool is_detected(const ScoredCase& each) {
  return each.answer.given && each.answer.verdict != "none";
}
bool is_explained(const ScoredCase& each) {
  return each.answer.given && each.answer.verdict == "explained";
}

bool has_comparable_parameters(const ScoredCase& each) {
  return is_detectable_one(each) && is_named(each);
}

Rate parameter_rate(const std::vector<ScoredCase>& cases) {
  Rate rate;
  for (const ScoredCase& each : cases) {
    if (!has_comparable_parameters(each)) continue;
    rate.of += each.parameters;
    rate.hits += each.within_three;
  }
  return rate;
}

Rate determined_rate(const std::vector<ScoredCase>& cases) {
  Rate rate;
  for (const ScoredCase& each : cases) {
    if (!has_comparable_parameters(each)) continue;
    rate.of += each.parameters + each.undetermined;
    rate.hits += each.parameters;
  }
  return rate;
}

std::string percent(const Rate& rate) {
  if (rate.of == 0) return "no cases";
  const Interval interval = wilson_interval(rate);
  return fmt::format("{:>3} of {:>3}  {:5.1f} %  [{:.1f}, {:.1f}]", rate.hits, rate.of,
                     100.0 * rate.value(), 100.0 * interval.low, 100.0 * interval.high);
}

Json rate_json(const Rate& rate) {
  const Interval interval = wilson_interval(rate);
  return {{"hits", rate.hits},
          {"of", rate.of},
          {"rate", rate.value()},
          {"low", interval.low},
          {"high", interval.high}};
}

std::map<std::string, std::map<std::string, std::size_t>> outcomes_of(const Score& score) {
  std::map<std::string, std::map<std::string, std::size_t>> counts;
  for (const ScoredCase& each : score.cases) {
    const std::string kind =
        is_hidden(each) ? "not_detectable" : std::string(to_string(each.truth.kind));
    ++counts[kind][each.outcome];
  }
  return counts;
}

std::map<std::size_t, std::size_t> class_sizes_of(const Score& score) {
  std::map<std::size_t, std::size_t> counts;
  for (const ScoredCase& each : score.cases) {
    if (is_detectable_one(each) && each.class_size > 0) ++counts[each.class_size];
  }
  return counts;
}

std::string csv_field(const std::string& text) {
  return text.find_first_of(",\"") == std::string::npos ? text : '"' + text + '"';
}

std::string law_label(const HiddenEffect& effect) {
  return effect.at_signal ? effect.law + " (signal)" : effect.law;
}

std::string cases_table(const Score& score) {
  std::string text =
      "case,family,kind,place,law,relative_size,detectable,verdict,named_place,named_law,outcome,"
      "class_size,effects_named,parameters,within_three,undetermined,"
      "validation_chi_square_per_dof,seconds\n";
  for (const ScoredCase& each : score.cases) {
    std::string places, laws, sizes;
    for (const HiddenEffect& effect : each.truth.effects) {
      const char* gap = places.empty() ? "" : " + ";
      places += gap + effect.place;
      laws += gap + law_label(effect);
      sizes += fmt::format("{}{:.3g}", gap, effect.relative_size());
    }
    std::string named_place, named_law;
    for (const auto& members : each.answer.effects) {
      const char* gap = named_place.empty() ? "" : " + ";
      named_place += gap + members.front().place;
      named_law += gap + members.front().law;
    }
    text += fmt::format(
        "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.4g},{:.2f}\n", each.truth.name,
        to_string(each.truth.family), to_string(each.truth.kind), csv_field(places), laws, sizes,
        each.truth.detectable() ? 1 : 0, each.answer.verdict, csv_field(named_place), named_law,
        each.outcome, each.class_size, each.answer.effects.size(), each.parameters,
        each.within_three, each.undetermined, each.answer.validation, each.answer.seconds);
  }
  return text;
}

constexpr std::string_view kRatesHeader = "set,rate,target,hits,of,value,low,high\n";

std::string rates_table(const Score& score) {
  std::string text{kRatesHeader};
  for (const NamedRate& each : rates_of(score)) {
    const Interval interval = wilson_interval(each.rate);
    text += fmt::format("{},{},{},{},{},{:.4f},{:.4f},{:.4f}\n", score.origin.set, each.name,
                        csv_field(each.target), each.rate.hits, each.rate.of, each.rate.value(),
                        interval.low, interval.high);
  }
  return text;
}

// The rows of a table of rates that are of other sets; none where it has other columns.
std::string rows_of_other_sets(const fs::path& file, const std::string& set) {
  std::ifstream stream(file);
  std::string line, text;
  if (!std::getline(stream, line) || line + "\n" != kRatesHeader) return text;
  while (std::getline(stream, line)) {
    if (!line.starts_with(set + ",")) text += line + "\n";
  }
  return text;
}

// The operating curve: what would be refused if answers had to predict recordings kept out to an
// error, outside the catalogue (to be refused) and of single effects that are named (to be kept).
std::string refusal_table(const Score& score) {
  constexpr std::array<double, 8> kLimits{0.01, 0.02, 0.05, 0.1, 0.15, 0.3, 0.6, 1e9};
  std::string text = "largest_error,outside_refused,outside_of,named_refused,named_of\n";
  for (const double limit : kLimits) {
    const auto refused = [limit](const ScoredCase& each) {
      const Answer& answer = each.answer;
      return answer.verdict == "unknown" || !answer.predicts || !(answer.error_kept_out <= limit);
    };
    const Rate outside = rate_of(
        score.cases,
        [](const ScoredCase& each) {
          return is_kind(each, CaseKind::kOutside) && each.answer.given;
        },
        refused);
    const Rate inside = rate_of(
        score.cases,
        [](const ScoredCase& each) {
          return is_detectable_one(each) && each.answer.given && each.class_size > 0;
        },
        refused);
    text +=
        fmt::format("{:g},{},{},{},{}\n", limit, outside.hits, outside.of, inside.hits, inside.of);
  }
  return text;
}

struct Named {
  std::size_t wrong_place = 0, right_place = 0;
};
// By the true law, then by the law named first or the verdict; cases with one detectable effect,
// and those outside the catalogue.
using Confusion = std::map<std::string, std::map<std::string, Named>>;

Confusion confusion_of(const Score& score) {
  Confusion confusion;
  for (const ScoredCase& each : score.cases) {
    const bool is_outside = is_kind(each, CaseKind::kOutside);
    if (!is_detectable_one(each) && !is_outside) continue;
    std::string named = each.answer.given ? each.answer.verdict : "no_answer";
    if ((named == "explained" || named == "ambiguous") && !each.answer.effects.empty()) {
      const AnsweredLaw& law = each.answer.effects[0][0];
      const bool at_signal = law.place.starts_with("actuator ") || law.place.starts_with("sensor ");
      named = at_signal ? law.law + " (signal)" : law.law;
    }
    Named& cell = confusion[law_label(each.truth.effects[0])][named];
    ++(each.place_right ? cell.right_place : cell.wrong_place);
  }
  return confusion;
}

std::string confusion_table(const Score& score) {
  std::string text = "true_law,named,right_place,wrong_place\n";
  for (const auto& [law, answers] : confusion_of(score)) {
    for (const auto& [named, cell] : answers) {
      text += fmt::format("{},{},{},{}\n", law, named, cell.right_place, cell.wrong_place);
    }
  }
  return text;
}

// A line a true law: "coulomb: coulomb 11, dahl 1 (2)", the second twice elsewhere, besides.
std::string confusion_text(const Score& score) {
  std::string text = "\ntrue law: laws named first, at the true place (elsewhere)\n";
  for (const auto& [law, answers] : confusion_of(score)) {
    text += fmt::format("  {:<26}", law + ":");
    for (const auto& [named, cell] : answers) {
      text += fmt::format(" {} {}", named, cell.right_place);
      if (cell.wrong_place > 0) text += fmt::format(" ({})", cell.wrong_place);
      text += ",";
    }
    text.back() = '\n';
  }
  return text;
}

// What becomes of each law once it is taken out of the catalogue.
std::string left_out_table(const Score& score) {
  struct Answers {
    std::size_t cases = 0, named = 0, rerun = 0;
    std::map<std::string, std::size_t> verdicts;
    std::size_t at_noise_floor = 0;
  };
  std::map<std::string, Answers> laws;
  for (const ScoredCase& each : score.cases) {
    if (!is_detectable_one(each)) continue;
    Answers& law = laws[law_label(each.truth.effects[0])];
    ++law.cases;
    if (is_named_first(each)) ++law.named;
  }
  for (const ScoredCase& each : score.left_out) {
    Answers& law = laws[law_label(each.truth.effects[0])];
    ++law.rerun;
    ++law.verdicts[each.answer.given ? each.answer.verdict : "no_answer"];
    const bool names_one = each.answer.verdict == "explained" || each.answer.verdict == "ambiguous";
    if (names_one && each.answer.validation < kNoiseFloor) ++law.at_noise_floor;
  }
  std::string text =
      "law,cases,named_first,rerun,no_answer,none,unknown,ambiguous,explained,nearest_law_at_noise_"
      "floor\n";
  for (auto& [law, answers] : laws) {
    text += fmt::format("{},{},{},{}", law, answers.cases, answers.named, answers.rerun);
    for (const char* verdict : {"no_answer", "none", "unknown", "ambiguous", "explained"}) {
      text += fmt::format(",{}", answers.verdicts[verdict]);
    }
    text += fmt::format(",{}\n", answers.at_noise_floor);
  }
  return text;
}

// How many laws and places the answer leaves where one of them is the truth.
std::string classes_table(const Score& score) {
  std::string text = "class_size,cases\n";
  for (const auto& [size, count] : class_sizes_of(score))
    text += fmt::format("{},{}\n", size, count);
  return text;
}

std::string sizes_table(const Score& score) {
  constexpr std::array<double, 6> kEdges{1.0, 2.0, 4.0, 8.0, 14.0, 21.0};
  std::string text =
      "from,to,cases,detected,detected_low,detected_high,named,named_low,named_high\n";
  for (std::size_t b = 0; b + 1 < kEdges.size(); ++b) {
    const auto in_bin = [&](const ScoredCase& each) {
      if (!is_detectable_one(each)) return false;
      const double size = each.truth.effects[0].relative_size();
      return size >= kEdges[b] - 1e-9 && size < kEdges[b + 1] - 1e-9;
    };
    const Rate detected = rate_of(score.cases, in_bin, is_detected);
    const Rate named = rate_of(score.cases, in_bin, is_named);
    const Interval d = wilson_interval(detected), n = wilson_interval(named);
    text += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n", kEdges[b],
                        kEdges[b + 1], detected.of, detected.value(), d.low, d.high, named.value(),
                        n.low, n.high);
  }
  return text;
}

// Laws that are listed, whatever the verdict.
std::vector<NamedRate> any_motion_rates(const std::vector<ScoredCase>& cases) {
  const auto is_null = [](const ScoredCase& each) {
    return is_kind(each, CaseKind::kNothing) && each.answer.given;
  };
  const auto is_two = [](const ScoredCase& each) {
    return is_kind(each, CaseKind::kTwoEffects) && each.truth.detectable();
  };
  const auto lists_laws = [](const ScoredCase& each) { return !each.answer.effects.empty(); };
  return {{"false_laws", "-", rate_of(cases, is_null, lists_laws)},
          {"detectable_found", "-", rate_of(cases, is_detectable_one, is_found)},
          {"two_effects_found", "-", rate_of(cases, is_two, is_found)}};
}

// Cases whose law is left out of the catalogue.
template <typename AtFloor>
std::vector<NamedRate> left_out_rates(const std::vector<ScoredCase>& left_out,
                                      const AtFloor& at_floor) {
  const auto all = [](const ScoredCase&) { return true; };
  const auto is_unknown = [](const ScoredCase& each) { return each.outcome == "unknown"; };
  const auto is_given = [](const ScoredCase& each) { return each.answer.given; };
  const auto is_honest = [&](const ScoredCase& each) {
    const bool says_unknown = each.answer.verdict == "unknown";
    const bool names_one = each.answer.verdict != "none" && !says_unknown;
    return says_unknown || (names_one && (at_floor(each) || !each.answer.predicts));
  };
  return {{"left_out_unknown", "-", rate_of(left_out, all, is_unknown)},
          {"left_out_honest", "100 %", rate_of(left_out, is_given, is_honest)}};
}

}  // namespace

std::vector<NamedRate> rates_of(const Score& score) {
  const auto& cases = score.cases;
  // Without an answer there is neither an alarm nor the absence of one.
  const auto is_null = [](const ScoredCase& each) {
    return is_kind(each, CaseKind::kNothing) && each.answer.given;
  };
  const auto is_two = [](const ScoredCase& each) {
    return is_kind(each, CaseKind::kTwoEffects) && each.truth.detectable();
  };
  const auto is_outside = [](const ScoredCase& each) {
    return is_kind(each, CaseKind::kOutside) && each.truth.detectable();
  };
  const auto outcome_is = [](const char* outcome) {
    return [outcome](const ScoredCase& each) { return each.outcome == outcome; };
  };
  const bool in_any_motion = score.origin.set == kAnyMotionSet;
  const auto at_floor = [&](const ScoredCase& each) {
    const Answer& answer = each.answer;
    const bool is_close = in_any_motion && answer.predicts && answer.error_kept_out < kLargestError;
    return is_close || answer.validation < kNoiseFloor;
  };
  std::vector<NamedRate> rates{
      {"answered", "100 %",
       rate_of(
           cases, [](const ScoredCase&) { return true; },
           [](const ScoredCase& each) { return each.answer.given; })},
      {"false_alarms", "5 % within its interval", rate_of(cases, is_null, is_detected)},
      {"detectable_detected", "90 % at the smallest size",
       rate_of(cases, is_detectable_one, is_detected)},
      {"detectable_named", in_any_motion ? "90 %" : "95 %",
       rate_of(cases, is_detectable_one, is_named)},
      {"detectable_named_as_systems", "-", rate_of(cases, is_detectable_one, is_named_as_system)},
      {"detectable_right_alone", "-", rate_of(cases, is_detectable_one, outcome_is("right"))},
      {"wrong_and_confident", "at most 2 %",
       rate_of(cases, is_detectable_one, outcome_is("wrong_confident"))},
      {"parameters_within_3", "95 %", parameter_rate(cases)},
      {"parameters_determined", "-", determined_rate(cases)},
      {"two_effects_both", in_any_motion ? "75 %" : "80 %",
       rate_of(cases, is_two, outcome_is("both"))},
      {"two_effects_both_as_systems", "-", rate_of(cases, is_two, is_named_as_system)},
      {"outside_unknown", "90 %",
       rate_of(cases, is_outside,
               [](const ScoredCase& each) {
                 return each.outcome == "unknown" || each.outcome == "nearest_law_fails";
               })},
      {"explained_at_noise_floor", "100 %", rate_of(cases, is_explained, at_floor)},
      {"hidden_no_false_law", "-",
       rate_of(cases, is_hidden, [](const ScoredCase& each) { return !is_detected(each); })},
  };
  if (in_any_motion) std::ranges::move(any_motion_rates(cases), std::back_inserter(rates));
  if (!score.left_out.empty()) {
    std::ranges::move(left_out_rates(score.left_out, at_floor), std::back_inserter(rates));
  }
  return rates;
}

Json score_json(const Score& score) {
  Json rates = Json::object();
  for (const NamedRate& each : rates_of(score)) rates[each.name] = rate_json(each.rate);
  Json sizes = Json::object();
  for (const auto& [size, count] : class_sizes_of(score)) sizes[std::to_string(size)] = count;
  return {{"format", "graybox-challenge-score/1"},
          {"set", score.origin.set},
          {"cases", score.cases.size()},
          {"not_run", score.not_run},
          {"seed", score.origin.seed},
          {"commit", score.origin.commit},
          {"rates", rates},
          {"outcomes", outcomes_of(score)},
          {"class_sizes", sizes}};
}

std::string score_text(const Score& score) {
  std::string text = fmt::format("{} cases of the set {}, seed {}\n\n", score.cases.size(),
                                 score.origin.set, score.origin.seed);
  if (score.not_run > 0) {
    text += fmt::format(
        "{} of them have not been run to their end, and count as no answer: "
        "`graybox challenge run` goes on where it was\n\n",
        score.not_run);
  }
  for (const NamedRate& each : rates_of(score)) {
    text += fmt::format("{:<28} {:<42} target {}\n", each.name, percent(each.rate), each.target);
  }
  text += "\noutcomes (rates with Wilson's 95 % intervals above)\n";
  for (const auto& [kind, outcomes] : outcomes_of(score)) {
    text += fmt::format("  {:<18}", kind);
    for (const auto& [outcome, count] : outcomes) text += fmt::format(" {} {},", outcome, count);
    text.back() = '\n';
  }
  text += "\nsize of the class that holds the truth, cases with one detectable effect:";
  for (const auto& [size, count] : class_sizes_of(score)) {
    text += fmt::format("  {}: {}", size, count);
  }
  return text + "\n" + confusion_text(score);
}

void write_score_tables(const Score& score, const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw InputError(fmt::format("{}: can't be made: {}", folder.string(), error.message()));
  }
  const bool in_any_motion = score.origin.set == kAnyMotionSet;
  const std::string prefix = in_any_motion ? "challenge_any_motion_" : "challenge_";
  FilesTogether files;
  const auto write = [&](const char* name, const std::string& text) {
    write_text_file((folder / (prefix + name + ".csv")).string(), text);
  };
  write("cases", cases_table(score));
  write("confusion", confusion_table(score));
  write("sizes", sizes_table(score));
  write("classes", classes_table(score));
  if (in_any_motion) write("refusal", refusal_table(score));
  if (!score.left_out.empty()) write("left_out", left_out_table(score));
  const fs::path rates = folder / "challenge_rates.csv";
  write_text_file(rates.string(), rates_table(score) + rows_of_other_sets(rates, score.origin.set));
  files.commit();
}

namespace {

// The columns that every scored run has had.
bool is_in_history(const NamedRate& rate) {
  return !rate.name.starts_with("left_out") && !rate.name.ends_with("_as_systems") &&
         !rate.name.ends_with("_found") && rate.name != "false_laws" &&
         rate.name != "parameters_determined";
}

}  // namespace

void append_history(const Score& score, const fs::path& file) {
  if (score.origin.commit.empty() || !score.origin.family.empty() ||
      score.origin.seed != seed_of_commit(score.origin.commit)) {
    throw InputError(
        "challenge score --history: only challenges made with --seed commit and of all families "
        "enter the history");
  }
  if (score.not_run > 0) {
    throw InputError(fmt::format(
        "challenge score --history: {} of {} cases have not been run to their end; let `graybox "
        "challenge run` end first",
        score.not_run, score.cases.size()));
  }
  std::string text;
  if (std::ifstream stream(file, std::ios::binary); stream) {
    std::ostringstream old;
    old << stream.rdbuf();
    text = old.str();
  }
  const auto rates = rates_of(score);
  std::string header = "date,set,commit,seed,cases";
  for (const NamedRate& each : rates) {
    if (is_in_history(each)) header += fmt::format(",{0},{0}_of", each.name);
  }
  header += ",truth_sha256,confined\n";
  if (text.empty()) text = header;
  if (!text.starts_with(header)) {
    throw InputError(
        fmt::format("{}: has other columns than a history of challenges; its first line must be {}",
                    file.string(), header.substr(0, header.size() - 1)));
  }
  text += fmt::format("{},{},{},{},{}", utc_now(), score.origin.set, score.origin.commit,
                      score.origin.seed, score.cases.size());
  for (const NamedRate& each : rates) {
    if (!is_in_history(each)) continue;
    text += fmt::format(",{},{}", each.rate.hits, each.rate.of);
  }
  const auto confined = std::ranges::count_if(
      score.cases, [](const ScoredCase& each) { return each.answer.confined; });
  text += fmt::format(",{},{}\n", score.truth_sha256, confined);
  write_text_file(file.string(), text);
}

}  // namespace graybox::bench
