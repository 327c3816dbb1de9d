#include "diagnosis/export/law_source.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "problems/laws/expression.hpp"

namespace graybox {
namespace {

struct Source {
  std::string_view law, body;
};

// Of the catalogue; the formulas are those of problems/laws/*_laws.cpp.
constexpr Source kSources[] = {
    {.law = "viscous", .body = "return damping * v;"},
    {.law = "asymmetric_viscous",
     .body = "return (v > 0.0 ? forward_damping : backward_damping) * v;"},
    {.law = "coulomb", .body = "return level * tanh(v / transition_velocity);"},
    {.law = "asymmetric_coulomb",
     .body = "return (v > 0.0 ? forward_level : backward_level) * tanh(v / transition_velocity);"},
    {.law = "stribeck",
     .body = "const double ratio = v / stribeck_velocity;\n"
             "const double now = level + (static_level - level) * exp(-ratio * ratio);\n"
             "return now * tanh(v / transition_velocity);"},
    {.law = "sublinear_friction",
     .body = "const double speed = v * v + transition_velocity * transition_velocity;\n"
             "const double square = speed / (reference_velocity * reference_velocity);\n"
             "return level * (v / reference_velocity) * pow(square, 0.5 * (exponent - 1.0));"},
    {.law = "load_dependent_friction",
     .body = "return (level + coefficient * fabs(z)) * tanh(v / transition_velocity);"},
    {.law = "driven_viscous",
     .body = "return (fabs(z) > threshold ? driven_damping : undriven_damping) * v;"},
    {.law = "quadratic_drag", .body = "return coefficient * fabs(v) * v;"},
    {.law = "deflection_damping", .body = "return coefficient * z * z * v;"},
    {.law = "stiffness", .body = "return stiffness * z;"},
    {.law = "cubic_spring", .body = "return stiffness * z * z * z;"},
    {.law = "backlash", .body = "return -stiffness * clip(z, half_gap);"},
    {.law = "dead_zone", .body = "return stiffness * (z - clip(z, clearance));"},
    {.law = "ripple",
     .body = "return amplitude * sin(2.0 * 3.141592653589793 * z / period + phase);"},
    {.law = "balancer",
     .body = "const double angle = z - anchor_angle;\n"
             "const double square = anchor_distance * anchor_distance +\n"
             "    lever_length * lever_length -\n"
             "    2.0 * anchor_distance * lever_length * cos(angle);\n"
             "const double length = square > 0.0 ? sqrt(square) : 0.0;\n"
             "const double slope = square > 0.0\n"
             "    ? anchor_distance * lever_length * sin(angle) / length : 0.0;\n"
             "return stiffness * (length - free_length) * slope;"},
    {.law = "gas_balancer",
     .body = "const double angle = z - anchor_angle;\n"
             "const double square = anchor_distance * anchor_distance +\n"
             "    lever_length * lever_length -\n"
             "    2.0 * anchor_distance * lever_length * cos(angle);\n"
             "const double length = square > 0.0 ? sqrt(square) : 0.0;\n"
             "const double slope = square > 0.0\n"
             "    ? anchor_distance * lever_length * sin(angle) / length : 0.0;\n"
             "const double stroke = length - fabs(anchor_distance - lever_length);\n"
             "const double column = fmax(1.0 - stroke / gas_length, 1e-3);\n"
             "return force * pow(column, -exponent) * slope;"},
    {.law = "gravity", .body = "return sine * sin(z) + cosine * cos(z);"},
    {.law = "offset", .body = "return value;"},
};

constexpr std::string_view kTaken[] = {
    "auto",     "break",  "case",   "char",     "const",    "continue", "default",  "do",
    "double",   "else",   "enum",   "extern",   "float",    "for",      "goto",     "if",
    "inline",   "int",    "long",   "register", "restrict", "return",   "short",    "signed",
    "sizeof",   "static", "struct", "switch",   "typedef",  "union",    "unsigned", "void",
    "volatile", "while",  "abs",    "fabs",     "pow",      "sqrt",     "exp",      "log",
    "sin",      "cos",    "tan",    "asin",     "acos",     "atan",     "sinh",     "cosh",
    "tanh",     "fmin",   "fmax",   "clip",     "sign_of",  "z",        "v",        "main"};

// A law that a file has defined: its formula, of its parameters by their C names.
std::optional<std::string> formula_source(const LawEntry& law) {
  const YAML::Node definition = YAML::Load(law.definition);
  if (definition["states"] && definition["states"].size() > 0) return {};
  std::vector<std::string> names{"z", "v"}, c_names{"z", "v"};
  for (const LawParameter& parameter : law.parameters) {
    names.push_back(parameter.name);
    c_names.push_back(c_name(parameter.name));
  }
  const Expression force(definition["force"].as<std::string>(), names);
  return "return " + force.c_text(c_names) + ";";
}

}  // namespace

std::optional<std::string> law_source(const LawEntry& law) {
  if (law.use != LawUse::kForce) return {};
  if (!law.definition.empty()) return formula_source(law);
  const auto* found = std::ranges::find(kSources, law.name, &Source::law);
  if (found == std::end(kSources)) return {};
  return std::string(found->body);
}

std::string c_name(const std::string& name) {
  return std::ranges::find(kTaken, name) == std::end(kTaken) ? name : name + "_";
}

std::string c_number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

}  // namespace graybox
