// FitReport: what every fit hands back, whatever the model, and how it is written.
//
// As JSON, format graybox-fit/1:
//
//   {
//     "format": "graybox-fit/1", "model": "robot.yaml", "campaign": "campaign/campaign.yaml",
//     "method": "frequency responses, maximum likelihood", "status": "converged",
//     "parameters": [{"name": "joint_1.gearbox", "value": 2.1e6, "standard_error": 3.2e3,
//                     "unit": "N m/rad", "start": 2.12e6}, ...],
//     "covariance": [[...], ...], "correlation": [[...], ...],
//     "chi_square": 53311.2, "degrees_of_freedom": 53988, "chi_square_per_dof": 0.987,
//     "identifiability": {"relative_standard_errors": [...], "unseen": ["...", ...],
//                         "weak": ["...", ...]},
//     "starts": [{"chi_square": 53311.2, "best": true, "start": [...], "parameters": [...]}, ...],
//     "fit": {"estimation": {"recordings": 90, "chi_square_per_dof": 0.987, "nrmse": 0.8,
//                            "variance_accounted_for": 99.99}, "validation": null},
//     "plausibility": [{"rule": "sign", "quantity": "load.inertia", "value": -0.02,
//       "standard_errors": 9.1,
//                       "excludes": true, "words": "...", "remedy": "..."}],
//     "notes": ["..."], "details": {...}
//   }
//
// Numbers that are not known are null. Such are the standard error, covariance and correlation of a
// parameter that the data do not determine (identifiability.hpp). Chi-square is null where no noise
// is known, the validation where there are no recordings for it. The entry "details" holds what the
// method adds.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/estimation/identifiability.hpp"
#include "diagnosis/plausibility/plausibility.hpp"

namespace graybox {

struct FittedParameter {
  std::string name;
  std::string unit;
  double value = 0.0;
  double start = 0.0;                     // NaN: the method needs none (null in JSON)
  std::optional<QuantityKind> kind = {};  // none: by its unit
};

// How well the fitted model follows the recordings of one role.
struct FitQuality {
  std::size_t recordings = 0;
  double chi_square_per_dof = std::numeric_limits<double>::quiet_NaN();  // NaN: noise not known
  double nrmse = 0.0;                   // 100 rms(error) / standard deviation(signal), %
  double variance_accounted_for = 0.0;  // 100 (1 - variance(error) / variance(signal)), %
};

// One of the starts of the search and where it ended.
struct FitStart {
  Eigen::VectorXd start;
  Eigen::VectorXd parameters;  // empty where the search failed
  double chi_square = std::numeric_limits<double>::infinity();
  bool best = false;  // ended in the optimum that is reported
};

struct FitReport {
  std::string model, campaign;  // files
  std::string method;
  std::string status;  // "converged" or why not
  std::vector<FittedParameter> parameters;
  Identifiability identifiability;  // with the covariance of the values above
  double chi_square = std::numeric_limits<double>::quiet_NaN();
  std::size_t degrees_of_freedom = 0;
  std::vector<FitStart> starts;
  FitQuality estimation;
  std::optional<FitQuality> validation;
  std::vector<Implausibility> implausible;          // judge_plausibility()
  std::vector<std::string> notes;                   // what a reader should know, a line each
  std::shared_ptr<nlohmann::ordered_json> details;  // what the method adds; may be null

  [[nodiscard]] bool converged() const { return status == "converged"; }
  // The standard error of parameter p; NaN where there is none.
  [[nodiscard]] double standard_error(std::size_t p) const;
};

// The fitted parameters as the gate of physical sanity reads them.
[[nodiscard]] FittedPhysics fitted_physics(const FitReport& report);
// What of them no machine has, or the data do not tell: into `implausible`. Laws along the motion
// are not judged here.
void judge_plausibility(FitReport& report);

[[nodiscard]] nlohmann::ordered_json fit_json(const FitReport& report);
// A table and a few lines for people.
[[nodiscard]] std::string fit_text(const FitReport& report);

// Writes the JSON in full or not at all. Throws InputError if the file can't be written.
void write_fit(const std::string& path, const FitReport& report);

}  // namespace graybox
