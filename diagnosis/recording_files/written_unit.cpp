#include "diagnosis/recording_files/written_unit.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <regex>
#include <utility>
#include <vector>

#include "diagnosis/recording_files/title_words.hpp"
#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

// Words that are a unit where they end a title, each joined by one blank.
using UnitWord = std::pair<std::string_view, std::string_view>;
constexpr auto kUnitWords = std::to_array<UnitWord>({
    {"rad s", "rad/s"},
    {"rad sec", "rad/s"},
    {"rad per s", "rad/s"},
    {"rad per sec", "rad/s"},
    {"rad per second", "rad/s"},
    {"radians per second", "rad/s"},
    {"radians s", "rad/s"},
    {"radps", "rad/s"},
    {"rads", "rad/s"},
    {"rad s 2", "rad/s^2"},
    {"deg s", "deg/s"},
    {"deg sec", "deg/s"},
    {"deg per s", "deg/s"},
    {"deg per sec", "deg/s"},
    {"deg per second", "deg/s"},
    {"degrees per second", "deg/s"},
    {"degrees s", "deg/s"},
    {"degree s", "deg/s"},
    {"degps", "deg/s"},
    {"dps", "deg/s"},
    {"degs", "deg/s"},
    {"deg s 2", "deg/s^2"},
    {"rpm", "rpm"},
    {"rpms", "rpm"},
    {"revs min", "rpm"},
    {"revs per min", "rpm"},
    {"rev per minute", "rpm"},
    {"revs per minute", "rpm"},
    {"revolutions per minute", "rpm"},
    {"rotations per minute", "rpm"},
    {"1 min", "rpm"},
    {"rev min", "rpm"},
    {"u min", "rpm"},
    {"min 1", "rpm"},
    {"rps", "turn/s"},
    {"rev s", "turn/s"},
    {"turn s", "turn/s"},
    {"turns s", "turn/s"},
    {"turn per s", "turn/s"},
    {"turns per s", "turn/s"},
    {"turns per sec", "turn/s"},
    {"turns per second", "turn/s"},
    {"rev sec", "turn/s"},
    {"revs s", "turn/s"},
    {"rev per s", "turn/s"},
    {"revs per s", "turn/s"},
    {"revs per second", "turn/s"},
    {"revolutions per second", "turn/s"},
    {"rotations per second", "turn/s"},
    {"m s", "m/s"},
    {"mps", "m/s"},
    {"m per s", "m/s"},
    {"m sec", "m/s"},
    {"m per sec", "m/s"},
    {"m per second", "m/s"},
    {"meters per second", "m/s"},
    {"metres per second", "m/s"},
    {"mm s", "mm/s"},
    {"mm per s", "mm/s"},
    {"mm per sec", "mm/s"},
    {"mm per second", "mm/s"},
    {"mmps", "mm/s"},
    {"in s", "in/s"},
    {"m s 2", "m/s^2"},
    {"m s2", "m/s^2"},
    {"rad", "rad"},
    {"radian", "rad"},
    {"radians", "rad"},
    {"mrad", "mrad"},
    {"deg", "deg"},
    {"degree", "deg"},
    {"degrees", "deg"},
    {"turn", "turn"},
    {"turns", "turn"},
    {"rev", "turn"},
    {"revs", "turn"},
    {"counts", "counts"},
    {"count", "counts"},
    {"cnt", "counts"},
    {"cnts", "counts"},
    {"ticks", "counts"},
    {"tick", "counts"},
    {"inc", "counts"},
    {"incr", "counts"},
    {"increments", "counts"},
    {"mm", "mm"},
    {"millimeters", "mm"},
    {"millimetres", "mm"},
    {"meters", "m"},
    {"metres", "m"},
    {"um", "um"},
    {"n m", "N m"},
    {"nm", "N m"},
    {"mnm", "mN m"},
    {"mn m", "mN m"},
    {"knm", "kN m"},
    {"kn", "kN"},
    {"lbf", "lbf"},
    {"kip", "kip"},
    {"newton", "N"},
    {"amp", "A"},
    {"amps", "A"},
    {"ampere", "A"},
    {"ma", "mA"},
    {"volt", "V"},
    {"volts", "V"},
    {"mv", "mV"},
    {"sec", "s"},
    {"secs", "s"},
    {"seconds", "s"},
    {"ms", "ms"},
    {"msec", "ms"},
    {"msecs", "ms"},
    {"millis", "ms"},
    {"millisec", "ms"},
    {"millisecs", "ms"},
    {"millisecond", "ms"},
    {"milliseconds", "ms"},
    {"us", "us"},
    {"usec", "us"},
    {"usecs", "us"},
    {"micros", "us"},
    {"microsec", "us"},
    {"microsecs", "us"},
    {"microsecond", "us"},
    {"microseconds", "us"},
    {"ns", "ns"},
    {"nsec", "ns"},
    {"nsecs", "ns"},
    {"nanos", "ns"},
    {"nanosec", "ns"},
    {"nanoseconds", "ns"},
    {"m nm", "mN m"},
    {"m n m", "mN m"},
    {"m a", "mA"},
    {"m v", "mV"},
    {"k n", "kN"},
    {"k nm", "kN m"},
    {"k n m", "kN m"},
    {"m sec 2", "m/s^2"},
    {"rad sec 2", "rad/s^2"},
    {"deg sec 2", "deg/s^2"},
    {"mm sec", "mm/s"},
    {"r min", "rpm"},
    {"umdr min", "rpm"},
    {"upm", "rpm"},

    {"tr min", "rpm"},
    {"tours min", "rpm"},
    {"giri min", "rpm"},
    {"rev per min", "rpm"},
    {"grad", "deg"},
    {"grad s", "deg/s"},
    {"grad sek", "deg/s"},
    {"grad sec", "deg/s"},
    {"grad s 2", "deg/s^2"},
    {"winkelgrad", "deg"},
    {"degre", "deg"},
    {"degres", "deg"},
    {"grados", "deg"},
    {"gradi", "deg"},
    {"rad sek", "rad/s"},
    {"m sek", "m/s"},
    {"mm sek", "mm/s"},
    {"umdrehungen", "turn"},
    {"umdr", "turn"},
    {"inkremente", "counts"},
    {"inkr", "counts"},
    {"ink", "counts"},
    {"impulse", "counts"},
    {"sek", "s"},
    {"sekunden", "s"},
    {"secondes", "s"},
    {"segundos", "s"},
    {"secondi", "s"},
    {"msek", "ms"},
    {"millisekunden", "ms"},
    {"newtonmeter", "N m"},
    {"newton meter", "N m"},
    {"newton metre", "N m"},
    {"milliampere", "mA"},
    {"milliamps", "mA"},
    {"millivolts", "mV"},
    {"newtons", "N"},
    {"millimeter", "mm"},
    {"percent", "%"},
    {"prozent", "%"},
    {"pct", "%"},
    {"pourcent", "%"},
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
    {"cm per s", "m/s", 0.01},
    {"km h", "m/s", 1.0 / 3.6},
    {"kmh", "m/s", 1.0 / 3.6},
    {"kph", "m/s", 1.0 / 3.6},
    {"kmph", "m/s", 1.0 / 3.6},
    {"mph", "m/s", 0.44704},
    {"ft s", "m/s", 0.3048},
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
    {"permille", "%", 0.1},
    {"promille", "%", 0.1},
});

// A unit without a number.
WrittenUnit plain_unit(const std::string& text) {
  const std::string plain(trimmed(text));
  if (find_unit(plain) != nullptr) return {plain, 1.0};
  const std::vector<std::string> words = words_of(plain);
  // Not at the end of a title: "encoder second" is one of two.
  if (words == std::vector<std::string>{"second"}) return {"s", 1.0};
  return unit_of_words(joined_words(words));
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

// "% rated", "% of rated torque", "%MN".
bool is_share(const std::string& text) {
  constexpr std::size_t kLongest = 40;
  return text.starts_with('%') && text.size() <= kLongest &&
         std::ranges::all_of(text.substr(1), [](unsigned char c) {
           return std::isalpha(c) != 0 || c == ' ' || c == '.' || c == '_';
         });
}

std::string text_without_blanks(std::string_view text) {
  std::string result(text);
  std::erase(result, ' ');
  return result;
}

}  // namespace

WrittenUnit unit_of_words(std::string_view words) {
  for (const auto& [written, unit] : kUnitWords) {
    if (written == words) return {std::string(unit), 1.0};
  }
  for (const ScaledUnit& row : kScaledUnits) {
    if (row.words == words) return {std::string(row.unit), row.factor};
  }
  return {};
}

WrittenUnit written_unit(std::string_view text) {
  std::string plain = spelled_out(trimmed(text));
  if (is_share(plain)) return {"%", 1.0};
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

bool is_same_unit(std::string_view one, std::string_view other) {
  const WrittenUnit a = written_unit(one), b = written_unit(other);
  const Unit* first = find_unit(a.unit);
  const Unit* second = find_unit(b.unit);
  if (first == nullptr || second == nullptr) {
    return text_without_blanks(one) == text_without_blanks(other);
  }
  constexpr double kRounding = 1e-9;
  const double size = a.factor * first->factor;
  return first->base == second->base &&
         std::abs(size - b.factor * second->factor) <= kRounding * std::abs(size);
}

}  // namespace graybox
