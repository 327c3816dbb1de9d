#include "diagnosis/estimation/fit_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "diagnosis/plausibility/plausibility_words.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const Eigen::VectorXd& vector) {
  return std::vector<double>(vector.begin(), vector.end());
}

Json json_of(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    rows.push_back(json_of(Eigen::VectorXd(matrix.row(i))));
  }
  return rows;
}

double chi_square_per_dof(const FitReport& report) {
  return report.chi_square / static_cast<double>(report.degrees_of_freedom);
}

Json parameters_json(const FitReport& report) {
  Json list = Json::array();
  for (std::size_t p = 0; p < report.parameters.size(); ++p) {
    const FittedParameter& each = report.parameters[p];
    list.push_back({{"name", each.name},
                    {"value", each.value},
                    {"standard_error", report.standard_error(p)},
                    {"unit", each.unit},
                    {"start", each.start}});
  }
  return list;
}

Json identifiability_json(const Identifiability& seen) {
  Json unseen = Json::array();
  for (const UnseenCombination& each : seen.unseen) unseen.push_back(each.words);
  return {{"relative_standard_errors", json_of(seen.relative_standard_errors)},
          {"unseen", unseen},
          {"weak", seen.weak}};
}

Json starts_json(const std::vector<FitStart>& starts) {
  Json list = Json::array();
  for (const FitStart& each : starts) {
    list.push_back({{"chi_square", each.chi_square},
                    {"best", each.best},
                    {"start", json_of(each.start)},
                    {"parameters", json_of(each.parameters)}});
  }
  return list;
}

Json quality_json(const FitQuality& quality) {
  return {{"recordings", quality.recordings},
          {"chi_square_per_dof", quality.chi_square_per_dof},
          {"nrmse", quality.nrmse},
          {"variance_accounted_for", quality.variance_accounted_for}};
}

// Shares below 1e-5 of the table's own digits would only be noise.
std::string parameter_table(const FitReport& report) {
  std::size_t width = 9;
  for (const FittedParameter& each : report.parameters) width = std::max(width, each.name.size());
  std::string text = fmt::format("{:<{}} {:>13} {:>13} {:>9} {:>13}  unit\n", "parameter", width,
                                 "value", "std. error", "[%]", "start");
  for (std::size_t p = 0; p < report.parameters.size(); ++p) {
    const FittedParameter& each = report.parameters[p];
    const double error = report.standard_error(p);
    const bool determined = std::isfinite(error);
    const std::string absolute = determined ? fmt::format("{:.4g}", error) : "not seen";
    const std::string relative = determined && each.value != 0.0
                                     ? fmt::format("{:.3g}", 100.0 * error / std::abs(each.value))
                                     : "-";
    const std::string start = std::isfinite(each.start) ? fmt::format("{:.7g}", each.start) : "-";
    text += fmt::format("{:<{}} {:>13.7g} {:>13} {:>9} {:>13}  {}\n", each.name, width, each.value,
                        absolute, relative, start, each.unit);
  }
  return text;
}

std::string quality_line(const char* role, const FitQuality& quality) {
  const std::string chi_square = std::isfinite(quality.chi_square_per_dof)
                                     ? fmt::format("{:.4g}", quality.chi_square_per_dof)
                                     : "unknown (no noise known)";
  return fmt::format(
      "{:<11} {} recordings: chi-square/dof {}, NRMSE {:.4g} %, variance accounted for {:.6g} %\n",
      role, quality.recordings, chi_square, quality.nrmse, quality.variance_accounted_for);
}

std::string starts_line(const std::vector<FitStart>& starts) {
  const auto same = std::ranges::count_if(starts, &FitStart::best);
  return fmt::format("{} of {} start{} ended in the best optimum\n", same, starts.size(),
                     starts.size() == 1 ? "" : "s");
}

}  // namespace

double FitReport::standard_error(std::size_t p) const {
  const auto at = static_cast<Eigen::Index>(p);
  const Eigen::MatrixXd& covariance = identifiability.covariance;
  return at < covariance.rows() ? std::sqrt(covariance(at, at))
                                : std::numeric_limits<double>::quiet_NaN();
}

FittedPhysics fitted_physics(const FitReport& report) {
  FittedPhysics physics;
  for (std::size_t p = 0; p < report.parameters.size(); ++p) {
    const FittedParameter& each = report.parameters[p];
    PhysicalQuantity& quantity = physics.quantities.emplace_back();
    quantity.name = each.name;
    quantity.unit = each.unit;
    quantity.kind = each.kind.value_or(quantity_kind(each.name, each.unit));
    quantity.value = each.value;
    quantity.standard_error = report.standard_error(p);
    quantity.start = each.start;
  }
  for (const UnseenCombination& each : report.identifiability.unseen) {
    physics.unseen.push_back({each.direction});
  }
  physics.correlation = report.identifiability.correlation();
  return physics;
}

void judge_plausibility(FitReport& report) {
  report.implausible = implausibilities(fitted_physics(report));
}

Json fit_json(const FitReport& report) {
  Json json{{"format", "graybox-fit/1"},
            {"model", report.model},
            {"campaign", report.campaign},
            {"written_by", written_by()},
            {"method", report.method},
            {"status", report.status},
            {"parameters", parameters_json(report)},
            {"covariance", json_of(report.identifiability.covariance)},
            {"correlation", json_of(report.identifiability.correlation())},
            {"chi_square", report.chi_square},
            {"degrees_of_freedom", report.degrees_of_freedom},
            {"chi_square_per_dof", chi_square_per_dof(report)},
            {"identifiability", identifiability_json(report.identifiability)},
            {"starts", starts_json(report.starts)}};
  json["fit"] = {{"estimation", quality_json(report.estimation)},
                 {"validation", report.validation ? quality_json(*report.validation) : Json()}};
  json["plausibility"] = plausibility_json(report.implausible);
  json["notes"] = report.notes;
  json["details"] = report.details ? *report.details : Json::object();
  return json;
}

std::string fit_text(const FitReport& report) {
  std::string text = fmt::format("{}: {}\n", report.method, report.status);
  for (const std::string& line : plausibility_lines(report.implausible)) text += line + "\n";
  text += parameter_table(report);
  if (!report.starts.empty()) text += starts_line(report.starts);
  text += quality_line("estimation:", report.estimation);
  text += report.validation ? quality_line("validation:", *report.validation)
                            : "validation:  no recordings\n";
  const Identifiability& seen = report.identifiability;
  for (const UnseenCombination& each : seen.unseen) {
    text += fmt::format("warning: not determined: {}\n", each.words);
  }
  for (const std::string& each : seen.weak) text += fmt::format("warning: weak: {}\n", each);
  for (const std::string& each : report.notes) text += fmt::format("note: {}\n", each);
  return text;
}

void write_fit(const std::string& path, const FitReport& report) {
  write_text_file(path, fit_json(report).dump(2) + "\n");
}

}  // namespace graybox
