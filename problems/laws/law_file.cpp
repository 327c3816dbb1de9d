#include "problems/laws/law_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>

#include "problems/base/random.hpp"
#include "problems/laws/dual_number.hpp"
#include "problems/laws/expression.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

// z, v, states, parameters: the order of every formula's names.
constexpr std::size_t kMaxNames = 2 + kMaxLawStates + kMaxLawParameters;

struct Formulas {
  Expression force;
  std::vector<Expression> state_rates;
};

class ExpressionLaw final : public Law {
  using Dual = DualNumber<static_cast<int>(kMaxNames)>;

 public:
  ExpressionLaw(std::shared_ptr<const Formulas> formulas, std::span<const double> parameters)
      : formulas_(std::move(formulas)), parameters_(parameters.begin(), parameters.end()) {}

  [[nodiscard]] std::size_t state_count() const override { return formulas_->state_rates.size(); }

  [[nodiscard]] double force(double z, double rate, std::span<const double> state) const override {
    const auto values = arguments<double>(z, rate, state);
    return formulas_->force.evaluate<double>(values);
  }

  void state_rate(double z, double rate, std::span<const double> state,
                  std::span<double> change) const override {
    const auto values = arguments<double>(z, rate, state);
    for (std::size_t i = 0; i < change.size(); ++i) {
      change[i] = formulas_->state_rates[i].evaluate<double>(values);
    }
  }

  [[nodiscard]] StateRate state_rate_and_slope(double z, double rate, double state) const override {
    if (state_count() != 1) return {};
    using Slope = DualNumber<1>;
    auto values = arguments<Slope>(z, rate, {&state, 1});
    values[2].v[0] = 1.0;
    const Slope change = formulas_->state_rates[0].evaluate<Slope>(values);
    return {change.a, change.v[0]};
  }

  void differentiate(double z, double rate, std::span<const double> state,
                     LawDerivatives& result) const override {
    auto values = arguments<Dual>(z, rate, state);
    for (std::size_t i = 0; i < 2 + state_count() + parameters_.size(); ++i) {
      values[i].v[static_cast<Eigen::Index>(i)] = 1.0;
    }
    write(formulas_->force.evaluate<Dual>(values), result.force);
    for (std::size_t i = 0; i < state_count(); ++i) {
      write(formulas_->state_rates[i].evaluate<Dual>(values), result.state_rate[i]);
    }
  }

 private:
  template <typename T>
  [[nodiscard]] std::array<T, kMaxNames> arguments(double z, double rate,
                                                   std::span<const double> state) const {
    std::array<T, kMaxNames> values;
    values.fill(T(0.0));
    values[0] = T(z);
    values[1] = T(rate);
    for (std::size_t i = 0; i < state_count(); ++i) values[2 + i] = T(state[i]);
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      values[2 + state_count() + i] = T(parameters_[i]);
    }
    return values;
  }

  void write(const Dual& from, LawDerivative& to) const {
    to.value = from.a;
    to.by_deflection = from.v[0];
    to.by_rate = from.v[1];
    const std::size_t states = state_count();
    for (std::size_t i = 0; i < states; ++i) {
      to.by_state[i] = from.v[static_cast<Eigen::Index>(2 + i)];
    }
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      to.by_parameter[i] = from.v[static_cast<Eigen::Index>(2 + states + i)];
    }
  }

  std::shared_ptr<const Formulas> formulas_;
  std::vector<double> parameters_;
};

Expression compile(const YamlField& field, const std::vector<std::string>& names) {
  try {
    return Expression(field.text(), names);
  } catch (const ExpressionError& error) {
    field.fail(error.what());
  }
}

bool is_name(const std::string& text) {
  const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  const auto is_inner = [&](char c) {
    return is_letter(c) || c == '_' || std::isdigit(static_cast<unsigned char>(c)) != 0;
  };
  return !text.empty() && is_letter(text.front()) && std::ranges::all_of(text, is_inner);
}

ParameterRange read_range(const YamlField& field) {
  const std::string word = field.choice({"any", "positive", "non_negative", "unit_interval"});
  if (word == "positive") return ParameterRange::kPositive;
  if (word == "non_negative") return ParameterRange::kNonNegative;
  return word == "any" ? ParameterRange::kAny : ParameterRange::kUnitInterval;
}

ParameterTrials read_trials(const YamlField& field) {
  ParameterTrials trials;
  if (field.is_list()) {
    for (const YamlField& item : field.items()) trials.values.push_back(item.number());
    if (trials.values.empty()) field.fail("needs a number at least");
  } else if (field.choice({"deflection", "rate"}) == "deflection") {
    trials.deflection_shares = {0.05, 0.2, 0.5, 0.8, 0.95};
  } else {
    trials.rate_shares = {0.03, 0.15, 0.4, 0.7};
  }
  return trials;
}

std::vector<LawParameter> read_law_parameters(const YamlField& field,
                                              std::vector<std::string>& names) {
  std::vector<LawParameter> parameters;
  for (const auto& [name, entry] : field.entries()) {
    entry.allow_keys({"unit", "range", "tried"});
    if (!is_name(name)) entry.fail("the name must be letters, digits and _, a letter first");
    if (std::ranges::find(names, name) != names.end()) entry.fail("has a name that is taken");
    LawParameter& parameter = parameters.emplace_back();
    parameter.name = name;
    parameter.unit = entry.at("unit").text();
    if (entry.has("range")) parameter.range = read_range(entry.at("range"));
    if (entry.has("tried")) parameter.trials = read_trials(entry.at("tried"));
    names.push_back(name);
  }
  if (parameters.empty()) field.fail("a law needs a parameter at least");
  if (parameters.size() > kMaxLawParameters) {
    field.fail(fmt::format("a law may have {} parameters at most", kMaxLawParameters));
  }
  return parameters;
}

// A point of the formula's arguments, all of them positive but z and v.
std::array<double, kMaxNames> random_point(Random& random) {
  std::array<double, kMaxNames> point{};
  for (double& value : point) value = 0.1 + 1.4 * random.uniform();
  if (random.uniform() < 0.5) point[0] = -point[0];
  if (random.uniform() < 0.5) point[1] = -point[1];
  return point;
}

// Whether f(a + b) + f(0) = f(a) + f(b), a and b two values of the arguments in `chosen`, and,
// where `homogeneous`, f(0) = 0: at random points, where a formula that breaks the rule does so as
// good as always.
bool adds_up(const Expression& force, const std::vector<std::size_t>& chosen, bool homogeneous) {
  constexpr int kPoints = 12;
  constexpr double kTolerance = 1e-9;
  Random random(20240917);
  for (int trial = 0; trial < kPoints; ++trial) {
    const auto one = random_point(random);
    auto other = one, sum = one, none = one;
    for (const std::size_t i : chosen) {
      other[i] = random.uniform(-1.7, 1.3);
      sum[i] = one[i] + other[i];
      none[i] = 0.0;
    }
    const double f_one = force.evaluate<double>(one), f_other = force.evaluate<double>(other);
    const double f_none = force.evaluate<double>(none);
    const double scale = std::abs(f_one) + std::abs(f_other) + std::abs(f_none) + 1e-300;
    const double error = std::abs(force.evaluate<double>(sum) + f_none - f_one - f_other);
    if (!(error <= kTolerance * scale)) return false;
    if (homogeneous && !(std::abs(f_none) <= kTolerance * scale)) return false;
  }
  return true;
}

void mark_linear(const Formulas& formulas, std::vector<LawParameter>& parameters) {
  const std::size_t first = 2 + formulas.state_rates.size();
  std::vector<std::size_t> chosen;
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    // What shapes the motion of a state is no amplitude, however it stands in the force.
    const auto uses_it = [&](const Expression& rate) { return rate.uses(first + p); };
    if (std::ranges::any_of(formulas.state_rates, uses_it)) continue;
    if (adds_up(formulas.force, {first + p}, false)) chosen.push_back(first + p);
  }
  // Of a product of two the first is the amplitude.
  while (!chosen.empty() && !adds_up(formulas.force, chosen, true)) chosen.pop_back();
  for (const std::size_t index : chosen) parameters[index - first].is_linear = true;
}

void check_trials(const YamlField& field, const std::vector<LawParameter>& parameters) {
  const auto has_trials = [](const LawParameter& parameter) {
    const ParameterTrials& trials = parameter.trials;
    return !trials.values.empty() || !trials.deflection_shares.empty() ||
           !trials.rate_shares.empty();
  };
  for (const LawParameter& parameter : parameters) {
    if (parameter.is_linear || has_trials(parameter)) continue;
    field.at(parameter.name)
        .fail(
            "the force is not linear in it: say where a search starts, tried: deflection, rate "
            "or a list of numbers");
  }
  if (std::ranges::none_of(parameters, &LawParameter::is_linear)) {
    field.fail(
        "the force must be linear in one parameter at least (its size), and 0 where that is");
  }
}

LawEntry read_law_entry(const YamlField& field) {
  field.allow_keys({"name", "description", "at", "states", "force", "parameters"});
  LawEntry entry;
  entry.name = field.at("name").text();
  if (!is_name(entry.name)) {
    field.at("name").fail("must be letters, digits and _, a letter first");
  }
  entry.description = field.at("description").text();
  const bool at_signal =
      field.has("at") && field.at("at").choice({"element", "signal"}) == "signal";
  entry.use = at_signal ? LawUse::kSignal : LawUse::kForce;
  std::vector<std::string> names{"z", "v"};
  if (field.has("states")) {
    for (const auto& [state, rate] : field.at("states").entries()) {
      if (!is_name(state) || std::ranges::find(names, state) != names.end()) {
        rate.fail("the name must be new, of letters, digits and _, a letter first");
      }
      names.push_back(state);
    }
    if (names.size() - 2 > kMaxLawStates) {
      field.at("states").fail(fmt::format("a law may have {} states at most", kMaxLawStates));
    }
  }
  entry.parameters = read_law_parameters(field.at("parameters"), names);
  auto formulas = std::make_shared<Formulas>(Formulas{compile(field.at("force"), names), {}});
  if (field.has("states")) {
    for (const auto& [state, rate] : field.at("states").entries()) {
      formulas->state_rates.push_back(compile(rate, names));
    }
  }
  mark_linear(*formulas, entry.parameters);
  check_trials(field.at("parameters"), entry.parameters);
  entry.make = [formulas](std::span<const double> parameters) -> std::shared_ptr<const Law> {
    return std::make_shared<const ExpressionLaw>(formulas, parameters);
  };
  entry.definition = field.dump();
  return entry;
}

YamlField laws_of(const std::filesystem::path& file) {
  const YamlField root = YamlField::load(file);
  root.allow_keys({"format", "laws"});
  (void)root.at("format").choice({"graybox-laws/1"});
  return root.at("laws");
}

std::vector<LawEntry> read_laws(const YamlField& list) {
  std::vector<LawEntry> laws;
  for (const YamlField& item : list.items()) laws.push_back(read_law_entry(item));
  return laws;
}

}  // namespace

std::vector<std::string> add_laws(const YamlField& list) {
  std::vector<std::string> names;
  for (const YamlField& item : list.items()) {
    LawEntry entry = read_law_entry(item);
    names.push_back(entry.name);
    try {
      add_law(std::move(entry));
    } catch (const std::invalid_argument& error) {
      item.at("name").fail(error.what());
    }
  }
  return names;
}

std::vector<std::string> add_law_file(const std::filesystem::path& file) {
  return add_laws(laws_of(file));
}

std::vector<LawEntry> read_law_file(const std::filesystem::path& file) {
  return read_laws(laws_of(file));
}

}  // namespace graybox
