#include "diagnosis/runs/model_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string_view>

#include "diagnosis/verdict/extended_model.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

struct FittedFormat {
  std::string_view name;
  FitReport (*fit)(const ModelFitRequest&);
  bool takes_elements = false;  // --physics
  bool is_regression = false;   // --refine, --equal-noise, --decimate
  bool has_lines = false;       // --lines
};
constexpr FittedFormat kFormats[] = {
    {.name = "graybox-robot/1", .fit = fit_robot, .has_lines = true},
    {.name = "graybox-rigid-robot/1",
     .fit = fit_rigid_robot,
     .takes_elements = true,
     .is_regression = true},
    {.name = "graybox-lumped/1", .fit = fit_lumped, .takes_elements = true},
};

const FittedFormat& format_of(const std::string& model) {
  const YamlField field = YamlField::load(model).at("format");
  const std::string name = field.text();
  const auto* found = std::ranges::find(kFormats, name, &FittedFormat::name);
  if (found != std::end(kFormats)) return *found;
  std::string known;
  for (const FittedFormat& each : kFormats) {
    known += (known.empty() ? "" : ", ") + std::string(each.name);
  }
  field.fail(fmt::format("is '{}'; models that can be fitted: {}", name, known));
}

}  // namespace

void require_fit_options(const ModelFitRequest& request) {
  const FittedFormat& format = format_of(request.model);
  if (!format.takes_elements && (!request.physics.empty() || !request.refine.empty() ||
                                 request.equal_noise || request.decimation != 1)) {
    throw InputError(fmt::format(
        "--physics, --refine, --equal-noise and --decimate are not for {} models, as {} is",
        format.name, request.model));
  }
  if (!format.is_regression &&
      (!request.refine.empty() || request.equal_noise || request.decimation != 1)) {
    throw InputError(
        fmt::format("--refine, --equal-noise and --decimate are not for {} models", format.name));
  }
  if (!format.has_lines && request.lines != "none") {
    throw InputError(
        fmt::format("--lines is for graybox-robot/1 models; {} is {}", request.model, format.name));
  }
  if (!format.takes_elements && !request.written_model.empty()) {
    throw InputError(fmt::format("--write is for lumped models and rigid robots; {} is {}",
                                 request.model, format.name));
  }
}

bool is_simulated(const ModelFitRequest& request) {
  return format_of(request.model).takes_elements;
}

FitReport fit_model(const ModelFitRequest& request) {
  require_fit_options(request);
  FitReport report = format_of(request.model).fit(request);
  judge_plausibility(report);
  return report;
}

std::string fitted_model_text(const ModelFitRequest& request, const FitReport& report) {
  const std::vector<std::filesystem::path> physics(request.physics.begin(), request.physics.end());
  return fitted_model_text(request.model, request.written_model, report, physics);
}

}  // namespace graybox
