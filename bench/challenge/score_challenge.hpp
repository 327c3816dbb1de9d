// Scores the answers to a challenge against its unsealed truth.
//
// An answer's effect is a class. Its members are the law at a place that it names, the alternatives
// that it says the data can't exclude, and the more general laws that it names beside these. Where
// a verdict says that one law is the same system at several places, each place counts as a member.
// For a case with one detectable effect:
//
//   right            verdict explained, one effect: the true law at the true place, no alternatives
//   in_class         the truth is in the class of one of the effects named, of at most 3 members
//   in_large_class   the same, more than 3 members
//   wrong_confident  explained, and the truth is in no class
//   wrong_ambiguous  ambiguous, and the truth is in no class
//   unknown, none    the verdict; `unknown` also where it lists laws found so far
//   no_answer        the diagnosis crashed, refused or ran out of time
//
// An explained case that names the truth and one effect too many is `in_class` with `extra` set:
// the truth is named, but not alone; it does not count as right. Cases with two effects count as
// right where both are in classes of at most 3 of different effects of a verdict explained or
// ambiguous. Cases outside the catalogue: right is `unknown`, or a nearest law whose own held-out
// test fails (`nearest_law_fails`: the answer is ambiguous and says that it does not predict what
// was kept out, `predicts_kept_out`); what passed on held-out data is `nearest_law`. Effects that
// are not detectable are tabulated apart.
//
// In the set `any_motion` names count as systems (same_system.hpp) everywhere above: the truth is
// named by any law and place that are the same system, and classes are as large as they have
// systems. An asymmetric dry friction is also named by a dry friction and an offset, two effects at
// its place. An explained case holds on recordings kept out if the answer says so and their error
// is below 15 % of the signal (or chi-square over degrees of freedom below 1.1, the rule of the
// periodic set). Three rates go by the laws that an answer lists, whatever its verdict:
// `false_laws`, `detectable_found` and `two_effects_found`. An `unknown` that lists the truth is no
// name, but it is found.
//
// Rates that end in `_as_systems` count a law at places that make one system (a delay of the only
// actuator or the only sensor) as one member. Alternatives that the answer only names, as the same
// in such recordings, count so too. Parameters that an answer gives without a standard error, as
// not determined by the data, are no claim: counted apart.
//
// Rates come with Wilson's 95 % interval (Wilson 1927).
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "bench/challenge/seal.hpp"

namespace graybox::bench {

struct Rate {
  std::size_t hits = 0, of = 0;
  [[nodiscard]] double value() const {
    return of > 0 ? static_cast<double>(hits) / static_cast<double>(of) : 0.0;
  }
};
struct Interval {
  double low = 0.0, high = 1.0;
};
// (p + z^2/2n +- z sqrt(p (1-p)/n + z^2/4n^2)) / (1 + z^2/n), z = 1.96 (97.5 %); [0, 1] for n = 0.
[[nodiscard]] Interval wilson_interval(const Rate& rate);

// ---- answers ------------------------------------------------------------------------------------

struct AnsweredParameter {
  double value = 0.0, standard_error = 0.0;
};
struct AnsweredLaw {
  std::string place, law;
  std::map<std::string, AnsweredParameter> parameters;
  bool is_same_system = false;  // as another of the class
};
struct Answer {
  bool given = false;
  std::string verdict;                            // none | explained | ambiguous | unknown
  std::vector<std::vector<AnsweredLaw>> effects;  // classes, the law named first
  double validation = 0.0;  // chi-square over degrees of freedom after, held-out; NaN: not given
  double error_kept_out = 0.0;  // over the signal, rms, of what was held out; NaN: not given
  double seconds = 0.0;
  bool predicts = true;   // what was kept out, to the noise floor
  bool confined = false;  // the diagnosis could open nothing but its case
};
// Of one case's folder of answers. Throws InputError for a verdict.json that is no verdict.
[[nodiscard]] Answer read_answer(const std::filesystem::path& folder);

// ---- one case -----------------------------------------------------------------------------------

struct ScoredCase {
  CaseTruth truth;
  Answer answer;
  std::string outcome{};         // as above; for two effects also both | one
  std::size_t class_size = 0;    // of the class that holds the truth
  std::size_t systems = 0;       // in that class
  bool named_as_system = false;  // all effects in classes of at most 3 systems, in a final verdict
  bool all_listed = false;       // all effects are in classes, in any verdict
  bool named_alone = false;      // one effect is there and named, without alternatives
  bool extra = false;            // more effects than there are
  bool place_right = false;      // the first effect's place is a true one
  std::size_t parameters = 0;    // compared
  std::size_t undetermined = 0;  // not compared: not determined by the data, the answer says
  std::size_t within_three = 0;  // of them within 3 standard errors
};
[[nodiscard]] ScoredCase score_case(const CaseTruth& truth, const Answer& answer);

// ---- all ----------------------------------------------------------------------------------------

struct Score {
  ChallengeOrigin origin;
  std::string truth_sha256;  // the seal that was published with the cases
  std::vector<ScoredCase> cases;
  std::vector<ScoredCase>
      left_out;  // answers of `run --without-named` where the law named was right
  // Cases that `run` has not come to, or not ended: they count as no answer.
  std::size_t not_run = 0;
};

struct ScoreOptions {
  std::filesystem::path cases, answers, truth;
  std::filesystem::path left_out;  // answers of `run --without-named`; empty: none
};
// Throws InputError for a broken seal, and for answers to another challenge.
[[nodiscard]] Score score_challenge(const ScoreOptions& options);

struct NamedRate {
  std::string name;    // "false_alarms", "detectable_named", ...
  std::string target;  // of the project, in words
  Rate rate;
};
[[nodiscard]] std::vector<NamedRate> rates_of(const Score& score);
[[nodiscard]] nlohmann::ordered_json score_json(const Score& score);
[[nodiscard]] std::string score_text(const Score& score);

// Writes challenge_cases.csv, challenge_confusion.csv, challenge_sizes.csv, challenge_classes.csv
// and, where laws were left out, challenge_left_out.csv into `folder`. Those of the set
// `any_motion` are named challenge_any_motion_cases.csv and so on. It has
// challenge_any_motion_refusal.csv besides: what a limit on the error of recordings kept out
// would refuse, outside the catalogue and inside. The rates of all sets are in
// challenge_rates.csv: those of other sets that are there stay.
void write_score_tables(const Score& score, const std::filesystem::path& folder);

// Appends one line, with the name of the set, to a CSV file, with its header where it is new:
// counts, the seal, and in how many of the cases the diagnosis was confined. Throws InputError
// unless the challenge's seed is that of its commit and all cases have been run, and for a file
// with other columns.
void append_history(const Score& score, const std::filesystem::path& file);

}  // namespace graybox::bench
