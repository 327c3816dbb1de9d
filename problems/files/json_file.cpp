#include "problems/files/json_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

constexpr std::size_t kLongestQuote = 40;

// Where the parser stands: one level for each object and array around it.
class FieldTracker {
 public:
  template <typename Json>
  void note(nlohmann::detail::parse_event_t event, const Json& value) {
    using Event = nlohmann::detail::parse_event_t;
    switch (event) {
      case Event::object_start:
      case Event::array_start:
        levels_.push_back({event == Event::array_start, {}, 0});
        break;
      case Event::object_end:
      case Event::array_end:
        levels_.pop_back();
        next();
        break;
      case Event::key:
        levels_.back().key = value.template get<std::string>();
        break;
      case Event::value:
        next();
    }
  }

  // "support[3].weight".
  [[nodiscard]] std::string field() const {
    std::string path;
    for (const Level& level : levels_) {
      if (level.is_array) {
        path += fmt::format("[{}]", level.index);
      } else {
        if (!path.empty()) path.push_back('.');
        path.append(level.key, 0, kLongestQuote);
      }
    }
    return path;
  }

 private:
  struct Level {
    bool is_array = false;
    std::string key;
    std::size_t index = 0;
  };

  void next() {
    if (!levels_.empty()) ++levels_.back().index;
  }

  std::vector<Level> levels_;
};

// The field that holds the number with which parsing failed. It is sought in a second pass, so that
// good files do not pay for it.
template <typename Json>
std::string field_of_large_number(std::string_view text) {
  FieldTracker tracker;
  const auto note = [&tracker](int, nlohmann::detail::parse_event_t event, Json& value) {
    tracker.note(event, value);
    return true;
  };
  try {
    [[maybe_unused]] const Json ignored = Json::parse(text.begin(), text.end(), note);
  } catch (const nlohmann::json::exception&) {
  }
  return tracker.field();
}

// What stands between the quotes of "number overflow parsing '1E1000'".
std::string quoted(std::string_view message) {
  const std::size_t first = message.find('\''), last = message.rfind('\'');
  if (first == last) return {};
  return std::string(message.substr(first + 1, std::min(last - first - 1, kLongestQuote)));
}

}  // namespace

template <typename Json>
Json parse_json(std::string_view text, const std::string& path) {
  try {
    return Json::parse(text.begin(), text.end());
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(fmt::format(
        "{}: not valid JSON at byte {}; is the file truncated? JSON has no NaN, write null", path,
        error.byte));
  } catch (const nlohmann::json::out_of_range& error) {
    const std::string field = field_of_large_number<Json>(text);
    throw InputError(fmt::format("{}: {}{}the number {} is too large; write one below 1.8e308",
                                 path, field, field.empty() ? "" : ": ", quoted(error.what())));
  }
}

template <typename Json>
Json read_json_file(const std::string& path) {
  const InputFile file(path);
  return parse_json<Json>(file.head(file.size()), path);
}

template nlohmann::json parse_json(std::string_view, const std::string&);
template nlohmann::ordered_json parse_json(std::string_view, const std::string&);
template nlohmann::json read_json_file(const std::string&);
template nlohmann::ordered_json read_json_file(const std::string&);

}  // namespace graybox
