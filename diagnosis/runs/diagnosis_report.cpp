#include "diagnosis/runs/diagnosis_report.hpp"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "diagnosis/evidence/drive_units.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/next_plan.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox {
namespace {

// What `graybox simulate` needs to carry out the next experiment.
void add_next_plans(const DiagnosisRequest& request, const Campaign& campaign,
                    const Diagnosis& diagnosis, std::map<std::string, std::string>& texts) {
  const NextQuestion question = next_question(diagnosis);
  if (question.rival == nullptr) return;
  const std::string format = YamlField::load(request.model).at("format").text();
  int number = 0;
  for (const std::string& motion : next_motions(*question.rival->next)) {
    texts[fmt::format("next_motion_{}.csv", ++number)] = motion;
  }
  if (number > 0) return;
  for (const std::string& plan :
       next_plans(*question.rival->next, campaign, format == "graybox-robot/1")) {
    texts[fmt::format("next_plan_{}.yaml", ++number)] = plan;
  }
}

// What a reader may save from the page.
ReportContext context_of(const std::map<std::string, std::string>& texts, PageOrigin origin) {
  ReportContext context{.origin = std::move(origin)};
  for (const auto& [name, text] : texts) {
    if (name.starts_with("next_plan_") || name.starts_with("next_motion_")) {
      context.plans.push_back({name, text, "the experiment to make"});
    } else if (name == "model_extended.yaml") {
      context.models.push_back({name, text, "the model with the laws found"});
    } else if (name == "physics.yaml") {
      context.models.push_back({name, text, "these laws alone, for --physics"});
    }
  }
  return context;
}

}  // namespace

const std::vector<std::string>& report_file_names() {
  static const std::vector<std::string> kNames{"report.html", "verdict.json", "model_extended.yaml",
                                               "physics.yaml"};
  return kNames;
}

void write_report(const DiagnosisRequest& request, const Campaign& campaign,
                  const DiagnosedFiles& files, PageOrigin origin, ReportFolder& folder,
                  DiagnosisAnswer& answer) {
  std::map<std::string, std::string> texts;
  for (auto& [name, svg] : answer.figures()) texts["figures/" + name + ".svg"] = svg;
  if (answer.diagnosis.after.usable) {
    texts["model_extended.yaml"] =
        answer.extended_model(request.model, folder.file("model_extended.yaml"));
    texts["physics.yaml"] = physics_text(answer.diagnosis.after, answer.hypotheses());
  }
  add_next_plans(request, campaign, answer.diagnosis, texts);
  const ReportContext context = context_of(texts, std::move(origin));
  texts["report.html"] = report_page(in_drive_unit(answer.diagnosis, answer.drive_unit),
                                     answer.hypotheses(), files, context);
  folder.write(texts, answer.verdict);
}

}  // namespace graybox
