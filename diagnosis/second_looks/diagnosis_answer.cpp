#include "diagnosis/second_looks/diagnosis_answer.hpp"

#include <utility>

#include "diagnosis/evidence/drive_units.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {

std::vector<std::string> DiagnosisAnswer::words() const {
  return verdict_words(in_drive_unit(diagnosis, drive_unit), hypotheses());
}

std::map<std::string, std::string> DiagnosisAnswer::figures() const {
  std::map<std::string, std::string> figures;
  for (ReportFigure& figure : report_figures(in_drive_unit(diagnosis, drive_unit), hypotheses())) {
    figures[figure.name] = std::move(figure.svg);
  }
  return figures;
}

std::string DiagnosisAnswer::extended_model(const std::string& model,
                                            const std::filesystem::path& target) const {
  if (!diagnosis.after.usable) return {};
  return extended_model_text(model, target, diagnosis.after, hypotheses(), diagnosis.late_channels);
}

}  // namespace graybox
