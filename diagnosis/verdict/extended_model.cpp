#include "diagnosis/verdict/extended_model.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <set>
#include <string_view>

#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/error.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

// As many digits as a double needs to be read back.
YAML::Node exact_number(double value) {
  YAML::Node node(fmt::format("{}", value));
  return node;
}

YAML::Node parameter_node(const LawParameterEstimate& estimate) {
  YAML::Node entry;
  entry["value"] = exact_number(estimate.value);
  entry["unit"] = estimate.unit;
  entry.SetStyle(YAML::EmitterStyle::Flow);
  return entry;
}

YAML::Node element_node(const FittedLaw& law, std::span<const Hypothesis> hypotheses,
                        std::set<std::string>& names) {
  const Hypothesis& hypothesis = hypotheses[law.hypothesis];
  std::string name = "found " + hypothesis_words(hypothesis);
  for (int copy = 2; !names.insert(name).second; ++copy) {
    name = fmt::format("found {} ({})", hypothesis_words(hypothesis), copy);
  }
  YAML::Node element;
  element["name"] = name;
  element["location"] = YAML::Load(hypothesis.location);
  element["location"].SetStyle(YAML::EmitterStyle::Flow);
  element["law"] = hypothesis.law;
  YAML::Node parameters(YAML::NodeType::Map);
  for (const LawParameterEstimate& estimate : law.parameters) {
    parameters[estimate.name] = parameter_node(estimate);
  }
  element["parameters"] = parameters;
  return element;
}

// The number of this node, which may be {value, ...}.
YAML::Node number_of(YAML::Node node) { return node.IsMap() ? node["value"] : node; }

YAML::Node robot_spring(YAML::Node root, std::string_view joint, const std::string& spring) {
  if (!root["joints"] || !root["joints"].IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  YAML::Node fields = root["joints"][std::string(joint)];
  if (!fields) return YAML::Node(YAML::NodeType::Undefined);
  if (spring == "gearbox") return fields["gearbox"]["stiffness"];
  for (YAML::Node bearing : fields["bearings"]) {
    if (bearing["name"].as<std::string>() == spring) return bearing["stiffness"];
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node element_parameters(YAML::Node root, const std::string& owner) {
  for (YAML::Node element : root["elements"]) {
    if (element["name"].as<std::string>() == owner) return element["parameters"];
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

// A robot's springs are estimated relative to what the file says, all others as they are.
void set_parameter(YAML::Node root, const LawParameterEstimate& estimate,
                   const std::filesystem::path& model) {
  const std::size_t dot = estimate.name.rfind('.');
  const std::string owner = estimate.name.substr(0, dot);
  const std::string parameter = dot == std::string::npos ? "" : estimate.name.substr(dot + 1);
  if (YAML::Node spring = robot_spring(root, owner, parameter); spring.IsDefined()) {
    YAML::Node number = number_of(spring);
    number = fmt::format("{}", estimate.value * number.as<double>());
    return;
  }
  YAML::Node parameters = element_parameters(root, owner);
  const bool is_mass = parameter == "inertia" || parameter == "mass";
  if (parameters.IsDefined() && parameters[parameter]) {
    YAML::Node number = number_of(parameters[parameter]);
    number = fmt::format("{}", estimate.value);
  } else if (is_mass && root["masses"] && root["masses"][owner]) {
    YAML::Node number = number_of(root["masses"][owner]);
    number = fmt::format("{}", estimate.value);
  } else if (parameters.IsDefined()) {  // files may leave it out
    parameters[parameter] = parameter_node(estimate);
  } else {
    throw InputError(fmt::format("{}: has no parameter '{}' to take the estimate of",
                                 model.string(), estimate.name));
  }
}

// "friction.damping" of an element of the file.
bool is_of_element(const YAML::Node& root, const std::string& name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos) return false;
  const YAML::Node parameters = element_parameters(root, name.substr(0, dot));
  return parameters.IsDefined() && parameters[name.substr(dot + 1)];
}

constexpr const char* kBaseParametersComment =
    "# Bodies are known by their base parameters alone: base_parameters has the estimates, named "
    "as\n"
    "# `graybox fit` names them. What is unknown is estimated anew by every fit.\n";

YAML::Node base_parameter_node(const LawParameterEstimate& estimate) {
  YAML::Node entry;
  entry["name"] = estimate.name;
  entry["value"] = exact_number(estimate.value);
  entry["standard_error"] = exact_number(estimate.standard_error);
  entry["unit"] = estimate.unit;
  entry.SetStyle(YAML::EmitterStyle::Flow);
  return entry;
}

void redirect(YAML::Node root, const char* key, const std::filesystem::path& model,
              const std::filesystem::path& target) {
  if (!root[key]) return;
  const std::filesystem::path named = root[key].as<std::string>();
  if (named.is_absolute() || named.string().starts_with("${")) return;
  const auto folder = [](const std::filesystem::path& file) {
    return std::filesystem::absolute(file).parent_path();
  };
  const std::filesystem::path relative =
      std::filesystem::relative(folder(model) / named, folder(target));
  root[key] = (relative.empty() ? folder(model) / named : relative).generic_string();
}

std::set<std::string> element_names(const YAML::Node& root) {
  std::set<std::string> names;
  for (const YAML::Node& element : root["elements"]) {
    if (element["name"]) names.insert(element["name"].as<std::string>());
  }
  return names;
}

// The definitions of the laws that users have added, where the file does not hold them yet.
void add_definitions(YAML::Node root, const ExtendedFit& fit,
                     std::span<const Hypothesis> hypotheses) {
  std::set<std::string> present;
  for (const YAML::Node& law : root["laws"]) present.insert(law["name"].as<std::string>());
  for (const FittedLaw& law : fit.laws) {
    const std::string& name = hypotheses[law.hypothesis].law;
    for (const LawEntry& entry : law_catalogue()) {
      if (entry.name != name || entry.definition.empty() || !present.insert(name).second) continue;
      root["laws"].push_back(YAML::Load(entry.definition));
    }
  }
}

// The model's parameters with these values, and paths that lead to where they did.
void take_estimates(YAML::Node root, std::span<const LawParameterEstimate> estimates,
                    const std::filesystem::path& model, const std::filesystem::path& target) {
  const bool is_rigid = root["format"].as<std::string>() == "graybox-rigid-robot/1";
  root.remove("base_parameters");  // of an earlier fit
  for (const LawParameterEstimate& estimate : estimates) {
    if (!is_rigid || is_of_element(root, estimate.name)) {
      set_parameter(root, estimate, model);
    } else {
      root["base_parameters"].push_back(base_parameter_node(estimate));
    }
  }
  redirect(root, "urdf", model, target);
}

// The laws and elements of a physics file behind those of the model.
void add_physics(YAML::Node root, const std::filesystem::path& file) {
  const YAML::Node physics = YAML::LoadFile(file.string());
  for (const char* list : {"laws", "elements"}) {
    for (const YAML::Node& each : physics[list]) root[list].push_back(each);
  }
}

// A command that acts late, of a lumped model with one input; null: none does.
YAML::Node delay_of_input(const YAML::Node& root, std::span<const LateChannel> late) {
  const YAML::Node inputs = root["inputs"];
  const bool is_lumped = root["format"].as<std::string>() == "graybox-lumped/1";
  if (!is_lumped || !inputs || inputs.size() != 1 || late.size() != 1) return {};
  if (!(late.front().moved.seconds < 0.0)) return {};
  const std::string input = inputs[0]["name"].as<std::string>();
  YAML::Node element;
  element["name"] = "found delay at actuator " + input;
  element["location"]["kind"] = "actuator";
  element["location"]["input"] = input;
  element["location"].SetStyle(YAML::EmitterStyle::Flow);
  element["law"] = "delay";
  element["parameters"]["time"]["value"] = exact_number(-late.front().moved.seconds);
  element["parameters"]["time"]["unit"] = "s";
  element["parameters"]["time"].SetStyle(YAML::EmitterStyle::Flow);
  return element;
}

std::string heading(const std::filesystem::path& model, const char* holds, const YAML::Node& root) {
  return fmt::format("# {} with {}.\n{}", model.filename().string(), holds,
                     root["base_parameters"] ? kBaseParametersComment : "");
}

std::string text_of(const YAML::Node& root) {
  YAML::Emitter emitter;
  emitter << root;
  return std::string(emitter.c_str()) + "\n";
}

}  // namespace

std::string extended_model_text(const std::filesystem::path& model,
                                const std::filesystem::path& target, const ExtendedFit& fit,
                                std::span<const Hypothesis> hypotheses,
                                std::span<const LateChannel> late) {
  YAML::Node root = YAML::LoadFile(model.string());
  take_estimates(root, fit.model_parameters, model, target);
  add_definitions(root, fit, hypotheses);
  std::set<std::string> names = element_names(root);
  for (const FittedLaw& law : fit.laws) {
    root["elements"].push_back(element_node(law, hypotheses, names));
  }
  if (const YAML::Node delay = delay_of_input(root, late); delay.IsMap()) {
    root["elements"].push_back(delay);
  }
  return heading(model, "estimated parameters and the physics that was found missing", root) +
         text_of(root);
}

std::string fitted_model_text(const std::filesystem::path& model,
                              const std::filesystem::path& target, const FitReport& report,
                              std::span<const std::filesystem::path> physics) {
  YAML::Node root = YAML::LoadFile(model.string());
  for (const std::filesystem::path& file : physics) add_physics(root, file);
  std::vector<LawParameterEstimate> estimates;
  for (std::size_t p = 0; p < report.parameters.size(); ++p) {
    const FittedParameter& each = report.parameters[p];
    LawParameterEstimate& estimate = estimates.emplace_back();
    estimate.name = each.name;
    estimate.unit = each.unit;
    estimate.value = each.value;
    estimate.standard_error = report.standard_error(p);
  }
  take_estimates(root, estimates, model, target);
  return heading(model, "fitted parameters", root) + text_of(root);
}

std::string physics_text(const ExtendedFit& fit, std::span<const Hypothesis> hypotheses) {
  YAML::Node root;
  root["format"] = "graybox-physics/1";
  add_definitions(root, fit, hypotheses);
  root["elements"] = YAML::Node(YAML::NodeType::Sequence);
  std::set<std::string> names;
  for (const FittedLaw& law : fit.laws) {
    root["elements"].push_back(element_node(law, hypotheses, names));
  }
  return text_of(root);
}

}  // namespace graybox
