#include "diagnosis/export/law_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) {
    if (c == '"') cell += '"';
    cell += c;
  }
  return cell + "\"";
}

std::string parameter_rows(const std::vector<Element>& elements) {
  std::string rows;
  for (const Element& element : elements) {
    const LawEntry& law = law_entry(element);
    for (std::size_t p = 0; p < law.parameters.size(); ++p) {
      rows += fmt::format("{},{},{},{},{},{}\n", csv_cell(element.name), law.name,
                          csv_cell(element.location.name), law.parameters[p].name,
                          element.parameters[p],
                          csv_cell(unit_at(law.parameters[p].unit, element.location.units)));
    }
  }
  return rows;
}

ModelTable parameters_table(const ExportedModel& model) {
  std::string text = "element,law,place,parameter,value,unit\n";
  for (const ExportedNumber& number : model.numbers) {
    text += fmt::format("{},,,{},{},{}\n", csv_cell(number.owner), number.name, number.value,
                        number.unit);
  }
  for (const auto* elements :
       {&model.forces, &model.inertias, &model.payloads, &model.commands, &model.senses}) {
    text += parameter_rows(*elements);
  }
  return {.file = "parameters.csv", .text = text};
}

// What a law's force depends on.
enum class Argument : std::uint8_t { kNothing, kVelocity, kDeflection, kBoth };

Argument argument_of(const Law& law) {
  constexpr std::array<double, 8> kTried = {1e-6, 1e-4, 1e-2, 0.1, 0.37, 1.0, 13.0, 1e3};
  bool by_deflection = false, by_rate = false;
  for (const double z : kTried) {
    for (const double v : kTried) {
      LawDerivatives slopes;
      law.differentiate(z, v, {}, slopes);
      by_deflection |= slopes.force.by_deflection != 0.0;
      by_rate |= slopes.force.by_rate != 0.0;
    }
  }
  if (by_deflection) return by_rate ? Argument::kBoth : Argument::kDeflection;
  return by_rate ? Argument::kVelocity : Argument::kNothing;
}

// Laws of one kind at one place: their forces add up.
struct Curve {
  Argument argument = Argument::kNothing;
  std::vector<const Element*> laws;
};

std::vector<Curve> curves_of(const ExportedModel& model) {
  std::vector<Curve> curves;
  for (const Element& element : model.forces) {
    if (!element.law || element.law->state_count() > 0 || element.location.driver >= 0) continue;
    const Argument argument = argument_of(*element.law);
    if (argument == Argument::kNothing) continue;
    const auto is_same = [&](const Curve& curve) {
      const Location& place = curve.laws.front()->location;
      return curve.argument == argument && argument != Argument::kBoth &&
             place.input == element.location.input && place.output == element.location.output;
    };
    const auto found = std::ranges::find_if(curves, is_same);
    if (found != curves.end()) {
      found->laws.push_back(&element);
    } else {
      curves.push_back({.argument = argument, .laws = {&element}});
    }
  }
  return curves;
}

// Ten times the largest parameter of this unit.
double reach_of(const Curve& curve, std::string_view unit) {
  double largest = 0.0;
  for (const Element* element : curve.laws) {
    const LawEntry& law = law_entry(*element);
    for (std::size_t p = 0; p < law.parameters.size(); ++p) {
      if (law.parameters[p].unit == unit) largest = std::max(largest, element->parameters[p]);
    }
  }
  return largest > 0.0 ? 10.0 * largest : 1.0;
}

// Even steps from -reach to reach, exactly zero in the middle.
std::vector<double> grid(double reach, int points) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(points));
  for (int k = 0; k < points; ++k) {
    values.push_back(reach * (2.0 * k - (points - 1)) / (points - 1));
  }
  return values;
}

std::string file_name(const std::string& kind, const std::string& place) {
  std::string name = kind + "_";
  for (const char c : place) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-';
    name += is_plain ? c : '_';
  }
  return name;
}

std::string lines_of(const Curve& curve, const TableRange& range) {
  const PlaceUnits& units = curve.laws.front()->location.units;
  const bool is_friction = curve.argument == Argument::kVelocity;
  std::string text = is_friction ? fmt::format("velocity [{}/s]", units.deflection)
                                 : fmt::format("deflection [{}]", units.deflection);
  for (const Element* element : curve.laws) {
    text += fmt::format(",{}", csv_cell(fmt::format("{} [{}]", element->name, units.force)));
  }
  text += fmt::format(",force [{}]\n", units.force);
  const double reach = is_friction ? range.velocity.value_or(reach_of(curve, "x/s"))
                                   : range.deflection.value_or(reach_of(curve, "x"));
  for (const double x : grid(reach, range.points)) {
    double sum = 0.0;
    text += fmt::format("{}", x);
    for (const Element* element : curve.laws) {
      const double force =
          is_friction ? element->law->force(0.0, x, {}) : element->law->force(x, 0.0, {});
      sum += force;
      text += fmt::format(",{}", force);
    }
    text += fmt::format(",{}\n", sum);
  }
  return text;
}

std::string lines_on_grid(const Curve& curve, const TableRange& range) {
  constexpr int kSide = 41;  // points of each axis of a grid, at most
  const Element& element = *curve.laws.front();
  const PlaceUnits& units = element.location.units;
  std::string text =
      fmt::format("deflection [{0}],velocity [{0}/s],force [{1}]\n", units.deflection, units.force);
  const int points = std::min(range.points, kSide);
  for (const double z : grid(range.deflection.value_or(reach_of(curve, "x")), points)) {
    for (const double v : grid(range.velocity.value_or(reach_of(curve, "x/s")), points)) {
      text += fmt::format("{},{},{}\n", z, v, element.law->force(z, v, {}));
    }
  }
  return text;
}

// Two places may be one name when letters are left out.
void add_table(std::string name, std::string text, std::vector<ModelTable>& tables) {
  std::string file = name + ".csv";
  for (int copy = 2; std::ranges::find(tables, file, &ModelTable::file) != tables.end(); ++copy) {
    file = fmt::format("{}_{}.csv", name, copy);
  }
  tables.push_back({.file = file, .text = std::move(text)});
}

}  // namespace

std::vector<ModelTable> model_tables(const ExportedModel& model, const TableRange& range) {
  std::vector<ModelTable> tables{parameters_table(model)};
  for (const Curve& curve : curves_of(model)) {
    const std::string& place = curve.laws.front()->location.name;
    const char* kind = curve.argument == Argument::kVelocity     ? "friction"
                       : curve.argument == Argument::kDeflection ? "spring"
                                                                 : "damping";
    add_table(
        file_name(kind, place),
        curve.argument == Argument::kBoth ? lines_on_grid(curve, range) : lines_of(curve, range),
        tables);
  }
  return tables;
}

}  // namespace graybox
