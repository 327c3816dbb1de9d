#include "diagnosis/log_columns/column_words.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <regex>
#include <span>
#include <utility>

#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

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
    {"temperatura", LogQuantity::kOther},
    {"erreur", LogQuantity::kOther},
    {"errore", LogQuantity::kOther},
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
    {"timestamps", LogQuantity::kTime},
    {"times", LogQuantity::kTime},
    {"stamp", LogQuantity::kTime},
    {"stamps", LogQuantity::kTime},
    {"tstamp", LogQuantity::kTime},
    {"datetime", LogQuantity::kTime},
    {"unixtime", LogQuantity::kTime},
    {"rostime", LogQuantity::kTime},
    {"simtime", LogQuantity::kTime},
    {"systime", LogQuantity::kTime},
    {"localtime", LogQuantity::kTime},
    {"walltime", LogQuantity::kTime},
    {"uptime", LogQuantity::kTime},
    {"zeit", LogQuantity::kTime},
    {"uhrzeit", LogQuantity::kTime},
    {"zeitstempel", LogQuantity::kTime},
    {"temps", LogQuantity::kTime},
    {"tiempo", LogQuantity::kTime},
    {"tempo", LogQuantity::kTime},
    {"horodatage", LogQuantity::kTime},
    {"elapsed", LogQuantity::kTime},
    {"clock", LogQuantity::kTime},
    {"ddq", LogQuantity::kAcceleration},
    {"qdd", LogQuantity::kAcceleration},
    {"ddot", LogQuantity::kAcceleration},
    {"acc", LogQuantity::kAcceleration},
    {"accel", LogQuantity::kAcceleration},
    {"acceleration", LogQuantity::kAcceleration},
    {"beschleunigung", LogQuantity::kAcceleration},
    {"aceleracion", LogQuantity::kAcceleration},
    {"accelerazione", LogQuantity::kAcceleration},
    {"dq", LogQuantity::kVelocity},
    {"qdot", LogQuantity::kVelocity},
    {"dot", LogQuantity::kVelocity},
    {"vel", LogQuantity::kVelocity},
    {"velocity", LogQuantity::kVelocity},
    {"velocities", LogQuantity::kVelocity},
    {"qvel", LogQuantity::kVelocity},
    {"jvel", LogQuantity::kVelocity},
    {"speed", LogQuantity::kVelocity},
    {"spd", LogQuantity::kVelocity},
    {"angvel", LogQuantity::kVelocity, MotionKind::kRotary},
    {"tacho", LogQuantity::kVelocity},
    {"tach", LogQuantity::kVelocity},
    {"tachometer", LogQuantity::kVelocity},
    {"rate", LogQuantity::kVelocity},
    {"drehzahl", LogQuantity::kVelocity, MotionKind::kRotary},
    {"geschwindigkeit", LogQuantity::kVelocity},
    {"geschw", LogQuantity::kVelocity},
    {"vitesse", LogQuantity::kVelocity},
    {"velocidad", LogQuantity::kVelocity},
    {"velocita", LogQuantity::kVelocity},
    {"winkelgeschwindigkeit", LogQuantity::kVelocity, MotionKind::kRotary},
    {"drehgeschwindigkeit", LogQuantity::kVelocity, MotionKind::kRotary},
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
    {"stellung", LogQuantity::kPosition},
    {"posicion", LogQuantity::kPosition},
    {"posizione", LogQuantity::kPosition},
    {"drehwinkel", LogQuantity::kPosition, MotionKind::kRotary},
    {"angulo", LogQuantity::kPosition, MotionKind::kRotary},
    {"angolo", LogQuantity::kPosition, MotionKind::kRotary},
    {"auslenkung", LogQuantity::kPosition, MotionKind::kLinear},
    {"deplacement", LogQuantity::kPosition, MotionKind::kLinear},
    {"desplazamiento", LogQuantity::kPosition, MotionKind::kLinear},
    {"spostamento", LogQuantity::kPosition, MotionKind::kLinear},
    {"tau", LogQuantity::kForce, MotionKind::kRotary},
    {"torque", LogQuantity::kForce, MotionKind::kRotary},
    {"torques", LogQuantity::kForce, MotionKind::kRotary},
    {"trq", LogQuantity::kForce, MotionKind::kRotary},
    {"moment", LogQuantity::kForce, MotionKind::kRotary},
    {"drehmoment", LogQuantity::kForce, MotionKind::kRotary},
    {"couple", LogQuantity::kForce, MotionKind::kRotary},
    {"coppia", LogQuantity::kForce, MotionKind::kRotary},
    {"momento", LogQuantity::kForce, MotionKind::kRotary},
    {"effort", LogQuantity::kForce},
    {"efforts", LogQuantity::kForce},
    {"eff", LogQuantity::kForce},
    {"force", LogQuantity::kForce, MotionKind::kLinear},
    {"kraft", LogQuantity::kForce, MotionKind::kLinear},
    {"fuerza", LogQuantity::kForce, MotionKind::kLinear},
    {"forza", LogQuantity::kForce, MotionKind::kLinear},
    {"voltage", LogQuantity::kVoltage},
    {"volt", LogQuantity::kVoltage},
    {"spannung", LogQuantity::kVoltage},
    {"voltaje", LogQuantity::kVoltage},
    {"tensione", LogQuantity::kVoltage},
    {"volts", LogQuantity::kVoltage},
    {"vin", LogQuantity::kVoltage},
    {"vout", LogQuantity::kVoltage},
    {"vmot", LogQuantity::kVoltage},
    {"vmotor", LogQuantity::kVoltage},
    {"uin", LogQuantity::kVoltage},
    {"iq", LogQuantity::kCurrent},
    {"current", LogQuantity::kCurrent},
    {"currents", LogQuantity::kCurrent},
    {"curr", LogQuantity::kCurrent},
    {"cur", LogQuantity::kCurrent},
    {"strom", LogQuantity::kCurrent},
    {"courant", LogQuantity::kCurrent},
    {"corriente", LogQuantity::kCurrent},
    {"corrente", LogQuantity::kCurrent},
    {"pwm", LogQuantity::kCommand},
    {"duty", LogQuantity::kCommand},
    {"throttle", LogQuantity::kCommand},
    {"input", LogQuantity::kCommand},
    {"control", LogQuantity::kCommand},
    {"dutycycle", LogQuantity::kCommand},
});

// Letters that people use; another signal may be meant.
constexpr auto kLetters = std::to_array<QuantityWord>({
    {"t", LogQuantity::kTime},
    {"ts", LogQuantity::kTime},
    {"epoch", LogQuantity::kTime},
    {"unix", LogQuantity::kTime},
    {"utc", LogQuantity::kTime},
    {"qd", LogQuantity::kVelocity},
    {"w", LogQuantity::kVelocity, MotionKind::kRotary},
    {"v", LogQuantity::kVelocity},
    {"gyro", LogQuantity::kVelocity, MotionKind::kRotary},
    {"twist", LogQuantity::kVelocity},
    {"q", LogQuantity::kPosition},
    {"qm", LogQuantity::kPosition},
    {"qg", LogQuantity::kPosition},
    {"th", LogQuantity::kPosition, MotionKind::kRotary},
    {"x", LogQuantity::kPosition, MotionKind::kLinear},
    {"y", LogQuantity::kPosition},
    {"yaw", LogQuantity::kPosition, MotionKind::kRotary},
    {"pitch", LogQuantity::kPosition, MotionKind::kRotary},
    {"roll", LogQuantity::kPosition, MotionKind::kRotary},
    {"psi", LogQuantity::kPosition, MotionKind::kRotary},
    {"heading", LogQuantity::kPosition, MotionKind::kRotary},
    {"pan", LogQuantity::kPosition, MotionKind::kRotary},
    {"tilt", LogQuantity::kPosition, MotionKind::kRotary},
    {"azimuth", LogQuantity::kPosition, MotionKind::kRotary},
    {"elevation", LogQuantity::kPosition, MotionKind::kRotary},
    {"rotation", LogQuantity::kPosition, MotionKind::kRotary},
    {"distance", LogQuantity::kPosition, MotionKind::kLinear},
    {"dist", LogQuantity::kPosition, MotionKind::kLinear},
    {"i", LogQuantity::kCurrent},
    {"f", LogQuantity::kForce, MotionKind::kLinear},
    {"par", LogQuantity::kForce, MotionKind::kRotary},  // a parameter, else
    {"u", LogQuantity::kCommand},
    {"cmd", LogQuantity::kCommand},
    {"command", LogQuantity::kCommand},
});

// How a signal came to be, and where in the machine it is.
using Word = std::string_view;
constexpr auto kReferenceWords = std::to_array<Word>(
    {"ref",      "refx",   "reference", "des",      "desired",  "target",    "set",
     "setpoint", "sp",     "goal",      "cmd",      "command",  "commanded", "demand",
     "soll",     "wanted", "planned",   "sollwert", "consigne", "consigna",  "riferimento"});
constexpr auto kMeasuredWords = std::to_array<Word>(
    {"meas", "measured", "act", "actual", "adx", "ad", "fb", "fbk", "feedback", "ist", "sensor",
     "istwert", "gemessen", "mesure", "mesuree", "medida", "misurata"});
constexpr auto kFilteredWords = std::to_array<Word>({"filt", "filtered", "smooth", "lp"});
constexpr auto kLoadWords =
    std::to_array<Word>({"load", "link", "arm", "out", "output", "last", "abtrieb"});
constexpr auto kMotorWords = std::to_array<Word>(
    {"motor", "mot", "rotor", "drive", "antrieb", "antriebs", "moteur", "motore"});
constexpr auto kLinearWords = std::to_array<Word>({"carriage", "cart", "slide", "linear"});
// Others that stand in brackets and are no unit.
constexpr auto kNoteWords = std::to_array<Word>(
    {"axis",  "axes",       "achse",  "joint",      "gelenk", "channel",  "ch",
     "no",    "nr",         "number", "side",       "left",   "right",    "upper",
     "lower", "front",      "rear",   "x",          "y",      "z",        "st",
     "nd",    "rd",         "th",     "calculated", "calc",   "computed", "estimated",
     "est",   "unfiltered", "robot",  "encoder",    "signal", "sim",      "simulated",
     "none",  "unknown",    "na",     "total",      "sum",    "mean",     "average"});

// Others that stand behind a unit: "rpm_raw".
constexpr auto kValueWords =
    std::to_array<Word>({"raw", "val", "value", "values", "data", "reading", "avg", "l", "r", "fl",
                         "fr", "rl", "rr", "wheel", "shaft", "of"});

using Words = std::vector<std::string>;

bool has_any(const Words& words, std::span<const std::string_view> list) {
  return std::ranges::any_of(
      words, [&](const std::string& word) { return std::ranges::find(list, word) != list.end(); });
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

// "Istposition", "Motorstrom": two words in one, what or where a signal is and its quantity.
Words without_compounds(const Words& words) {
  static constexpr auto kFirst =
      std::to_array<Word>({"ist", "soll", "motor", "last", "antriebs", "load", "act", "actual"});
  Words parts;
  for (const std::string& word : words) {
    const auto names = [&](std::size_t from) {
      return std::ranges::any_of(kQuantityWords, [&](const QuantityWord& row) {
        return row.word == std::string_view(word).substr(from);
      });
    };
    const auto first = std::ranges::find_if(
        kFirst, [&](Word each) { return word.starts_with(each) && names(each.size()); });
    if (first == kFirst.end() || names(0)) {
      parts.push_back(word);
      continue;
    }
    parts.emplace_back(*first);
    parts.push_back(word.substr(first->size()));
  }
  return parts;
}

// "v_in", "V out": a voltage's letter and where it is; "i_q": a current of a drive.
Words with_voltages_joined(const Words& words) {
  static constexpr auto kPlaces = std::to_array<Word>({"in", "out", "mot", "motor"});
  Words joined;
  for (const std::string& word : words) {
    const bool is_place = std::ranges::find(kPlaces, word) != kPlaces.end();
    const bool is_letter = (is_place && !joined.empty() && joined.back() == "v") ||
                           (word == "q" && !joined.empty() && joined.back() == "i");
    if (is_letter) {
      joined.back() += word;
    } else {
      joined.push_back(word);
    }
  }
  return joined;
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
      result.written = trimmed(inside);
      result.odd_unit.clear();
    }
    text.erase(first, last - first + 1);
  }
  return text;
}

// Words of a title that are a unit.
struct UnitWords {
  WrittenUnit unit;
  std::size_t first = 0, count = 0;
};

bool names(const Words& words, LogQuantity quantity) {
  return std::ranges::any_of(kQuantityWords, [&](const QuantityWord& row) {
    return row.quantity == quantity && std::ranges::find(words, row.word) != words.end();
  });
}

// A unit of a rate or a force that is hardly anything else: "rpm", "rad s", not "m s" or "u min".
bool is_distinct(const std::string& text, const WrittenUnit& unit) {
  const LogQuantity quantity = quantity_of_unit(unit.unit);
  const bool is_such = quantity == LogQuantity::kVelocity ||
                       quantity == LogQuantity::kAcceleration || quantity == LogQuantity::kForce;
  const bool has_letter = text.size() < 2 || text[1] == ' ';  // "s", "m s"
  return is_such && !has_letter && text != "in s" && text.find_first_of("0123456789") > text.size();
}

// The unit in which the first `end` words end.
std::optional<UnitWords> unit_before(const Words& words, std::size_t end) {
  for (std::size_t count = std::min<std::size_t>(3, end); count > 0; --count) {
    const std::string text = joined_words(std::span(words).subspan(end - count, count));
    // "encoder second" is one of two encoders, and "second" alone is a time.
    const bool is_second = words.size() == 1 && text == "second";
    const WrittenUnit unit = is_second ? WrittenUnit{"s", 1.0} : unit_of_words(text);
    // "m s" may end "theta_m_s"; a unit of one word may be a title of its own ("rpm").
    const bool is_whole = count == end && end > 1;
    if (unit.unit.empty() || (is_whole && !is_distinct(text, unit))) continue;
    if (text == "in s" && names(words, LogQuantity::kTime)) {  // "zeit_in_s"
      return UnitWords{{"s", 1.0}, end - count, count};
    }
    // "vel_rad_s_2" is that of number 2.
    const bool is_number = text.ends_with(" s 2") && names(words, LogQuantity::kVelocity);
    return is_number ? unit_before(words, end - 1) : UnitWords{unit, end - count, count};
  }
  return {};
}

// Whether a word says how a signal came to be, which one of several it is, or nothing.
bool is_manner(const std::string& word) {
  const Words one{word};
  return std::isdigit(static_cast<unsigned char>(word[0])) != 0 || has_any(one, kReferenceWords) ||
         has_any(one, kMeasuredWords) || has_any(one, kFilteredWords) || has_any(one, kLoadWords) ||
         has_any(one, kMotorWords) || has_any(one, kNoteWords) || has_any(one, kValueWords);
}

// The unit behind which words of that kind stand alone: "rpm_actual", "pos_deg_raw".
std::optional<UnitWords> unit_before_manner(const Words& words) {
  // "us_1" may be an ultrasonic sensor, "ma_5" a mean.
  static constexpr auto kShort = std::to_array<Word>({"ms", "us", "ns", "ma", "mv", "um"});
  for (std::size_t end = words.size(); end > 1 && is_manner(words[end - 1]); --end) {
    const std::optional<UnitWords> found = unit_before(words, end - 1);
    if (!found) continue;
    const LogQuantity quantity = quantity_of_unit(found->unit.unit);
    const bool is_short =
        found->count == 1 && has_any({words[found->first]}, kShort) && !names(words, quantity);
    const bool is_time = quantity == LogQuantity::kTime && !names(words, quantity);
    return is_short || is_time ? std::nullopt : found;
  }
  return {};
}

Words without_unit(const Words& words, const UnitWords& unit) {
  Words others = words;
  const auto first = others.begin() + static_cast<std::ptrdiff_t>(unit.first);
  others.erase(first, first + static_cast<std::ptrdiff_t>(unit.count));
  return others;
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

// A unit anywhere that is one of the quantity that the other words name, or hardly anything else:
// "rpm_speed", "wheel rpm of the cart".
std::optional<UnitWords> unit_within(const Words& words) {
  for (std::size_t first = 0; first + 1 < words.size(); ++first) {
    for (std::size_t count = std::min<std::size_t>(3, words.size() - 1 - first); count > 0;
         --count) {
      const std::string text = joined_words(std::span(words).subspan(first, count));
      const UnitWords found{unit_of_words(text), first, count};
      if (found.unit.unit.empty()) continue;
      ColumnWords others;
      read_quantity(without_unit(words, found), others);
      const LogQuantity by_unit = quantity_of_unit(found.unit.unit);
      const bool fits = others.sure && others.quantity == by_unit;
      const bool is_rate = others.quantity == LogQuantity::kPosition &&
                           by_unit == LogQuantity::kVelocity;  // "rpm_encoder"
      if (fits || ((!others.sure || is_rate) && is_distinct(text, found.unit))) return found;
    }
  }
  return {};
}

// "vel_ticks_s", "cps": a speed in counts, of which no unit is known.
bool is_rate_of_counts(const Words& words) {
  static constexpr auto kSeconds = std::to_array<Word>({"s", "sec", "second"});
  if (words.empty() || words.back() == "cps") return !words.empty();
  if (!has_any({words.back()}, kSeconds) || words.size() < 2) return false;
  const bool has_per = words[words.size() - 2] == "per";
  const std::size_t at = words.size() - (has_per ? 3 : 2);
  return at < words.size() && unit_of_words(words[at]).unit == "counts" &&
         (has_per || words[at].ends_with('s'));  // "tick_s" may be a time
}

// The unit that some of the words are; these go.
void take_unit_words(Words& words, ColumnWords& result) {
  if (is_rate_of_counts(words)) {
    if (result.unit.empty() && result.odd_unit.empty()) result.odd_unit = "counts/s";
    words.emplace_back("speed");
    return;
  }
  std::optional<UnitWords> found = unit_before(words, words.size());
  if (!found) found = unit_before_manner(words);
  if (!found) found = unit_within(words);
  if (!found) return;
  if (result.unit.empty() && result.odd_unit.empty()) {
    result.unit = found->unit.unit;
    result.unit_factor = found->unit.factor;
  }
  words = without_unit(words, *found);
  const LogQuantity quantity = quantity_of_unit(found->unit.unit);
  const bool is_motion = quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity;
  if (is_motion) std::erase(words, "current");  // "current_rpm": that it has now
}

// A rate's unit that is written with a stroke, a word by itself: "n U/min ist". It goes.
void take_stroke_unit(std::string& text, ColumnWords& result) {
  for (std::size_t first = 0; first < text.size();) {
    const std::size_t end = std::min(text.find(' ', first), text.size());
    const std::string word = text.substr(first, end - first);
    const WrittenUnit unit = word.find('/') == std::string::npos || word.size() > 12
                                 ? WrittenUnit{}
                                 : written_unit(word);
    const LogQuantity quantity = quantity_of_unit(unit.unit);
    if (quantity == LogQuantity::kVelocity || quantity == LogQuantity::kAcceleration) {
      if (result.unit.empty() && result.odd_unit.empty()) {
        result.unit = unit.unit;
        result.unit_factor = unit.factor;
      }
      text.erase(first, end - first);
      return;
    }
    first = end + 1;
  }
}

// A speed's frequency is in turns a second: "speed_hz", but for the rate of a loop.
bool is_speed_in_hertz(const Words& words, const ColumnWords& result) {
  if (result.quantity != LogQuantity::kVelocity || !result.unit.empty()) return false;
  Words others = words;
  std::erase(others, "rate");
  return has_any(words, std::to_array<Word>({"hz"})) && names(others, LogQuantity::kVelocity);
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
  if (names(words, by_unit) && result.quantity != LogQuantity::kOther) result.quantity = by_unit;
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

}  // namespace

std::pair<std::string, std::string> title_and_unit(const std::string& title) {
  for (const auto& [open, close] : {std::pair{'[', ']'}, std::pair{'(', ')'}}) {
    const std::size_t begin = title.rfind(open);
    if (begin == std::string::npos || begin == 0 || !title.ends_with(close)) continue;
    std::string unit = title.substr(begin + 1, title.size() - begin - 2);
    const bool is_index =
        std::ranges::all_of(unit, [](unsigned char c) { return std::isdigit(c) != 0; });
    if (is_index) continue;
    return {std::string(trimmed(std::string_view(title).substr(0, begin))), std::move(unit)};
  }
  return {title, ""};
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

WrittenUnit unit_of_quantity(std::string_view text, LogQuantity quantity) {
  const WrittenUnit written = written_unit(text);
  const bool is_hertz = trimmed(text) == "Hz" || trimmed(text) == "hz";
  return written.unit.empty() && is_hertz && quantity == LogQuantity::kVelocity
             ? WrittenUnit{"turn/s", 1.0}
             : written;
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
  if (!stated.unit.empty()) result.written = trimmed(stated_unit);
  if (stated.unit.empty() && !is_note(std::string(stated_unit), true)) {
    result.odd_unit = trimmed(stated_unit);
  }
  std::string text = without_brackets(spelled_out(title), result);
  replace_all(text, " in ", " ");  // "Zeit in s" is in no inch a second
  take_stroke_unit(text, result);
  const Words written = words_as_written(text);
  Words words = in_lower_case(written);
  take_unit_words(words, result);
  const std::string last =
      words.empty() || words.size() > written.size() ? "" : written[words.size() - 1];
  words = with_voltages_joined(without_compounds(words));
  read_quantity(words, result);
  if (result.unit.empty() && result.odd_unit.empty() && words.size() > 1) {
    result.unit = unit_letter(last, result);
  }
  if (const WrittenUnit hertz = unit_of_quantity(result.odd_unit, result.quantity);
      result.unit.empty() && !hertz.unit.empty()) {
    result.unit = hertz.unit;
    result.odd_unit.clear();
  }
  if (is_speed_in_hertz(words, result)) result.unit = "turn/s";
  let_unit_decide(words, result);
  read_manner(words, result);
  // A speed in the books of drives, and else a number of something.
  const bool is_speed = result.is_measured || result.is_reference;
  if (result.quantity == LogQuantity::kUnknown && result.unit.empty() && is_speed &&
      std::ranges::find(words, "n") != words.end()) {
    result.quantity = LogQuantity::kVelocity;
    result.motion = MotionKind::kRotary;
  }
  for (const std::string& word : words) {
    if (result.index || std::isdigit(static_cast<unsigned char>(word[0])) == 0) continue;
    if (word.size() < 4) result.index = std::stoi(word);
  }
  return result;
}

}  // namespace graybox
