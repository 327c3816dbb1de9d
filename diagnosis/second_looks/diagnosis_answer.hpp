// What a whole diagnosis is asked, and what it answers: the request of a program, and its result
// with words, figures and the extended model.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/search_options.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"

namespace graybox {

struct DiagnosisRequest {
  std::string model, campaign;  // files
  std::string report = {};      // a folder for it; empty: none
  std::string command = {};     // as it was typed, for the report
  std::vector<std::string> law_files = {}, place_files = {};
  std::string method = "auto";
  int threads = 1;
  // Its `proceed` is asked before each step of the search; false ends it, as stop_requested() does.
  SearchOptions search = {};
  std::function<void()> begin = {};  // called once the campaign is read and the folder is claimed
};

struct DiagnosisAnswer {
  std::string method;                        // periodic, force_balance, prediction_error
  std::string method_line;                   // why, where a lumped model leaves a choice
  std::unique_ptr<MismatchProblem> problem;  // keeps the hypotheses, of two methods
  PredictionDiagnosis by_prediction;
  Diagnosis diagnosis;
  // Of drives whose gains are not known, "mA" say: forces in words are in it; empty: in N m or N.
  std::string drive_unit;
  std::vector<std::string> warnings;  // of the recordings
  nlohmann::ordered_json verdict;     // verdict_file.hpp, and "method"

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const {
    return problem ? problem->hypotheses() : std::span<const Hypothesis>(by_prediction.hypotheses);
  }
  [[nodiscard]] std::vector<std::string> words() const;
  // By name, as SVG.
  [[nodiscard]] std::map<std::string, std::string> figures() const;
  // The extended model as a file at `target`; empty where there is none.
  [[nodiscard]] std::string extended_model(const std::string& model,
                                           const std::filesystem::path& target) const;
};

}  // namespace graybox
