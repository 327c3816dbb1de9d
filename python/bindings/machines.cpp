#include "python/bindings/machines.hpp"

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/prediction/model_prediction.hpp"
#include "diagnosis/prediction/prediction_json.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/runs/model_fit.hpp"
#include "diagnosis/runs/proposed_files.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "diagnosis/simulation/simulation_identity.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/atomic_file.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/option_ranges.hpp"
#include "python/bindings/plain_objects.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;
using Names = std::vector<std::string>;

std::string text(const py::dict& arguments, const char* name) {
  return py::cast<std::string>(arguments[name]);
}

py::dict fit_files(const py::dict& arguments, const py::object& progress) {
  ModelFitRequest request;
  request.model = text(arguments, "model");
  request.campaign = text(arguments, "campaign");
  request.written_model = text(arguments, "write");
  request.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  request.seed = py::cast<std::uint64_t>(arguments["seed"]);
  request.starts = whole_number(arguments["starts"], "starts", 1, 100000);
  request.all_starts = py::cast<bool>(arguments["all_starts"]);
  request.lines = one_of(arguments["lines"], "lines", {"none", "local", "full"});
  request.physics = py::cast<Names>(arguments["physics"]);
  request.refine = py::cast<Names>(arguments["refine"]);
  request.decimation = whole_number(arguments["decimate"], "decimate", 1, 1000000);
  request.equal_noise = py::cast<bool>(arguments["equal_noise"]);
  request.initial_state =
      one_of(arguments["initial_state"], "initial_state", {"free", "measured", "rest"});
  Call call(progress);
  request.report = [&call](std::size_t done, std::size_t total) {
    (void)call.proceed([&] { return fmt::format("recording {} of {}", done, total); });
  };
  require_fit_options(request);
  if (!request.written_model.empty()) require_writable(request.written_model);
  const FitReport report = call.run([&] {
    FitReport fitted = fit_model(request);
    if (!request.written_model.empty()) {
      write_text_file(request.written_model, fitted_model_text(request, fitted));
    }
    return fitted;
  });
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["fit"] = plain_object(fit_json(report));
  fields["text"] = fit_text(report);
  return fields;
}

py::dict predict_files(const std::string& model, const std::string& campaign_file,
                       const Names& physics, int threads, const std::string& initial_state) {
  if (initial_state != "measured" && initial_state != "free") {
    throw InputError("initial_state is '" + initial_state + "'; it must be measured or free");
  }
  Call call{py::none()};
  const ModelPrediction prediction = call.run([&] {
    return predict_recordings(
        model, read_campaign(campaign_file), {physics.begin(), physics.end()}, threads,
        initial_state == "free" ? FreeRunStart::kEstimated : FreeRunStart::kMeasured);
  });
  if (call.interrupted()) throw Stopped();
  py::list curves;
  for (const PredictionCurve& curve : prediction.curves) {
    py::dict each;
    each["recording"] = curve.recording;
    each["channel"] = curve.channel;
    each["unit"] = curve.unit;
    each["time"] = curve.time;
    each["measured"] = curve.measured;
    each["predicted"] = curve.predicted;
    curves.append(each);
  }
  py::dict fields;
  fields["prediction"] = plain_object(prediction_json(prediction, model, campaign_file));
  fields["curves"] = curves;
  return fields;
}

py::dict simulate_files(const py::dict& arguments, const py::object& progress) {
  const std::string model = text(arguments, "model"), hidden = text(arguments, "hidden"),
                    plan_file = text(arguments, "plan"), folder = text(arguments, "folder");
  const int threads = whole_number(arguments["threads"], "threads", 1, 1024);
  const auto seed = py::cast<std::uint64_t>(arguments["seed"]);
  Call call(progress);
  const SimulationOutcome outcome = call.run([&] {
    const SimulatedSystem system = load_system(
        model, hidden.empty() ? std::nullopt : std::optional<std::filesystem::path>(hidden));
    const ExcitationPlan plan = read_plan(plan_file, system);
    return simulate_campaign(
        system, plan, folder,
        {.seed = seed,
         .threads = threads,
         .identity = simulation_identity(system, plan_file),
         .keep_going = [] { return !stop_requested(); },
         .report =
             [&](std::size_t done, std::size_t total) {
               (void)call.proceed([&] { return fmt::format("recording {} of {}", done, total); });
             },
         .forecast = {}});
  });
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["campaign"] = folder;
  fields["recordings"] = outcome.recordings;
  fields["already_there"] = outcome.already_there;
  fields["complete"] = outcome.complete;
  return fields;
}

ProposalRequest proposal_of(const py::dict& arguments) {
  ProposalRequest request;
  request.command = "graybox.model";
  request.urdf = text(arguments, "urdf");
  for (const std::string& log : py::cast<Names>(arguments["logs"])) request.logs.emplace_back(log);
  for (const std::string& each : py::cast<Names>(arguments["columns"])) {
    request.columns.push_back(column_answer(each));
  }
  const auto take = [&](const char* name, std::optional<double>& to) {
    if (!arguments[name].is_none()) to = py::cast<double>(arguments[name]);
  };
  take("sample_time", request.sample_time);
  take("counts_per_turn", request.counts_per_turn);
  take("gain", request.gain);
  request.base = text(arguments, "base");
  request.tip = text(arguments, "tip");
  request.folder = text(arguments, "folder");
  const std::string motion = one_of(arguments["motion"], "motion", {"open", "linear", "rotary"});
  if (motion == "linear") request.motion = MotionKind::kLinear;
  if (motion == "rotary") request.motion = MotionKind::kRotary;
  const std::string masses = one_of(arguments["masses"], "masses", {"open", "1", "2"});
  if (masses == "1") request.machine = ProposedMachine::kOneMass;
  if (masses == "2") request.machine = ProposedMachine::kTwoMasses;
  if (!request.urdf.empty()) {
    if (masses != "open") {
      throw InputError("--one-mass and --two-masses: not beside a URDF, which says what moves");
    }
    request.machine = ProposedMachine::kRobot;
  }
  return request;
}

py::dict propose_files(const py::dict& arguments) {
  ProposalRequest request = proposal_of(arguments);
  if (!py::cast<bool>(arguments["overwrite"])) refuse_existing_proposal(request);
  Call call{py::none()};
  ModelProposal proposal;
  std::vector<std::string> findings;
  call.run([&] {
    proposal = propose_model(request);
    findings = write_proposal(request, proposal);
  });
  if (call.interrupted()) throw Stopped();
  py::list guesses, questions;
  for (const ProposedGuess& guess : proposal.guesses) {
    py::dict each;
    each["what"] = guess.subject;
    each["value"] = guess.value;
    each["why"] = guess.reason;
    guesses.append(each);
  }
  for (const OpenQuestion& question : proposal.questions) {
    questions.append(question.option.empty()
                         ? question.text
                         : fmt::format("{} ({})", question.text, question.option));
  }
  Names notes = proposal.notes;
  for (const std::string& finding : findings) notes.push_back("recordings: " + finding);
  py::dict fields;
  fields["model"] = (request.folder / "model.yaml").lexically_normal().string();
  fields["campaign"] = (request.folder / "campaign.yaml").lexically_normal().string();
  fields["guesses"] = guesses;
  fields["notes"] = notes;
  fields["questions"] = questions;
  return fields;
}

}  // namespace

void add_machines(py::module_& module) {
  module.def("fit", &fit_files);
  module.def("predict", &predict_files);
  module.def("simulate", &simulate_files);
  module.def("propose", &propose_files);
}

}  // namespace graybox::python
