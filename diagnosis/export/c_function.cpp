#include "diagnosis/export/c_function.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>
#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>

#include "diagnosis/export/law_source.hpp"
#include "diagnosis/export/rigid_bodies_source.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;

// Names of users within a comment of C, which neither end it nor begin another.
std::string in_comment(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    const bool is_mark = (c == '/' && safe.ends_with('*')) || (c == '*' && safe.ends_with('/'));
    if (is_mark) safe += ' ';
    safe += c == '\n' ? ' ' : c;
  }
  return safe;
}

std::string heading(const ExportedModel& model, const std::string& name) {
  std::string text = fmt::format(
      "/* Inverse dynamics of {}, written by graybox export.\n *\n"
      " * {}_force() gives the force along each coordinate that a motion takes. Coordinates:\n",
      in_comment(model.file.filename().string()), name);
  for (std::size_t i = 0; i < model.coordinates.size(); ++i) {
    const ExportedCoordinate& each = model.coordinates[i];
    const std::string& x = each.units.deflection;
    text += fmt::format(
        " *   {}  {}: position [{}], velocity [{}/s], acceleration [{}/s^2], force [{}]\n", i,
        in_comment(each.name), x, x, x, each.units.force);
  }
  if (model.has_base_parameters) {
    text +=
        " *\n * The bodies are equivalent ones: their forces are those of the machine along every\n"
        " * motion, but no body of it has these masses and moments.\n";
  }
  for (Index i = 0; i < model.size() && !model.input_masses.empty(); ++i) {
    if (std::ranges::find(model.input_masses, i) != model.input_masses.end()) continue;
    text += fmt::format(
        " *\n * No input acts on {}: along motions that the inputs can make its force is zero.\n",
        in_comment(model.coordinates[static_cast<std::size_t>(i)].name));
  }
  for (const Element& element : model.senses) {
    text += fmt::format(" *\n * Not here, since it changes what is measured and no force: {}.\n",
                        in_comment(element_words(element)));
  }
  return text + " */\n#include <math.h>\n\n";
}

std::string indented(const std::string& body) {
  std::istringstream lines(body);
  std::string text;
  for (std::string line; std::getline(lines, line);) text += "  " + line + "\n";
  return text;
}

// Whether the name occurs as a word of its own.
bool mentions(const std::string& text, const std::string& name) {
  const auto is_inner = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + 1)) {
    const std::size_t end = at + name.size();
    const bool begins = at == 0 || !is_inner(text[at - 1]);
    if (begins && (end == text.size() || !is_inner(text[end]))) return true;
  }
  return false;
}

// static double force_1(double z, double v) { ... }
std::string law_function(const Element& element, std::size_t number) {
  const LawEntry& law = law_entry(element);
  const std::string body = *law_source(law);
  const PlaceUnits& units = element.location.units;
  std::string text = fmt::format(
      "/* {}: {} at {}.\n * {}\n * z [{}], v [{}/s], result [{}]. */\n"
      "static double force_{}(double z, double v) {{\n",
      in_comment(element.name), law.name, in_comment(element.location.name),
      in_comment(law.description), units.deflection, units.deflection, units.force, number);
  for (std::size_t p = 0; p < law.parameters.size(); ++p) {
    text += fmt::format("  const double {} = {}; /* {} */\n", c_name(law.parameters[p].name),
                        c_number(element.parameters[p]),
                        in_comment(unit_at(law.parameters[p].unit, units)));
  }
  for (const char* argument : {"z", "v"}) {
    if (!mentions(body, argument)) text += fmt::format("  (void){};\n", argument);
  }
  return text + indented(body) + "}\n\n";
}

std::string helpers_of(const std::string& text) {
  std::string helpers;
  for (const LawHelper& helper : kLawHelpers) {
    if (text.find(helper.name) != std::string::npos) helpers += std::string(helper.source) + "\n";
  }
  return helpers;
}

// "position[0] - 50.0 * position[1]".
std::string combination(const Eigen::VectorXd& factors, const std::string& of) {
  std::string text;
  for (Index i = 0; i < factors.size(); ++i) {
    if (factors(i) == 0.0) continue;
    const double size = std::abs(factors(i));
    const bool is_first = text.empty();
    const char* sign = factors(i) < 0.0 ? (is_first ? "-" : " - ") : (is_first ? "" : " + ");
    const std::string factor = size == 1.0 ? "" : fmt::format("{} * ", c_number(size));
    text += fmt::format("{}{}{}[{}]", sign, factor, of, i);
  }
  return text.empty() ? "0.0" : text;
}

bool acts_on_several(const Element& element) {
  return (element.location.output.array() != 0.0).count() > 1;
}

std::string add_law(const Element& element, std::size_t number) {
  const std::string call =
      fmt::format("force_{}({}, {})", number, combination(element.location.input, "position"),
                  combination(element.location.input, "velocity"));
  const bool is_shared = acts_on_several(element);
  std::string text = is_shared ? fmt::format("  f = {};\n", call) : std::string();
  const Eigen::VectorXd& output = element.location.output;
  for (Index i = 0; i < output.size(); ++i) {
    if (output(i) == 0.0) continue;
    const std::string factor =
        std::abs(output(i)) == 1.0 ? "" : fmt::format("{} * ", c_number(std::abs(output(i))));
    text += fmt::format("  force[{}] {} {}{};\n", i, output(i) < 0.0 ? "-=" : "+=", factor,
                        is_shared ? "f" : call);
  }
  return text;
}

std::string force_function(const ExportedModel& model, const std::string& name) {
  const Index n = model.size();
  std::string text = fmt::format(
      "void {0}_force(const double position[{1}], const double velocity[{1}],\n"
      "    const double acceleration[{1}], double force[{1}]) {{\n",
      name, n);
  const bool has_bodies = model.bodies.size() > 0 && !model.bodies.isZero(0.0);
  if (std::ranges::any_of(model.forces, acts_on_several)) text += "  double f;\n";
  if (!has_bodies && model.forces.empty()) text += "  (void)position;\n  (void)velocity;\n";
  if (has_bodies) text += "  rigid_bodies(position, velocity, acceleration, force);\n";
  for (Index i = 0; i < n; ++i) {
    const Eigen::VectorXd row = model.mass.row(i);
    if (has_bodies && row.isZero(0.0)) continue;
    text += fmt::format("  force[{}] {} {}; /* {} */\n", i, has_bodies ? "+=" : "=",
                        combination(row, "acceleration"),
                        model.coordinates[static_cast<std::size_t>(i)].units.inertia);
  }
  for (std::size_t k = 0; k < model.forces.size(); ++k) text += add_law(model.forces[k], k + 1);
  return text + "}\n";
}

// ---- to the inputs ------------------------------------------------------------------------------

// The statement that undoes an actuator's law s -> s + f(s) of the variable s.
std::string undoing(const Element& element, const std::string& s) {
  const std::vector<double>& p = element.parameters;
  if (element.law_name == "gain") return fmt::format("{} /= 1.0 + {};", s, c_number(p[0]));
  if (element.law_name == "offset") return fmt::format("{} -= {};", s, c_number(p[0]));
  if (element.law_name == "dead_zone") {
    return fmt::format("if ({0} != 0.0) {0} += {0} > 0.0 ? {1} : -{1};", s, c_number(p[0]));
  }
  const double limit = p[0], corner = std::min(p[1], p[0]);
  return fmt::format("{0} = saturation_undone({0}, {1}, {2});", s, c_number(limit),
                     c_number(corner));
}

constexpr const char* kSaturationUndone =
    "/* What a saturation with a parabola for a corner turns into s, or into the nearest to it. "
    "*/\n"
    "static double saturation_undone(double s, double limit, double corner) {\n"
    "  double size = fabs(s);\n"
    "  if (size > limit - corner) {\n"
    "    size = limit + corner - sqrt(4.0 * corner * fmax(limit - size, 0.0));\n"
    "  }\n"
    "  return s < 0.0 ? -size : size;\n"
    "}\n\n";

std::string command_function(const ExportedModel& model, const std::string& name) {
  std::string body;
  for (std::size_t i = 0; i < model.input_masses.size(); ++i) {
    const std::string command = fmt::format("command[{}]", i);
    body += fmt::format("  {} = force[{}]; /* {} */\n", command, model.input_masses[i],
                        in_comment(model.input_names[i]));
    for (auto each = model.commands.rbegin(); each != model.commands.rend(); ++each) {
      if (each->location.channel != model.input_channels[i]) continue;
      body +=
          fmt::format("  {} /* {} */\n", undoing(*each, command), in_comment(element_words(*each)));
    }
  }
  return fmt::format(
             "\n/* What to ask of each input: {}. */\n{}"
             "void {}_command(const double force[{}], double command[{}]) {{\n",
             in_comment(fmt::format("{}", fmt::join(model.input_names, ", "))),
             body.find("saturation_undone") == std::string::npos ? "" : kSaturationUndone, name,
             model.size(), model.input_masses.size()) +
         body + "}\n";
}

// Two inputs on one mass have no commands of their own: only their sum is told.
bool has_commands(const ExportedModel& model) {
  const std::set<Index> driven(model.input_masses.begin(), model.input_masses.end());
  const bool is_unique = driven.size() == model.input_masses.size();
  if (!is_unique && !model.commands.empty()) {
    std::vector<std::string> obstacles;
    for (const Element& element : model.commands) {
      obstacles.push_back(fmt::format(
          "element {} can't be undone where several inputs act on one mass (give the mass one "
          "input)",
          element_words(element)));
    }
    refuse_export(model, obstacles);
  }
  return is_unique && !model.input_masses.empty();
}

std::string motor_function(const ExportedModel& model, const std::string& name) {
  if (!model.robot || model.robot->transmission.isIdentity(0.0)) return {};
  const Eigen::MatrixXd back = model.robot->transmission.transpose().inverse();
  std::string text = fmt::format(
      "\n/* Torques of the motors, motor side. */\n"
      "void {0}_motors(const double force[{1}], double motor[{1}]) {{\n",
      name, model.size());
  for (Index i = 0; i < model.size(); ++i) {
    text += fmt::format("  motor[{}] = {};\n", i, combination(back.row(i), "force"));
  }
  return text + "}\n";
}

void require_name(const std::string& name) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  if (!name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) == 0 &&
      std::ranges::all_of(name, is_plain)) {
    return;
  }
  throw InputError(
      fmt::format("--name: '{}' is no name in C: use letters, digits and _, a letter first", name));
}

}  // namespace

std::string c_function(const ExportedModel& model, const std::string& name) {
  require_name(name);
  require_closed_forces(model);
  std::string laws;
  for (std::size_t k = 0; k < model.forces.size(); ++k) {
    laws += law_function(model.forces[k], k + 1);
  }
  std::string text = heading(model, name) + helpers_of(laws) + laws;
  if (model.robot && !model.bodies.isZero(0.0)) text += rigid_bodies_source(model);
  text += force_function(model, name) + motor_function(model, name);
  if (has_commands(model)) text += command_function(model, name);
  return text;
}

std::string c_name_of(const std::filesystem::path& file) {
  std::string name = file.stem().string();
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) != 0) {
    name.insert(0, "model_");
  }
  return name;
}

}  // namespace graybox
