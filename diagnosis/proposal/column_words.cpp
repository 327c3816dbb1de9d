#include "diagnosis/proposal/column_words.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <regex>
#include <span>
#include <utility>

#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

// Words that are a unit where they end a title, each joined by one blank.
using UnitWord = std::pair<std::string_view, std::string_view>;
constexpr auto kUnitWords = std::to_array<UnitWord>({
    {"rad s", "rad/s"},     {"rad sec", "rad/s"},
    {"rad per s", "rad/s"}, {"radps", "rad/s"},
    {"rads", "rad/s"},      {"rad s 2", "rad/s^2"},
    {"deg s", "deg/s"},     {"deg sec", "deg/s"},
    {"deg per s", "deg/s"}, {"degps", "deg/s"},
    {"dps", "deg/s"},       {"degs", "deg/s"},
    {"deg s 2", "deg/s^2"}, {"rpm", "rpm"},
    {"1 min", "rpm"},       {"rev min", "rpm"},
    {"u min", "rpm"},       {"min 1", "rpm"},
    {"rps", "turn/s"},      {"rev s", "turn/s"},
    {"turn s", "turn/s"},   {"turns s", "turn/s"},
    {"m s", "m/s"},         {"mps", "m/s"},
    {"m per s", "m/s"},     {"m sec", "m/s"},
    {"mm s", "mm/s"},       {"mm per s", "mm/s"},
    {"mmps", "mm/s"},       {"in s", "in/s"},
    {"m s 2", "m/s^2"},     {"m s2", "m/s^2"},
    {"rad", "rad"},         {"radian", "rad"},
    {"radians", "rad"},     {"mrad", "mrad"},
    {"deg", "deg"},         {"degree", "deg"},
    {"degrees", "deg"},     {"turn", "turn"},
    {"turns", "turn"},      {"rev", "turn"},
    {"revs", "turn"},       {"counts", "counts"},
    {"count", "counts"},    {"cnt", "counts"},
    {"cnts", "counts"},     {"ticks", "counts"},
    {"tick", "counts"},     {"inc", "counts"},
    {"incr", "counts"},     {"increments", "counts"},
    {"mm", "mm"},           {"um", "um"},
    {"n m", "N m"},         {"nm", "N m"},
    {"mnm", "mN m"},        {"mn m", "mN m"},
    {"knm", "kN m"},        {"kn", "kN"},
    {"lbf", "lbf"},         {"kip", "kip"},
    {"newton", "N"},        {"amp", "A"},
    {"amps", "A"},          {"ampere", "A"},
    {"ma", "mA"},           {"volt", "V"},
    {"volts", "V"},         {"mv", "mV"},
    {"sec", "s"},           {"secs", "s"},
    {"seconds", "s"},       {"ms", "ms"},
    {"msec", "ms"},         {"millis", "ms"},
    {"milliseconds", "ms"}, {"us", "us"},
    {"usec", "us"},         {"micros", "us"},
    {"microseconds", "us"}, {"ns", "ns"},
    {"nsec", "ns"},         {"nanoseconds", "ns"},
    {"m nm", "mN m"},       {"m n m", "mN m"},
    {"m a", "mA"},          {"m v", "mV"},
    {"k n", "kN"},          {"k nm", "kN m"},
    {"k n m", "kN m"},
});

// Units that units.hpp has no name for, as a multiple of one that it has.
struct ScaledUnit {
  std::string_view words, unit;
  double factor;
};
constexpr double kStandardGravity = 9.80665;
constexpr auto kScaledUnits = std::to_array<ScaledUnit>({
    {"cm", "m", 0.01},
    {"cm s", "m/s", 0.01},
    {"km h", "m/s", 1.0 / 3.6},
    {"mrad s", "rad/s", 1e-3},
    {"m n", "N", 1e-3},
    {"mn", "N", 1e-3},
    {"kgf", "N", kStandardGravity},
    {"kg f", "N", kStandardGravity},
    {"n cm", "N m", 0.01},
    {"ncm", "N m", 0.01},
    {"n mm", "N m", 1e-3},
    {"nmm", "N m", 1e-3},
    {"u nm", "N m", 1e-6},
    {"u n m", "N m", 1e-6},
    {"kg cm", "N m", 0.01 * kStandardGravity},
    {"kgf cm", "N m", 0.01 * kStandardGravity},
    {"u a", "A", 1e-6},
    {"ua", "A", 1e-6},
});

struct QuantityWord {
  std::string_view word;
  LogQuantity quantity;
  MotionKind motion = MotionKind::kOpen;
};

// Whole words; where several are in one title the first row that is there decides.
constexpr auto kQuantityWords = std::to_array<QuantityWord>({
    {"error", LogQuantity::kOther},
    {"err", LogQuantity::kOther},
    {"fehler", LogQuantity::kOther},
    {"temp", LogQuantity::kOther},
    {"temperature", LogQuantity::kOther},
    {"temperatur", LogQuantity::kOther},
    {"vdc", LogQuantity::kOther},
    {"udc", LogQuantity::kOther},
    {"vbus", LogQuantity::kOther},
    {"bus", LogQuantity::kOther},
    {"supply", LogQuantity::kOther},
    {"battery", LogQuantity::kOther},
    {"power", LogQuantity::kOther},
    {"status", LogQuantity::kOther},
    {"state", LogQuantity::kOther},
    {"mode", LogQuantity::kOther},
    {"flag", LogQuantity::kOther},
    {"id", LogQuantity::kOther},
    {"index", LogQuantity::kOther},
    {"seq", LogQuantity::kOther},
    {"sample", LogQuantity::kOther},
    {"samples", LogQuantity::kOther},
    {"time", LogQuantity::kTime},
    {"timestamp", LogQuantity::kTime},
    {"stamp", LogQuantity::kTime},
    {"zeit", LogQuantity::kTime},
    {"elapsed", LogQuantity::kTime},
    {"clock", LogQuantity::kTime},
    {"ddq", LogQuantity::kAcceleration},
    {"qdd", LogQuantity::kAcceleration},
    {"ddot", LogQuantity::kAcceleration},
    {"acc", LogQuantity::kAcceleration},
    {"accel", LogQuantity::kAcceleration},
    {"acceleration", LogQuantity::kAcceleration},
    {"beschleunigung", LogQuantity::kAcceleration},
    {"dq", LogQuantity::kVelocity},
    {"qdot", LogQuantity::kVelocity},
    {"dot", LogQuantity::kVelocity},
    {"vel", LogQuantity::kVelocity},
    {"velocity", LogQuantity::kVelocity},
    {"velocities", LogQuantity::kVelocity},
    {"qvel", LogQuantity::kVelocity},
    {"jvel", LogQuantity::kVelocity},
    {"speed", LogQuantity::kVelocity},
    {"tacho", LogQuantity::kVelocity},
    {"tach", LogQuantity::kVelocity},
    {"tachometer", LogQuantity::kVelocity},
    {"rate", LogQuantity::kVelocity},
    {"drehzahl", LogQuantity::kVelocity, MotionKind::kRotary},
    {"geschwindigkeit", LogQuantity::kVelocity},
    {"omega", LogQuantity::kVelocity, MotionKind::kRotary},
    {"dtheta", LogQuantity::kVelocity, MotionKind::kRotary},
    {"thetadot", LogQuantity::kVelocity, MotionKind::kRotary},
    {"dphi", LogQuantity::kVelocity, MotionKind::kRotary},
    {"dx", LogQuantity::kVelocity, MotionKind::kLinear},
    {"xdot", LogQuantity::kVelocity, MotionKind::kLinear},
    {"pos", LogQuantity::kPosition},
    {"position", LogQuantity::kPosition},
    {"positions", LogQuantity::kPosition},
    {"qpos", LogQuantity::kPosition},
    {"jpos", LogQuantity::kPosition},
    {"theta", LogQuantity::kPosition, MotionKind::kRotary},
    {"phi", LogQuantity::kPosition, MotionKind::kRotary},
    {"angle", LogQuantity::kPosition, MotionKind::kRotary},
    {"ang", LogQuantity::kPosition, MotionKind::kRotary},
    {"winkel", LogQuantity::kPosition, MotionKind::kRotary},
    {"enc", LogQuantity::kPosition},
    {"encoder", LogQuantity::kPosition},
    {"disp", LogQuantity::kPosition, MotionKind::kLinear},
    {"displacement", LogQuantity::kPosition, MotionKind::kLinear},
    {"travel", LogQuantity::kPosition, MotionKind::kLinear},
    {"stroke", LogQuantity::kPosition, MotionKind::kLinear},
    {"weg", LogQuantity::kPosition, MotionKind::kLinear},
    {"lage", LogQuantity::kPosition},
    {"tau", LogQuantity::kForce, MotionKind::kRotary},
    {"torque", LogQuantity::kForce, MotionKind::kRotary},
    {"torques", LogQuantity::kForce, MotionKind::kRotary},
    {"trq", LogQuantity::kForce, MotionKind::kRotary},
    {"moment", LogQuantity::kForce, MotionKind::kRotary},
    {"drehmoment", LogQuantity::kForce, MotionKind::kRotary},
    {"effort", LogQuantity::kForce},
    {"efforts", LogQuantity::kForce},
    {"eff", LogQuantity::kForce},
    {"force", LogQuantity::kForce, MotionKind::kLinear},
    {"kraft", LogQuantity::kForce, MotionKind::kLinear},
    {"voltage", LogQuantity::kVoltage},
    {"volt", LogQuantity::kVoltage},
    {"spannung", LogQuantity::kVoltage},
    {"iq", LogQuantity::kCurrent},
    {"current", LogQuantity::kCurrent},
    {"currents", LogQuantity::kCurrent},
    {"curr", LogQuantity::kCurrent},
    {"cur", LogQuantity::kCurrent},
    {"strom", LogQuantity::kCurrent},
    {"pwm", LogQuantity::kCommand},
    {"duty", LogQuantity::kCommand},
    {"throttle", LogQuantity::kCommand},
    {"input", LogQuantity::kCommand},
    {"control", LogQuantity::kCommand},
});

// Letters that people use; another signal may be meant.
constexpr auto kLetters = std::to_array<QuantityWord>({
    {"t", LogQuantity::kTime},
    {"qd", LogQuantity::kVelocity},
    {"w", LogQuantity::kVelocity, MotionKind::kRotary},
    {"v", LogQuantity::kVelocity},
    {"q", LogQuantity::kPosition},
    {"qm", LogQuantity::kPosition},
    {"qg", LogQuantity::kPosition},
    {"th", LogQuantity::kPosition, MotionKind::kRotary},
    {"x", LogQuantity::kPosition, MotionKind::kLinear},
    {"y", LogQuantity::kPosition},
    {"i", LogQuantity::kCurrent},
    {"f", LogQuantity::kForce, MotionKind::kLinear},
    {"u", LogQuantity::kCommand},
    {"cmd", LogQuantity::kCommand},
});

// How a signal came to be, and where in the machine it is.
using Word = std::string_view;
constexpr auto kReferenceWords =
    std::to_array<Word>({"ref", "refx", "reference", "des", "desired", "target", "set", "setpoint",
                         "sp", "goal", "cmd", "command", "commanded", "demand", "soll", "planned"});
constexpr auto kMeasuredWords = std::to_array<Word>(
    {"meas", "measured", "act", "actual", "adx", "ad", "fb", "fbk", "feedback", "ist", "sensor"});
constexpr auto kFilteredWords = std::to_array<Word>({"filt", "filtered", "smooth", "lp"});
constexpr auto kLoadWords =
    std::to_array<Word>({"load", "link", "arm", "out", "output", "last", "abtrieb"});
constexpr auto kMotorWords = std::to_array<Word>({"motor", "mot", "rotor", "drive", "antrieb"});
constexpr auto kLinearWords = std::to_array<Word>({"carriage", "cart", "slide", "linear"});
// Others that stand in brackets and are no unit.
constexpr auto kNoteWords = std::to_array<Word>(
    {"axis",  "axes",       "achse",  "joint",      "gelenk", "channel",  "ch",
     "no",    "nr",         "number", "side",       "left",   "right",    "upper",
     "lower", "front",      "rear",   "x",          "y",      "z",        "st",
     "nd",    "rd",         "th",     "calculated", "calc",   "computed", "estimated",
     "est",   "unfiltered", "robot",  "encoder",    "signal", "sim",      "simulated",
     "none",  "unknown",    "na",     "total",      "sum",    "mean",     "average"});

using Words = std::vector<std::string>;

bool has_any(const Words& words, std::span<const std::string_view> list) {
  return std::ranges::any_of(
      words, [&](const std::string& word) { return std::ranges::find(list, word) != list.end(); });
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  std::string result;
  std::size_t begin = 0;
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, begin)) {
    result.append(text, begin, at - begin).append(to);
    begin = at + from.size();
  }
  result.append(text, begin);
  text = std::move(result);
}

// Signs of units as letters.
std::string spelled_out(std::string_view text) {
  std::string result(text);
  replace_all(result, "\xC2\xB0", " deg ");  // degree sign
  replace_all(result, "\xC2\xB5", "u");      // micro sign
  replace_all(result, "\xCE\xBC", "u");      // mu
  replace_all(result, "\xC2\xB2", "2");      // squared
  replace_all(result, "\xB0", " deg ");      // degree sign, Latin 1
  return result;
}

std::string joined_words(std::span<const std::string> words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

WrittenUnit unit_of_words(std::string_view words) {
  for (const auto& [written, unit] : kUnitWords) {
    if (written == words) return {std::string(unit), 1.0};
  }
  for (const ScaledUnit& row : kScaledUnits) {
    if (row.words == words) return {std::string(row.unit), row.factor};
  }
  return {};
}

// A unit without a number.
WrittenUnit plain_unit(const std::string& text) {
  const std::string plain(trimmed(text));
  if (find_unit(plain) != nullptr) return {plain, 1.0};
  return unit_of_words(joined_words(words_of(plain)));
}

// "1e-3", "0.1", "10^-3"; 0 for what is no number above zero.
double number_above_zero(const std::string& text) {
  const std::size_t power = text.find('^');
  const std::string digits = power == std::string::npos ? text : text.substr(power + 1);
  char* end = nullptr;
  const double value = std::strtod(digits.c_str(), &end);
  if (end == digits.c_str() || *end != '\0') return 0.0;
  const double number = power == std::string::npos ? value : std::pow(10.0, value);
  return std::isfinite(number) && number > 0.0 ? number : 0.0;
}

// A unit with a number before or behind it.
WrittenUnit unit_with_factor(const std::string& text) {
  static const std::string kNumber = R"((10\^[-+]?\d{1,2}|\d+\.?\d*(?:[eE][-+]?\d{1,2})?|\.\d+))";
  static const std::regex kBefore("^[xX*]?\\s*" + kNumber + "\\s*[xX*]?\\s*([^0-9\\s].*)$"),
      kBehind("^(.*[^\\s])\\s*([*/]|\\s[xX])\\s*" + kNumber + "$");
  std::smatch match;
  constexpr std::size_t kLongest = 40;
  if (text.size() > kLongest) return {};
  double number = 0.0;
  std::string rest;
  if (std::regex_match(text, match, kBefore)) {
    number = number_above_zero(match[1].str());
    rest = match[2].str();
  } else if (std::regex_match(text, match, kBehind)) {
    number = number_above_zero(match[3].str());
    if (match[2].str() == "/" && number > 0.0) number = 1.0 / number;
    rest = match[1].str();
  }
  if (!(number > 0.0)) return {};
  WrittenUnit unit = plain_unit(rest);
  unit.factor *= number;
  return unit;
}

// A capital A, N or V, or a small m or s, that ends a title is a unit beside a quantity it fits.
std::string unit_letter(const std::string& letter, const ColumnWords& words) {
  const auto [quantity, motion] = std::pair(words.quantity, words.motion);
  const bool is_open = quantity == LogQuantity::kUnknown || !words.sure;
  if (letter == "A" && (is_open || quantity == LogQuantity::kCurrent)) return "A";
  if (letter == "V" &&
      (is_open || quantity == LogQuantity::kVoltage || quantity == LogQuantity::kCommand)) {
    return "V";
  }
  if (letter == "N" && (is_open || quantity == LogQuantity::kForce) &&
      motion != MotionKind::kRotary) {
    return "N";
  }
  if (letter == "m" && quantity == LogQuantity::kPosition &&
      (motion == MotionKind::kLinear || (words.sure && motion == MotionKind::kOpen))) {
    return "m";
  }
  return letter == "s" && quantity == LogQuantity::kTime ? "s" : "";
}

// Which of several signals it is, or a remark: no unit. In square brackets a remark is rare.
bool is_note(const std::string& inside, bool is_square) {
  const Words words = words_of(inside);
  constexpr std::size_t kLongestUnit = 2;  // words in round brackets
  if (words.empty() || (!is_square && words.size() > kLongestUnit)) return true;
  return std::ranges::all_of(words, [&](const std::string& word) {
    const Words one{word};
    const auto names = [&](const QuantityWord& row) { return row.word == word; };
    return std::isdigit(static_cast<unsigned char>(word[0])) != 0 ||
           std::ranges::any_of(kQuantityWords, names) || std::ranges::any_of(kLetters, names) ||
           has_any(one, kReferenceWords) || has_any(one, kMeasuredWords) ||
           has_any(one, kFilteredWords) || has_any(one, kLoadWords) || has_any(one, kMotorWords) ||
           has_any(one, kLinearWords) || has_any(one, kNoteWords) || (!is_square && word == "raw");
  });
}

// "10 LSB", but not "2nd axis": a number and then letters that are no ending of it.
bool begins_as_factor(const std::string& text) {
  static const std::regex kFactor(R"(^\s*[xX*]?\s*[0-9.]+\s*(?!st\b|nd\b|rd\b|th\b)[A-Za-z].*$)");
  constexpr std::size_t kLongest = 40;
  return text.size() <= kLongest && std::regex_match(text, kFactor);
}

// Takes the number in brackets behind an array's name, and the unit in brackets.
std::string without_brackets(std::string_view title, ColumnWords& result) {
  std::string text(title);
  for (const auto& [open, close] : {std::pair{'[', ']'}, std::pair{'(', ')'}}) {
    const std::size_t first = text.rfind(open), last = text.rfind(close);
    if (first == std::string::npos || last == std::string::npos || last < first) continue;
    const std::string inside = text.substr(first + 1, last - first - 1);
    const WrittenUnit unit = written_unit(inside);
    const bool is_number = !inside.empty() && std::ranges::all_of(inside, [](unsigned char c) {
      return std::isdigit(c);
    });
    const bool is_index = is_number && inside.size() < 4;
    if (unit.unit.empty() && !is_index && !begins_as_factor(inside) &&
        is_note(inside, open == '[')) {
      continue;
    }
    if (is_index) {
      result.index = std::stoi(inside);
    } else if (unit.unit.empty()) {
      result.odd_unit = inside;
    } else {
      result.unit = unit.unit;
      result.unit_factor = unit.factor;
      result.odd_unit.clear();
    }
    text.erase(first, last - first + 1);
  }
  return text;
}

// Words with the capitals as they were.
Words words_as_written(std::string_view title) {
  Words words;
  std::string word;
  const auto close = [&] {
    if (!word.empty()) words.push_back(word);
    word.clear();
  };
  unsigned char before = ' ';
  for (const char each : title) {
    const auto c = static_cast<unsigned char>(each);
    const bool breaks = (std::isdigit(c) != 0) != (std::isdigit(before) != 0) ||
                        (std::isupper(c) != 0 && std::islower(before) != 0);
    if (std::isalnum(c) == 0 || breaks) close();
    if (std::isalnum(c) != 0) word += each;
    before = c;
  }
  close();
  return words;
}

// The unit that the last words are; these go.
void take_unit_words(Words& words, ColumnWords& result) {
  for (std::size_t count = std::min<std::size_t>(3, words.size()); count > 0; --count) {
    if (count == words.size() && words.size() > 1) continue;
    const std::string text = joined_words(std::span(words).subspan(words.size() - count, count));
    const WrittenUnit unit = unit_of_words(text);
    // "m s" may end "theta_m_s"; a unit of one word may be a title of its own ("rpm").
    if (unit.unit.empty()) continue;
    if (result.unit.empty() && result.odd_unit.empty()) {
      result.unit = unit.unit;
      result.unit_factor = unit.factor;
    }
    words.resize(words.size() - count);
    return;
  }
}

// "xpos", "yvolt": the letter of an axis before a word for a quantity goes.
std::string without_axis(const std::string& word) {
  if (word.size() < 4 || std::string_view("xyz").find(word.front()) == std::string_view::npos) {
    return word;
  }
  const std::string rest = word.substr(1);
  const bool is_known = std::ranges::any_of(
      kQuantityWords, [&](const QuantityWord& row) { return row.word == rest; });
  return is_known ? rest : word;
}

void read_quantity(const Words& words, ColumnWords& result) {
  Words others = words;
  std::ranges::transform(others, others.begin(), without_axis);
  // "current position" is one that is, not a current.
  const bool has_other = std::ranges::any_of(kQuantityWords, [&](const QuantityWord& row) {
    return row.quantity != LogQuantity::kCurrent && row.quantity != LogQuantity::kOther &&
           row.quantity != LogQuantity::kCommand &&
           std::ranges::find(words, row.word) != words.end();
  });
  if (has_other) std::erase(others, "current");
  for (const QuantityWord& row : kQuantityWords) {
    if (std::ranges::find(others, row.word) == others.end()) continue;
    result.quantity = row.quantity;
    result.motion = row.motion;
    result.sure = true;
    return;
  }
  for (const QuantityWord& row : kLetters) {
    if (std::ranges::find(others, row.word) == others.end()) continue;
    result.quantity = row.quantity;
    result.motion = row.motion;
    return;
  }
}

// Whether a quantity that a whole word names can be in a unit of this one and this motion.
bool fits_quantity(LogQuantity by_unit, MotionKind motion_of_unit, const ColumnWords& words) {
  using Q = LogQuantity;
  const Q quantity = words.quantity;
  const bool is_open = by_unit == Q::kUnknown || quantity == Q::kUnknown || quantity == Q::kOther ||
                       quantity == Q::kCommand || !words.sure;
  if (is_open) return true;
  // A position in rpm is its rate: the unit decides.
  const bool is_rate =
      quantity == Q::kPosition &&
      (by_unit == Q::kVelocity || by_unit == Q::kTime || by_unit == Q::kAcceleration);
  if (is_rate) return true;
  const bool is_other_motion = words.motion != MotionKind::kOpen &&
                               motion_of_unit != MotionKind::kOpen &&
                               words.motion != motion_of_unit;
  return by_unit == quantity && !is_other_motion;
}

// What a unit adds: a title of a unit alone, and a quantity that is a letter.
void let_unit_decide(const Words& words, ColumnWords& result) {
  if (result.unit.empty()) return;
  const LogQuantity by_unit = quantity_of_unit(result.unit);
  const bool names_it = std::ranges::any_of(kQuantityWords, [&](const QuantityWord& row) {
    return row.quantity == by_unit && std::ranges::find(words, row.word) != words.end();
  });
  if (names_it && result.quantity != LogQuantity::kOther) result.quantity = by_unit;
  if (!fits_quantity(by_unit, motion_of_unit(result.unit), result)) {
    result.odd_unit = result.unit;
    result.unit.clear();
    result.unit_factor = 1.0;
    return;
  }
  if (by_unit != LogQuantity::kUnknown && result.quantity != LogQuantity::kOther &&
      (!result.sure || result.quantity == LogQuantity::kPosition)) {
    result.quantity = by_unit;
    result.sure = true;
  }
  if (const MotionKind motion = motion_of_unit(result.unit); motion != MotionKind::kOpen) {
    result.motion = motion;
  }
}

void read_manner(const Words& words, ColumnWords& result) {
  result.is_reference = has_any(words, kReferenceWords);
  result.is_measured = has_any(words, kMeasuredWords);
  result.is_filtered = has_any(words, kFilteredWords);
  if (has_any(words, kLoadWords)) result.side = DriveSide::kLoad;
  if (has_any(words, kMotorWords)) result.side = DriveSide::kMotor;
  if (result.motion == MotionKind::kOpen && has_any(words, kLinearWords)) {
    result.motion = MotionKind::kLinear;
  }
}

Words in_lower_case(Words words) {
  for (std::string& word : words) {
    std::ranges::transform(word, word.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  }
  return words;
}

}  // namespace

std::vector<std::string> words_of(std::string_view title) {
  return in_lower_case(words_as_written(spelled_out(title)));
}

WrittenUnit written_unit(std::string_view text) {
  std::string plain = spelled_out(trimmed(text));
  const WrittenUnit unit = plain_unit(plain);
  if (!unit.unit.empty()) return unit;
  replace_all(plain, "\xC3\x97", "*");  // times
  replace_all(plain, "\xC2\xB7", " ");  // middle dot
  return unit_with_factor(std::string(trimmed(plain)));
}

std::string unit_as_written(std::string_view text) {
  const WrittenUnit unit = written_unit(text);
  return unit.factor == 1.0 ? unit.unit : std::string();
}

LogQuantity quantity_of_unit(std::string_view unit) {
  const Unit* known = find_unit(unit);
  const std::string_view base = known == nullptr ? unit : known->base;
  constexpr std::array<std::pair<std::string_view, LogQuantity>, 12> kBases{{
      {"s", LogQuantity::kTime},
      {"rad", LogQuantity::kPosition},
      {"m", LogQuantity::kPosition},
      {"rad/s", LogQuantity::kVelocity},
      {"m/s", LogQuantity::kVelocity},
      {"rad/s^2", LogQuantity::kAcceleration},
      {"m/s^2", LogQuantity::kAcceleration},
      {"N", LogQuantity::kForce},
      {"N m", LogQuantity::kForce},
      {"A", LogQuantity::kCurrent},
      {"V", LogQuantity::kVoltage},
      {"counts", LogQuantity::kPosition},
  }};
  for (const auto& [name, quantity] : kBases) {
    if (base == name) return quantity;
  }
  return base == "degC" || base == "K" ? LogQuantity::kOther : LogQuantity::kUnknown;
}

MotionKind motion_of_unit(std::string_view unit) {
  const Unit* known = find_unit(unit);
  const std::string_view base = known == nullptr ? unit : known->base;
  if (base.starts_with("rad") || base == "N m" || base == "counts") return MotionKind::kRotary;
  const bool is_linear = base == "m" || base == "m/s" || base == "m/s^2" || base == "N";
  return is_linear ? MotionKind::kLinear : MotionKind::kOpen;
}

std::string known_units_of(LogQuantity quantity) {
  const bool is_any = quantity == LogQuantity::kCommand || quantity == LogQuantity::kUnknown;
  std::string names;
  for (const Unit& unit : known_units()) {
    if (!is_any && quantity_of_unit(unit.name) != quantity) continue;
    if (!names.empty()) names += ", ";
    names += unit.name;
  }
  return names;
}

const char* name_of(LogQuantity quantity) {
  switch (quantity) {
    case LogQuantity::kTime:
      return "time";
    case LogQuantity::kPosition:
      return "position";
    case LogQuantity::kVelocity:
      return "velocity";
    case LogQuantity::kAcceleration:
      return "acceleration";
    case LogQuantity::kForce:
      return "force";
    case LogQuantity::kCurrent:
      return "current";
    case LogQuantity::kVoltage:
      return "voltage";
    case LogQuantity::kCommand:
      return "command";
    case LogQuantity::kOther:
      return "ignore";
    case LogQuantity::kUnknown:
      break;
  }
  return "unknown";
}

ColumnWords read_column_words(std::string_view title, std::string_view stated_unit) {
  ColumnWords result;
  const WrittenUnit stated = written_unit(stated_unit);
  result.unit = stated.unit;
  result.unit_factor = stated.factor;
  if (stated.unit.empty() && !is_note(std::string(stated_unit), true)) {
    result.odd_unit = trimmed(stated_unit);
  }
  Words written = words_as_written(without_brackets(spelled_out(title), result));
  Words words = in_lower_case(written);
  take_unit_words(words, result);
  read_quantity(words, result);
  const std::string last = words.empty() ? "" : written[words.size() - 1];
  if (result.unit.empty() && result.odd_unit.empty() && words.size() > 1) {
    result.unit = unit_letter(last, result);
  }
  let_unit_decide(words, result);
  read_manner(words, result);
  for (const std::string& word : words) {
    if (result.index || std::isdigit(static_cast<unsigned char>(word[0])) == 0) continue;
    if (word.size() < 4) result.index = std::stoi(word);
  }
  return result;
}

}  // namespace graybox
