// Headers as oscilloscopes and data loggers write them. Numbers of channels stand above their units
// ("x-axis,1" above "second,Volt"). The header may hold the start and the step of the time. Remarks
// on each column stand above it ("Vertical Units,V,,A").
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"

namespace graybox::formats {

// Whether a field is a unit that is known; not the sign of none, "1".
[[nodiscard]] bool is_unit(std::string_view field);

// The fields of a line of units, without their brackets; empty where it is none: one of its fields
// is a unit that is known, and none is a number. Others may be units that graybox does not know.
[[nodiscard]] std::vector<std::string> units_in(const std::vector<std::string_view>& fields);

// Whether each field of a line that is not empty is a unit: "[s],[V],[rad]".
[[nodiscard]] bool are_units_alone(std::string_view line);

// Whether a line names channels, some by their numbers alone, and the one below has a unit for
// each: "x-axis,1,2" above "second,Volt,Volt".
[[nodiscard]] bool names_numbered_channels(std::string_view line, std::string_view below);

// The fields in a line of so many columns: a field at its end may be empty in each line.
[[nodiscard]] std::size_t fields_beside(std::string_view header, std::string_view numbers);

// "X,CH1,Start,Increment" above "Sequence,Volt,-0.1,1e-4": the rows count steps of a time.
struct CountedTime {
  double start = 0.0, step = 0.0;
  std::size_t channels = 0;  // columns before "Start"
};
[[nodiscard]] std::optional<CountedTime> counted_time(const std::vector<std::string_view>& names,
                                                      std::string_view below);
// Seconds in place of the rows' numbers; as it is where they don't count.
void take_counted_time(const CountedTime& time, RecordingFile& file);

// Units that a line above the header states, "Vertical Units,V,,A" or "Horizontal Units,s".
void take_stated_units(std::string_view line, RecordingFile& file);

// Of the two first columns in each line the one names and the other has a setting of the recorder,
// the third is empty, and the samples stand behind: "Record Length,2500,,-0.1,0.02". Empty for
// another line.
[[nodiscard]] std::vector<std::string_view> sample_beside_setting(
    const std::vector<std::string_view>& fields);
// Whether a file begins with such a line.
[[nodiscard]] bool begins_with_setting(std::string_view line);

}  // namespace graybox::formats
