// The report of a diagnosis: the page, its figures, the extended model, the laws found, and plans
// of the next experiment, as files of a folder.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/report/html_page.hpp"
#include "diagnosis/runs/report_folder.hpp"
#include "diagnosis/second_looks/diagnosis_answer.hpp"
#include "diagnosis/verdict/verdict_file.hpp"

namespace graybox {

// What every report may hold. Figures and plans have names of their own (report_folder.hpp).
[[nodiscard]] const std::vector<std::string>& report_file_names();

// Writes all files of the answer into the folder, which adds their names to its verdict. Throws
// InputError where one of them would replace a file that is not ours.
void write_report(const DiagnosisRequest& request, const Campaign& campaign,
                  const DiagnosedFiles& files, PageOrigin origin, ReportFolder& folder,
                  DiagnosisAnswer& answer);

}  // namespace graybox
