// Time stamps as loggers write them, and the seconds of a column of them.
//
//   2024-05-01 12:00:00.010     ISO 8601, also with T, and with Z or +02:00 behind it
//   2024/05/01 12:00:00.010     and 01.05.2024 12:00:00,010, as in Germany; 5/1/2024 begins with
//                               the month, unless that is above 12
//   12:00:00.010                a time of day, also 12:00:00:010 and 12:00:00 PM; 00:01.5 has
//                               minutes and seconds, as Excel shows it
//   2024-05-01                  a day, beside a column with the time of day
//
// Seconds are counted from the midnight (UTC where a zone is stated) before the first stamp: small
// enough to keep nanoseconds, and the same for all files of a day. A time of day that falls by more
// than half a day has passed midnight.
//
//   StampColumn column;
//   column.take("12:00:00.010", seconds)    // true, 43200.01
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace graybox {

struct TimeStamp {
  enum class Kind { kDayAndTime, kTimeOfDay, kDay };
  Kind kind = Kind::kTimeOfDay;
  std::int64_t day = 0;  // since 1970; of a time of day 0
  double seconds = 0.0;  // since midnight, in [0, 86400) but for a leap second
  int digits = 0;        // behind the decimal point
};
[[nodiscard]] std::optional<TimeStamp> parse_time_stamp(std::string_view text);

class StampColumn {
 public:
  // False for a text that is no stamp, or of another kind than the first.
  bool take(std::string_view text, double& seconds);
  [[nodiscard]] bool has_any() const { return first_.has_value(); }
  [[nodiscard]] TimeStamp::Kind kind() const { return first_->kind; }
  [[nodiscard]] const std::string& first() const { return text_; }
  // "stamps like 12:00:00.010, to 1 ms", for a user.
  [[nodiscard]] std::string description() const;

 private:
  std::optional<TimeStamp> first_;
  std::string text_;
  int digits_ = 0;     // the most of any stamp
  double last_ = 0.0;  // s, of a time of day
  std::int64_t days_ = 0;
};

}  // namespace graybox
