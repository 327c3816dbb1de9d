#include "diagnosis/recording_files/time_stamp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

constexpr double kDaySeconds = 86400.0;

bool is_stamp_digit(char c) { return c >= '0' && c <= '9'; }

// What is left of a stamp, read from its front.
class StampText {
 public:
  explicit StampText(std::string_view text) : rest_(text) {}

  [[nodiscard]] bool at_end() const { return rest_.empty(); }

  bool skip(std::string_view one_of) {
    if (rest_.empty() || one_of.find(rest_.front()) == std::string_view::npos) return false;
    rest_.remove_prefix(1);
    return true;
  }

  bool skip_word(std::string_view word) {
    if (!rest_.starts_with(word)) return false;
    rest_.remove_prefix(word.size());
    return true;
  }

  // A whole number of so many digits.
  bool number(std::size_t fewest, std::size_t most, int& value) {
    const std::size_t count = digits();
    if (count < fewest || count > most) return false;
    value = 0;
    for (const char c : rest_.substr(0, count)) value = 10 * value + (c - '0');
    rest_.remove_prefix(count);
    return true;
  }

  // "010" is 0.01.
  bool fraction(double& value, int& count) {
    constexpr std::size_t kMost = 12;
    const std::size_t found = digits();
    if (found == 0 || found > kMost) return false;
    double number = 0.0;
    for (const char c : rest_.substr(0, found)) number = 10.0 * number + (c - '0');
    value = number / std::pow(10.0, static_cast<double>(found));
    count = static_cast<int>(found);
    rest_.remove_prefix(found);
    return true;
  }

  [[nodiscard]] std::size_t digits() const {
    const auto* const end = std::ranges::find_if_not(rest_, is_stamp_digit);
    return static_cast<std::size_t>(end - rest_.begin());
  }

 private:
  std::string_view rest_;
};

// Days since 1970; false where there is no such day.
bool read_day(StampText& text, std::int64_t& day) {
  int first = 0, month = 0, last = 0;
  const bool begins_with_year = text.digits() == 4;
  if (!text.number(begins_with_year ? 4 : 1, begins_with_year ? 4 : 2, first)) return false;
  const std::string_view sign = text.skip("-") ? "-" : text.skip("/") ? "/" : ".";
  const bool has_point = sign == ".";
  if (has_point && (begins_with_year || !text.skip(sign))) return false;
  if (!text.number(1, 2, month) || !text.skip(sign)) return false;
  if (!text.number(begins_with_year ? 1 : 4, begins_with_year ? 2 : 4, last)) return false;
  // "3/14/2024" has the month first; "3/4/2024" too, as most that write it so mean it.
  if (sign == "/" && !begins_with_year && first <= 12) std::swap(first, month);
  const std::chrono::year_month_day date{
      std::chrono::year(begins_with_year ? first : last),
      std::chrono::month(static_cast<unsigned>(month)),
      std::chrono::day(static_cast<unsigned>(begins_with_year ? last : first))};
  if (!date.ok()) return false;
  day = std::chrono::sys_days(date).time_since_epoch().count();
  return true;
}

// The zone's seconds before UTC.
bool read_zone(StampText& text, double& offset) {
  if (text.skip("Zz") || text.skip_word(" UTC")) return true;
  text.skip(" ");
  const bool is_behind = text.skip("-");
  if (!is_behind && !text.skip("+")) return false;
  int hours = 0, minutes = 0;
  if (!text.number(text.digits() == 4 ? 4 : 2, 4, hours)) return false;
  if (hours > 99) {
    minutes = hours % 100;
    hours /= 100;
  } else if (text.skip(":") && !text.number(2, 2, minutes)) {
    return false;
  }
  offset = (is_behind ? -60.0 : 60.0) * (60.0 * hours + minutes);
  return hours <= 14 && minutes < 60;
}

// "12:00:00.010", and what may stand behind it.
bool read_time_of_day(StampText& text, TimeStamp& stamp) {
  int hours = 0, minutes = 0, seconds = 0;
  if (!text.number(1, 2, hours) || !text.skip(":")) return false;
  if (!text.number(2, 2, minutes)) return false;
  if (!text.skip(":")) {  // "00:01.5", as Excel shows times: minutes and seconds
    double fraction = 0.0;
    if (stamp.kind != TimeStamp::Kind::kTimeOfDay || !text.skip(".")) return false;
    stamp.seconds = 60.0 * hours + minutes;
    if (minutes > 59 || !text.fraction(fraction, stamp.digits)) return false;
    stamp.seconds += fraction;
    return text.at_end();
  }
  if (!text.number(2, 2, seconds)) return false;
  if (hours > 23 || minutes > 59 || seconds > 60) return false;
  double fraction = 0.0;
  if (text.skip(".,:") && !text.fraction(fraction, stamp.digits)) return false;
  const bool is_afternoon = text.skip_word(" PM") || text.skip_word(" pm");
  if (is_afternoon || text.skip_word(" AM") || text.skip_word(" am")) {
    if (hours < 1 || hours > 12) return false;
    hours = hours % 12 + (is_afternoon ? 12 : 0);
  }
  stamp.seconds = 3600.0 * hours + 60.0 * minutes + seconds + fraction;
  return true;
}

void take_zone(double offset, TimeStamp& stamp) {
  stamp.seconds -= offset;
  const double days = std::floor(stamp.seconds / kDaySeconds);
  stamp.seconds -= days * kDaySeconds;
  if (stamp.kind == TimeStamp::Kind::kDayAndTime) stamp.day += static_cast<std::int64_t>(days);
}

}  // namespace

std::optional<TimeStamp> parse_time_stamp(std::string_view field) {
  constexpr std::size_t kShortest = 6, kLongest = 48;
  field = trimmed(field);
  if (field.size() < kShortest || field.size() > kLongest || !is_stamp_digit(field.front())) {
    return {};
  }
  TimeStamp stamp;
  StampText text(field);
  if (field.find_first_of("-/.") < field.find(':')) {
    stamp.kind = TimeStamp::Kind::kDay;
    if (!read_day(text, stamp.day)) return {};
    if (text.at_end()) return stamp;
    if (!text.skip("Tt _")) return {};
    stamp.kind = TimeStamp::Kind::kDayAndTime;
  }
  double offset = 0.0;
  if (!read_time_of_day(text, stamp)) return {};
  if (!text.at_end() && !read_zone(text, offset)) return {};
  if (!text.at_end()) return {};
  take_zone(offset, stamp);
  return stamp;
}

bool StampColumn::take(std::string_view text, double& seconds) {
  const std::optional<TimeStamp> stamp = parse_time_stamp(text);
  if (!stamp || (first_ && first_->kind != stamp->kind)) return false;
  if (!first_) {
    first_ = stamp;
    text_ = trimmed(text);
  } else if (stamp->kind == TimeStamp::Kind::kTimeOfDay &&
             stamp->seconds < last_ - 0.5 * kDaySeconds) {
    ++days_;
  }
  last_ = stamp->seconds;
  digits_ = std::max(digits_, stamp->digits);
  seconds = static_cast<double>(stamp->day - first_->day + days_) * kDaySeconds + stamp->seconds;
  return true;
}

std::string StampColumn::description() const {
  const int thousands = (digits_ + 2) / 3;
  constexpr const char* kUnits[] = {"s", "ms", "us", "ns", "ps"};
  return fmt::format("stamps like {}, to {:g} {}", text_, std::pow(10.0, 3.0 * thousands - digits_),
                     kUnits[thousands]);
}

}  // namespace graybox
