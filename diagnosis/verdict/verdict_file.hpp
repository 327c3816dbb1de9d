// verdict.json, format graybox-verdict/1 (design, section 8): a diagnosis for other programs.
//
//   {"format": "graybox-verdict/1", "model": ..., "campaign": ..., "verdict": "explained",
//    "reasons": [{"test", "value", "limit", "limit_is": "at_most", "passed",
//                 "otherwise": "unknown", "next"}],
//    "checked_range": {"kept_out": true, "files": [...], "positions": [...],
//                      "spans": [{"quantity", "unit", "from", "to"}]},
//    "plausibility": [{"rule": "sign", "quantity", "value", "standard_errors", "excludes",
//                      "words", "remedy"}],
//    "interrupted": false, "noise_is_known": true, "verified": true, "predicts_kept_out": true,
//    "remaining_structure": null,
//    "autocorrelated_error": null, "rivals_weighed": true,
//    "words": ["...", ...], "channel_faults": [{"channels": [...], "message": "..."}],
//    "recording_warnings": ["..."],
//    "mismatch": {"detected": true, "p_value": 1e-40, "lack_of_fit_p_value": ...,
//                 "smallest_p_value": ..., "threshold": ..., "channels": ["y_3"],
//                 "rest_by_channel": [{"channel", "before": {"nrmse", "nrmse_held_out",
//                 "remaining_structure", "autocorrelated_error", "late_by_s": null},
//                 "after": {...}}],
//                 "bands_hz": [[5.0, 12.5]], "positions": ["..."],
//                 "levels": [3.0], "nonlinear": true, "smallest_detectable": [{"place", "law",
//                 "amplitude", "unit"}, ...]},
//    "time_variation": {"place", "coefficient", "deviation", "unit", "frequency_hz", "duration_s",
//                       "p_value", "alternatives": ["damping at joint_2.motor"]},
//    "time_variation_tested": true,
//    "trends": [{"place", "law", "parameter", "unit", "with": "time", "from", "to",
//                "standard_errors"}],
//    "physics": [{"name": ..., "place": ..., "location": {...}, "law": "cubic_spring",
//                 "parameters": {"stiffness": {"value", "standard_error", "unit"}},
//                 "explained_share": 0.99, "bic_difference", "held_out_gain",
//                 "held_out_error_without", "same_at": [...],
//                 "alternatives": [{"place", "law", "parameters", "bic_difference",
//                 "evidence_difference", "held_out_difference", "same_at", "on_few_recordings",
//                 "with_free_motion", "contradicted"}],
//                 "generalisations": [...], "excluded": [...]}],
//    "rejected": [{"place", "law", "reason", "held_out": {"error_without", "error_with", "gain"}}],
//    "late_channels": [{"channel", "late_by_s", "nrmse_held_out_before", "nrmse_held_out"}],
//    "freed_model": {"error_stated", "error_freed", "on_kept_out", "departures": ["..."]},
//    "doubted_model": the same,
//    "shapes_compared": true,
//    "departures": [{"place", "law", "chi_square", "degrees_of_freedom", "p_value",
//                    "share"}],
//    "shared_characteristics": [{"place", "characteristic": "spring",
//                                "laws": ["backlash", "ripple"]}],
//    "fit": {"before": {"estimation": {"chi_square_per_dof", "nrmse", "variance_accounted_for"},
//            "validation": {...}}, "after": {...}, "seconds_ahead": 0.0,
//            "validation_within_errors": {"chi_square_per_dof"}}},
//    "parameters": [{"name", "before", "after", "standard_error", "unit"}],
//    "next_experiment": {"between": ["...", "..."], "shares": [{"position", "level", "band_hz",
//                        "weight"}], "duality_gap", "distance_now", "distance_then",
//                        "distance_needed", "recordings", "recordings_needed"}}
//
// Channels, bands, positions and levels are those where residuals before any extension are too
// large at a false discovery rate of 5 % (Benjamini and Yekutieli 2001); cells that touch are one
// band. Where the noise is not known, channels are those of `rest_by_channel` whose rest depends on
// the motion or on its own past. It must do so by more than the limits for all of them together.
// The other lists are then empty. The list `reasons` (verdict_reasons.hpp) has the tests in the
// order in which they decide. The first that failed makes the verdict what its `otherwise` says.
// The field `passed` is null where a test could not be asked, and `not_tested` says why. The field
// `next` is there where it failed. The `held_out_gain` is the share of the squared error over the
// noise that a law takes from recordings kept out. The field `nonlinear` says that a law that is
// not linear was found; it is null where none was. Numbers that are not known are null. Where the
// noise is known, the flag `predicts_kept_out` is false if recordings kept out are predicted within
// the errors of the fitted parameters only. Where it is not, the flag is false if none were kept
// out, or a test of their error failed. Of an alternative, `on_few_recordings` is true where few
// of many recordings excluded the law. The flag `contradicted` is true where recordings kept out
// excluded it. The flag `with_free_motion` is true where it was so far behind that it was not
// fitted again to recordings freed of free motion. The flag `rivals_weighed` is false where as
// many laws as the search takes leave more than noise. The field `time_variation` is null where
// nothing was seen to change while it is recorded (time_variation.hpp). Whether that could be told
// says `time_variation_tested`. The list `trends` (law_trend.hpp) says of each law found, where
// the noise is not known, with what its parameter changes most: `time`, `position`, `speed` or
// `direction`. The list `departures` (law_departure.hpp) has places where the laws found only
// resemble what is there, and the law that would explain most of the rest. Whether that could be
// asked says `shapes_compared` (noise known, the rest no more than that, another law to ask for).
// The list `shared_characteristics` has places where several laws describe one spring or friction.
// A parameter that `sets_scale` is stated: with another value the law's other sizes scale, and the
// force is the same. Sizes that count for that value alone have no standard error, but a
// `conditional_error`. The field `next_experiment` (next_experiment.hpp) is null where nothing is
// to be told apart or nothing could tell.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/search/diagnosis_search.hpp"

namespace graybox {

struct MismatchSummary {
  std::vector<std::string> channels, positions;
  std::vector<double> levels;
  std::vector<std::pair<double, double>> bands;  // Hz (or s), merged
};
// False discovery rate of the cells that are called more than noise, in words and as frames of a
// map.
inline constexpr double kFramedRate = 0.05;
// That noise alone leaves as much.
[[nodiscard]] double cell_p_value(const MismatchCell& cell);
// The cells that are too large at this false discovery rate (Benjamini and Yekutieli 2001).
[[nodiscard]] std::vector<bool> rejected_cells(const std::vector<MismatchCell>& cells, double rate);
[[nodiscard]] MismatchSummary summarise_mismatch(const std::vector<MismatchCell>& cells,
                                                 double rate = kFramedRate);

struct DiagnosedFiles {
  std::string model, campaign;
  std::vector<std::string> warnings =
      {};  // what checks of the recordings found: clipped channels, ...
};

[[nodiscard]] nlohmann::ordered_json verdict_json(const Diagnosis& diagnosis,
                                                  std::span<const Hypothesis> hypotheses,
                                                  const DiagnosedFiles& files);

// The first pair of explanations that an experiment can tell apart; null pointers if there is none.
struct NextQuestion {
  const FoundEffect* effect = nullptr;
  const Rival* rival = nullptr;
};
[[nodiscard]] NextQuestion next_question(const Diagnosis& diagnosis);

// What a user calls the element of effect i: "cubic spring at joint_3.gearbox".
[[nodiscard]] std::string element_name(const FoundEffect& effect,
                                       std::span<const Hypothesis> hypotheses);

}  // namespace graybox
