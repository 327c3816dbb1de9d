#include "diagnosis/second_looks/method_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>
#include <variant>

#include "diagnosis/force_balance_data/measured_drive.hpp"
#include "diagnosis/second_looks/known_laws.hpp"
#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {
namespace {

// Why a lumped model and its recordings are none for harmonic balance; empty if they are.
std::string why_not_periodic(const LumpedModel& model, const Campaign& campaign) {
  const bool is_periodic = std::ranges::all_of(
      campaign.experiments,
      [](const Experiment& experiment) { return experiment.excitation.has_value(); });
  if (!is_periodic) return "the recordings have no period ('excitation')";
  if (campaign.hold != InputHold::kZero) {
    return "the inputs are not held between samples ('hold')";
  }
  const bool has_accelerations = std::ranges::any_of(model.outputs, [](const LumpedOutput& output) {
    return output.quantity == LumpedOutput::Quantity::kAcceleration;
  });
  return has_accelerations ? "accelerations are measured" : "";
}

// Whether no channel and no step but constants is an input: a run-down or a free swing.
bool records_no_force(const Campaign& campaign) {
  const auto is_input = [](const Channel& channel) { return channel.role == ChannelRole::kInput; };
  bool has_constant = false, has_other = std::ranges::any_of(campaign.channels, is_input);
  for (const PreprocessStep& step : campaign.preprocess) {
    std::visit(
        [&](const auto& each) {
          if constexpr (requires { each.role; }) {
            using Role = std::optional<ChannelRole>;
            if (Role(each.role) != Role(ChannelRole::kInput)) return;
            constexpr bool kIsConstant =
                std::is_same_v<std::decay_t<decltype(each)>, ConstantChannel>;
            (kIsConstant ? has_constant : has_other) = true;
          }
        },
        step);
  }
  return has_constant && !has_other;
}

[[noreturn]] void refuse_balance_without_force(const Campaign& campaign) {
  throw InputError(fmt::format(
      "--method force_balance: {} records no force (its inputs are constants), so there is no "
      "balance of forces: say --method prediction_error",
      campaign.file.string()));
}

[[noreturn]] void refuse_balance_of_parts(const DiagnosisRequest& request) {
  throw InputError(fmt::format(
      "--method force_balance: {} must be one mass whose only force and whose position or velocity "
      "are recorded, without laws other than viscous, stiffness and offset: leave these out, since "
      "they are looked for, or say prediction_error",
      request.model));
}

// By what was asked for, the model's format, and the recordings, in this order.
MethodChoice method_by_format(const DiagnosisRequest& request, const Campaign& campaign) {
  const std::string format = YamlField::load(request.model).at("format").text();
  MethodChoice method{"", "it was asked for", format == "graybox-lumped/1", {}};
  std::optional<LumpedModel> lumped;
  if (method.is_lumped) {
    lumped = load_lumped_model(request.model);
    method.drive = measured_drive(*lumped);
  }
  const bool asks_for_balance = request.method == "force_balance";
  if (asks_for_balance && method.is_lumped && records_no_force(campaign)) {
    refuse_balance_without_force(campaign);
  }
  if (request.method == "prediction_error" || (asks_for_balance && method.drive)) {
    method.name = request.method;
    return method;
  }
  if (asks_for_balance && method.is_lumped) refuse_balance_of_parts(request);
  const bool is_rigid = format == "graybox-rigid-robot/1";
  method.name = is_rigid ? "force_balance" : "periodic";
  if (request.method != "auto" && request.method != method.name) {
    throw InputError(fmt::format("--method {}: {} is a {} model: say {}{}", request.method,
                                 request.model, format, method.name,
                                 method.is_lumped ? " or prediction_error" : ""));
  }
  if (request.method == "auto" && lumped) {
    const std::string why_not = why_not_periodic(*lumped, campaign);
    if (!why_not.empty()) {
      method.name = "prediction_error";
      method.reason = why_not;
    }
  }
  return method;
}

}  // namespace

MethodChoice choose_method(const DiagnosisRequest& request, const Campaign& campaign) {
  MethodChoice method = method_by_format(request, campaign);
  if (!method.takes_any_motion()) return method;
  if (!request.place_files.empty()) {
    throw InputError("--places: a lumped model in any motion is diagnosed at its own places alone");
  }
  require_laws_of_the_catalogue(request.search.excluded_laws);
  return method;
}

std::string method_line(const MethodChoice& method) {
  if (!method.takes_any_motion()) return "";
  const bool is_balance = method.name == "force_balance";
  return fmt::format("By {}, since {}.", is_balance ? "the balance of forces" : "prediction error",
                     method.reason);
}

}  // namespace graybox
