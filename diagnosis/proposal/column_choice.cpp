#include "diagnosis/proposal/column_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <set>
#include <string_view>

#include "diagnosis/proposal/drive_manner.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/recordings/late_signal.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

constexpr double kSame = 0.99999;    // correlation of a copy
constexpr double kOneMotion = 0.98;  // of a reference and what follows it
constexpr Eigen::Index kFewestSamples = 200;

int rank_of(const LogColumn& column) {
  if (column.answered) return -100;
  const ColumnWords& words = column.words;
  int rank = words.sure ? 0 : 50;
  if (words.is_reference && words.quantity != LogQuantity::kCommand) rank += 20;
  if (words.is_measured) rank -= 2;
  if (words.is_filtered) rank += 1;
  if (words.quantity == LogQuantity::kCurrent) rank += 4;
  if (words.quantity == LogQuantity::kVoltage) rank += 8;
  if (words.quantity == LogQuantity::kCommand) rank += 12;
  return rank;
}

// Two levels that nearly all samples are at, with jumps between them: no motion of a machine.
bool jumps_between_levels(const Eigen::VectorXd& values) {
  constexpr double kNear = 0.05, kJump = 0.5, kAtLevels = 0.95;
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  const std::size_t n = sorted.size();
  const double low = sorted[n / 50], high = sorted[n - 1 - n / 50], span = high - low;
  if (!(span > 0.0)) return false;
  const Eigen::ArrayXd steps = values.tail(values.size() - 1) - values.head(values.size() - 1);
  const Eigen::ArrayXd from_low = (values.array() - low).abs(),
                       from_high = (values.array() - high).abs();
  const auto at_levels = static_cast<double>((from_low.min(from_high) < kNear * span).count());
  return steps.abs().maxCoeff() > kJump * span && at_levels > kAtLevels * static_cast<double>(n);
}

std::vector<const LogColumn*> best_of(const std::vector<const LogColumn*>& columns) {
  int least = std::numeric_limits<int>::max();
  for (const LogColumn* column : columns) least = std::min(least, rank_of(*column));
  std::vector<const LogColumn*> best;
  for (const LogColumn* column : columns) {
    if (rank_of(*column) == least) best.push_back(column);
  }
  return best;
}

bool are_copies(const std::vector<const LogColumn*>& columns) {
  return std::ranges::all_of(columns, [&](const LogColumn* column) {
    return correlation(columns.front()->values, column->values) > kSame;
  });
}

// Whether a word of the title says by itself what the column is: "command", not "u".
bool is_told_by_word(const LogColumn& column) {
  constexpr std::size_t kLetters = 2;  // "t", "ts"
  return std::ranges::any_of(words_of(column.name), [&](const std::string& word) {
    return word.size() > kLetters && read_column_words(word, "").quantity == column.words.quantity;
  });
}

std::string reason_of(const LogColumn& column, std::size_t of) {
  if (column.answered) return "you said so";
  if (!column.evidence.empty()) return column.evidence;
  const bool is_title = column.words.sure || is_told_by_word(column);
  std::string reason = is_title ? "its title" : "a letter that usually means that";
  if (of > 1 && column.words.is_measured) reason += ", which says measured";
  return reason;
}

// Titles that are one but for the side or the place that each names: both are measured.
bool name_two_of_a_kind(const std::string& a, const std::string& b) {
  static constexpr auto kSides = std::to_array<std::string_view>(
      {"left",   "right", "l",      "r",      "front",  "rear",      "back",
       "upper",  "lower", "top",    "bottom", "inner",  "outer",     "fl",
       "fr",     "rl",    "rr",     "x",      "y",      "z",         "links",
       "rechts", "vorn",  "hinten", "gauche", "droite", "izquierda", "derecha"});
  const auto is_side = [](const std::string& word) {
    return std::ranges::find(kSides, word) != kSides.end() ||
           std::ranges::all_of(word, [](unsigned char c) { return std::isdigit(c) != 0; });
  };
  const std::vector<std::string> one = words_of(a), other = words_of(b);
  if (one.size() != other.size()) return false;
  std::size_t differ = 0;
  for (std::size_t k = 0; k < one.size(); ++k) {
    if (one[k] == other[k]) continue;
    if (!is_side(one[k]) || !is_side(other[k])) return false;
    ++differ;
  }
  return differ > 0;
}

// The noise of a signal over its deviation, by the median of its third differences: about that of
// white noise, 0 of steps and ramps, and nearly so of what is smooth between samples.
double noise_of(const Eigen::VectorXd& values) {
  constexpr double kOfMedian = 1.4826;
  const Eigen::Index n = values.size() - 3;
  const double deviation = std::sqrt((values.array() - values.mean()).square().mean());
  if (n < 1 || !(deviation > 0.0)) return 0.0;
  const Eigen::VectorXd differences =
      values.tail(n) - 3.0 * values.segment(2, n) + 3.0 * values.segment(1, n) - values.head(n);
  return kOfMedian * quantile(differences.cwiseAbs(), 0.5) / (std::sqrt(20.0) * deviation);
}

// Whether a column has noise of its own, as what is measured has and a reference has not.
bool has_noise_as(const LogColumn& earlier, const LogColumn& later) {
  constexpr double kClear = 1e-3, kAlike = 0.5;
  const double noise = noise_of(earlier.values);
  return noise > kClear && noise > kAlike * noise_of(later.values);
}

// The follower of two columns, one the reference of the other; null if neither is later, or both
// are measured.
const LogColumn* follower(const LogColumn& a, const LogColumn& b) {
  if (a.values.size() < kFewestSamples || !a.values.allFinite() || !b.values.allFinite() ||
      name_two_of_a_kind(a.name, b.name) || correlation(a.values, b.values) < kOneMotion) {
    return nullptr;
  }
  const LateFit fit = compare_late(a.values, b.values, 1.0).best();
  if (std::abs(fit.late) < 4.0 * fit.late_error) return nullptr;
  const LogColumn &later = fit.late > 0.0 ? b : a, &earlier = fit.late > 0.0 ? a : b;
  return has_noise_as(earlier, later) ? nullptr : &later;
}

// Those that do not hardly move, and those of which the user said what they are.
std::vector<const LogColumn*> without_supplies(const std::vector<const LogColumn*>& moving,
                                               const std::vector<LogRecording>& recordings) {
  std::vector<const LogColumn*> lively;
  for (const LogColumn* column : moving) {
    if (column->answered || !manner_of_drive(*column, recordings).hardly_moves) {
      lively.push_back(column);
    }
  }
  return lively;
}

bool is_measured_force(const LogColumn& column) {
  const LogQuantity quantity = column.words.quantity;
  return !column.words.is_reference && column.words.sure &&
         (quantity == LogQuantity::kForce || quantity == LogQuantity::kCurrent);
}

// A column that may be the drive as well as the chosen one.
const LogColumn* rival_of(const LogColumn& chosen, const DriveManner& manner,
                          const std::vector<const LogColumn*>& lively,
                          const std::vector<LogRecording>& recordings) {
  for (const LogColumn* other : lively) {
    if (other == &chosen || other->words.is_reference || !disagree(chosen, *other)) continue;
    const bool is_like = is_measured_force(chosen) && is_measured_force(*other) &&
                         chosen.words.quantity != other->words.quantity;
    const bool has_the_sign =
        manner.has_one_sign && !manner_of_drive(*other, recordings).has_one_sign;
    if (is_like || has_the_sign) return other;
  }
  return nullptr;
}

bool is_doubtful(const DriveManner& manner) {
  constexpr double kFollows = 0.3;
  return manner.hardly_moves ||
         (manner.has_one_sign && !manner.lost_sign && manner.follows < kFollows);
}

std::string doubt_of(const LogColumn& drive, const DriveManner& manner) {
  if (manner.sign_bit) {
    return fmt::format(
        "'{}' jumps as a number does that has {}: it is taken as recorded, and wrong; write {} "
        "(no preprocess does it)",
        drive.name, manner.sign_bit->words(), manner.sign_bit->mend());
  }
  const char* never = manner.has_one_sign ? "never" : "hardly ever";
  if (manner.lost_sign) {
    return fmt::format(
        "'{}' is {} of the other sign while the axis moves both ways, and its size follows the "
        "motion: its sign seems lost; log its direction, too, and multiply the two (kind: product)",
        drive.name, never);
  }
  if (!manner.has_one_sign && !manner.has_nearly_one_sign) return "";
  return fmt::format(
      "'{}' {} changes its sign while the axis moves both ways: so it is where it bears a weight "
      "or a spring; else another column drives, or its sign was lost",
      drive.name, never);
}

}  // namespace

bool is_guessed_switch(const LogColumn& column) {
  constexpr std::size_t kFewValues = 5;
  const bool is_guess = !column.answered && !column.words.sure && column.evidence.empty();
  const Eigen::VectorXd values = without_gaps(column.values);
  if (!is_guess || values.size() < kFewestSamples) return false;
  std::set<double> different;
  for (const double each : values) {
    if (different.size() <= kFewValues) different.insert(each);
  }
  return different.size() <= kFewValues || jumps_between_levels(values);
}

bool is_wanted(const LogColumn& column) { return column.words.is_reference && !column.answered; }

double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  if (a.size() != b.size()) return 0.0;
  const Eigen::ArrayXd x = a.array() - a.mean(), y = b.array() - b.mean();
  const double norm = std::sqrt(x.square().sum() * y.square().sum());
  return norm > 0.0 ? (x * y).sum() / norm : 0.0;
}

std::string names_of(const std::vector<const LogColumn*>& columns) {
  std::string names;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const char* before = k == 0 ? "" : k + 1 == columns.size() ? " or " : ", ";
    names += fmt::format("{}'{}'", before, columns[k]->name);
  }
  return names;
}

std::vector<const LogColumn*> moving_columns(const std::vector<const LogColumn*>& columns,
                                             LogQuantity quantity) {
  std::vector<const LogColumn*> moving;
  for (const LogColumn* column : columns) {
    if (column->words.quantity == quantity && column->moves() && !column->is_goal)
      moving.push_back(column);
  }
  return moving;
}

ColumnChoice choose_drive(const std::vector<const LogColumn*>& columns,
                          const std::vector<LogRecording>& recordings) {
  std::vector<const LogColumn*> moving;
  for (const LogColumn* column : columns) {
    if (drives(column->words.quantity) && column->moves()) moving.push_back(column);
  }
  if (moving.empty()) {
    // A step that began before the log is constant in it.
    const auto stated = std::ranges::find_if(columns, [](const LogColumn* column) {
      return drives(column->words.quantity) && column->answered;
    });
    if (stated == columns.end()) return {};
    return {*stated, "you said so; it does not change in these logs", {}};
  }
  const std::vector<const LogColumn*> lively = without_supplies(moving, recordings);
  const std::vector<const LogColumn*> best = best_of(lively.empty() ? moving : lively);
  if (best.size() > 1 && !are_copies(best)) return {nullptr, "", best};
  const LogColumn* chosen = best.front();
  if (chosen->answered) return {chosen, reason_of(*chosen, moving.size())};
  const DriveManner manner = manner_of_drive(*chosen, recordings);
  if (const LogColumn* rival = rival_of(*chosen, manner, lively, recordings); rival != nullptr) {
    return {nullptr, "", {chosen, rival}};
  }
  if (is_doubtful(manner)) return {nullptr, "", {chosen}, doubt_words(*chosen, manner)};
  return {chosen, reason_of(*chosen, moving.size()), {}, doubt_of(*chosen, manner)};
}

ColumnChoice choose_measured(const std::vector<const LogColumn*>& columns, LogQuantity quantity) {
  std::vector<const LogColumn*> moving = moving_columns(columns, quantity);
  std::erase_if(moving, [](const LogColumn* column) {
    return is_wanted(*column) || is_guessed_switch(*column);
  });
  if (moving.empty()) return {};
  const std::vector<const LogColumn*> best = best_of(moving);
  if (best.size() == 1 || are_copies(best)) {
    return {best.front(), reason_of(*best.front(), moving.size())};
  }
  if (best.size() == 2) {
    if (const LogColumn* later = follower(*best[0], *best[1]); later != nullptr) {
      const LogColumn* earlier = later == best[0] ? best[1] : best[0];
      return {later, fmt::format("it follows '{}', a reference", earlier->name)};
    }
  }
  return {nullptr, "", best};
}

namespace {

std::string answer_of(const LogColumn& column) {
  const bool is_known = drives(column.words.quantity);
  return fmt::format("{}={}", column.name, is_known ? name_of(column.words.quantity) : "command");
}

// Columns that may be a command, though their titles say something else.
void offer_commands(const std::vector<const LogColumn*>& columns, OpenQuestion& question) {
  for (const LogColumn* column : columns) {
    if (!column->moves() || column->answered) continue;
    const ColumnWords& words = column->words;
    const std::vector<std::string> title = words_of(column->name);
    const bool is_speed = words.quantity == LogQuantity::kVelocity;
    const bool is_volts = is_speed && !words.sure && column->name.front() == 'V';  // "V_m"
    const bool is_power =
        words.quantity == LogQuantity::kOther && std::ranges::find(title, "power") != title.end();
    if (!is_volts && !is_power && !(is_speed && words.is_reference)) continue;
    const char* answer = is_volts ? "voltage" : "command";
    const char* what = is_volts   ? "a voltage"
                       : is_power ? "a power that is commanded"
                                  : "a speed that is commanded";
    question.choices.push_back({fmt::format("'{}', {}", column->name, what),
                                {fmt::format("{}={}", column->name, answer)}});
    question.option +=
        fmt::format(", or --column '{}={}' if that is {}", column->name, answer, what);
  }
}

// A reference of a position. Where it never changes the step to it came before the first row: then
// a title without a word for a quantity may be one, too, beside a position that moves.
bool may_be_goal(const LogColumn& column, const std::vector<const LogColumn*>& columns) {
  const LogQuantity quantity = column.words.quantity;
  if (!column.words.is_reference || column.is_goal) return false;
  if (column.moves()) return quantity == LogQuantity::kPosition;
  if (column.answered || !column.values.array().isFinite().any()) return false;
  const std::vector<const LogColumn*> places = moving_columns(columns, LogQuantity::kPosition);
  const bool is_beside_place = std::ranges::any_of(
      places, [](const LogColumn* place) { return !place->words.is_reference; });
  return is_beside_place &&
         (quantity == LogQuantity::kPosition || quantity == LogQuantity::kUnknown);
}

}  // namespace

const LogColumn* goal_among(const std::vector<const LogColumn*>& columns) {
  const auto found = std::ranges::find_if(columns, &LogColumn::is_goal);
  return found == columns.end() ? nullptr : *found;
}

void offer_goals(const std::vector<const LogColumn*>& columns, OpenQuestion& question) {
  for (const LogColumn* column : columns) {
    if (!may_be_goal(*column, columns)) continue;
    question.choices.push_back(
        {fmt::format("a position servo that follows '{}', a reference", column->name),
         {column->name + "=goal"}});
    question.option +=
        fmt::format(", or --column '{}=goal' for a servo that drives by '{}' - position",
                    column->name, column->name);
  }
}

void note_reference(const LogColumn& drive, std::vector<std::string>& notes) {
  const ColumnWords title = read_column_words(drive.name, drive.stated_unit);
  if (!drive.answered || !title.is_reference || title.quantity != LogQuantity::kPosition) return;
  notes.push_back(fmt::format(
      "'{}' is a position's reference by its title: a servo follows it, and the position is its "
      "answer, not that of a machine to a force. Say --column '{}=goal' to take what is left of it "
      "for the drive",
      drive.name, drive.name));
}

OpenQuestion question_of_drives(const std::vector<const LogColumn*>& rivals, MotionKind motion) {
  OpenQuestion question = which_of(rivals, "force, torque, current or command that drives");
  for (std::size_t k = 0; k < rivals.size(); ++k) {
    question.choices[k].columns = {answer_of(*rivals[k])};
  }
  const bool all_known = std::ranges::all_of(
      rivals, [](const LogColumn* rival) { return drives(rival->words.quantity); });
  question.option = fmt::format("--column '{}={}', say", rivals.front()->name,
                                motion == MotionKind::kLinear ? "force" : "torque");
  constexpr std::size_t kFew = 3;
  if (!all_known || rivals.size() > kFew) return question;
  question.option.clear();
  for (const LogColumn* rival : rivals) {
    question.option +=
        fmt::format("{}--column '{}'", question.option.empty() ? "" : " or ", answer_of(*rival));
  }
  return question;
}

OpenQuestion question_of_doubt(const ColumnChoice& choice,
                               const std::vector<const LogColumn*>& open) {
  const LogColumn& column = *choice.rivals.front();
  const std::string other = open.empty() ? "OTHER" : open.front()->name;
  OpenQuestion question;
  question.text = fmt::format("Is '{}' the drive? It {}.", column.name, choice.doubt);
  question.option =
      fmt::format("--column '{}' if it is; else --column '{}=ignore' --column '{}=torque'{}",
                  answer_of(column), column.name, other, open.empty() ? "" : ", say");
  question.choices = {{"it is the drive", {answer_of(column)}}};
  for (const LogColumn* each : open) {
    question.choices.push_back(
        {fmt::format("'{}' is", each->name), {answer_of(*each), column.name + "=ignore"}});
  }
  question.choices.push_back({"it is not", {column.name + "=ignore"}});
  return question;
}

OpenQuestion question_of_no_drive(const std::vector<const LogColumn*>& columns) {
  OpenQuestion question;
  question.text = fmt::format(
      "What drives the machine? No column is a force, torque, current, voltage or command that "
      "moves{}.",
      still_columns(columns));
  question.option = "--no-drive if no force acts (a run-down, a free swing)";
  question.choices = {{"nothing: a run-down or a free swing", {}, true}};
  for (const LogColumn* column : moving_columns(columns, LogQuantity::kAcceleration)) {
    if (column->words.side != DriveSide::kMotor && !column->words.is_reference) continue;
    question.choices.push_back(
        {fmt::format("'{}', an acceleration that is commanded", column->name),
         {column->name + "=command"}});
    question.option += fmt::format(", or --column '{}=command' if that is commanded", column->name);
  }
  offer_commands(columns, question);
  offer_goals(columns, question);
  bool has_still_drive = false;
  for (const LogColumn* column : columns) {
    if (!drives(column->words.quantity) || column->moves() || column->values(0) == 0.0) continue;
    has_still_drive = true;
    question.option +=
        fmt::format(", or --column '{}' if that drives and stays the same", answer_of(*column));
    question.choices.push_back(
        {fmt::format("'{}', which stays the same", column->name), {answer_of(*column)}});
  }
  if (!has_still_drive) question.option += ", or --column NAME=torque";
  return question;
}

std::string still_columns(const std::vector<const LogColumn*>& columns) {
  std::string names;
  for (const LogColumn* column : columns) {
    const LogQuantity quantity = column->words.quantity;
    const bool is_motion = quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity;
    if (column->moves() || is_motion) continue;
    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", column->name);
  }
  return names.empty() ? names : fmt::format(" (constant here: {})", names);
}

std::string words_of_accelerations(const std::vector<const LogColumn*>& columns) {
  return moving_columns(columns, LogQuantity::kAcceleration).empty()
             ? ""
             : "; accelerations alone are not proposed: write the model by hand, with 'quantity: "
               "acceleration' at its output";
}

}  // namespace graybox
