#include "problems/files/yaml_field.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <set>

#include "problems/base/error.hpp"
#include "problems/base/shortened.hpp"
#include "problems/files/file_kind.hpp"
#include "problems/files/input_guard.hpp"

namespace graybox {
namespace {

constexpr double kLargestCount = 1e9;
constexpr std::uintmax_t kLargestFile = 100'000'000;

// `graybox model` marks what it could not know: such a file is not used before it is answered.
void refuse_open_questions(const std::string& file) {
  constexpr std::string_view kMark = "# ANSWER:";
  std::ifstream stream(file);
  std::size_t number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    const std::size_t at = line.find(kMark);
    if (at == std::string::npos) continue;
    throw InputError(
        fmt::format("{}:{}: an open question:{}; put the answer there and take the mark '{}' away",
                    file, number, shortened(line.substr(at + kMark.size()), 300), kMark));
  }
}

// Robots are often given as URDF, and logs as tables, where a file of fields is asked for.
void refuse_urdf_and_table(const std::filesystem::path& file) {
  std::ifstream stream(file);
  char first = ' ';
  stream >> first;
  if (first == '<') {
    throw InputError(fmt::format(
        "{}: is XML, as a URDF; 'graybox model {} LOG.csv' proposes a model from a URDF and a log",
        file.string(), file.filename().string()));
  }
  if (file.extension() == ".csv") {
    throw InputError(fmt::format(
        "{}: is a table of data; 'graybox model {}' proposes a model and a campaign for it, "
        "'graybox recordings --template' a campaign alone",
        file.string(), file.filename().string()));
  }
}

}  // namespace

YamlField::YamlField(std::string file, std::string path, YAML::Node node)
    : file_(std::move(file)), path_(std::move(path)), node_(std::move(node)) {}

YamlField YamlField::load(const std::filesystem::path& file) {
  require_file(file);
  if (const std::uintmax_t size = std::filesystem::file_size(file); size > kLargestFile) {
    throw InputError(fmt::format("{}: {} bytes are no file written by hand; at most {} are read",
                                 file.string(), size, kLargestFile));
  }
  note_input(file.string());
  refuse_urdf_and_table(file);
  refuse_open_questions(file.string());
  try {
    YAML::Node node = YAML::LoadFile(file.string());
    YamlField root(file.string(), "", node);
    if (!node.IsMap()) root.fail("must be a mapping of fields, 'name: value'");
    return root;
  } catch (const YAML::ParserException& error) {
    throw InputError(
        fmt::format("{}:{}: not valid YAML: {}", file.string(), error.mark.line + 1, error.msg));
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}: cannot be read: {}", file.string(), error.msg));
  }
}

void YamlField::fail(const std::string& message) const {
  const YAML::Mark mark = node_.Mark();
  const std::string where = mark.is_null() ? file_ : fmt::format("{}:{}", file_, mark.line + 1);
  if (path_.empty()) throw InputError(fmt::format("{}: {}", where, message));
  throw InputError(fmt::format("{}: {}: {}", where, shortened(path_, 300), message));
}

void YamlField::allow_keys(std::initializer_list<std::string_view> keys) const {
  std::set<std::string> seen;
  for (const auto& [key, field] : entries()) {
    if (std::ranges::find(keys, key) == keys.end()) {
      field.fail(fmt::format("unknown field; known here: {}", fmt::join(keys, ", ")));
    }
    if (!seen.insert(key).second) field.fail("given twice");
  }
}

bool YamlField::has(const std::string& key) const {
  return node_.IsMap() && static_cast<bool>(node_[key]);
}

YamlField YamlField::at(const std::string& key) const {
  if (!node_.IsMap()) fail("must be a mapping of fields, 'name: value'");
  const std::string path = path_.empty() ? key : path_ + "." + key;
  const YAML::Node child = node_[key];
  if (!child || child.IsNull()) fail(fmt::format("field '{}' is missing", key));
  return {file_, path, child};
}

std::vector<std::pair<std::string, YamlField>> YamlField::entries() const {
  if (!node_.IsMap()) fail("must be a mapping of fields, 'name: value'");
  std::vector<std::pair<std::string, YamlField>> result;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) fail("field names must be plain words");
    const auto& key = entry.first.Scalar();
    result.emplace_back(key,
                        YamlField(file_, path_.empty() ? key : path_ + "." + key, entry.second));
  }
  return result;
}

std::vector<YamlField> YamlField::items() const {
  if (!node_.IsSequence()) fail("must be a list, [a, b, ...]");
  std::vector<YamlField> result;
  for (std::size_t i = 0; i < node_.size(); ++i) {
    result.push_back(YamlField(file_, fmt::format("{}[{}]", path_, i), node_[i]));
  }
  return result;
}

std::string YamlField::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty()) fail("must be a word");
  return node_.Scalar();
}

double YamlField::number() const {
  if (!node_.IsScalar()) fail("must be a number");
  double value = 0.0;
  if (!YAML::convert<double>::decode(node_, value)) {
    fail(fmt::format("must be a number, is '{}'", shortened(node_.Scalar())));
  }
  if (!std::isfinite(value)) fail(fmt::format("must be finite, is {}", shortened(node_.Scalar())));
  return value;
}

double YamlField::positive() const {
  const double value = number();
  if (value <= 0.0) fail(fmt::format("must be positive, is {}", value));
  return value;
}

double YamlField::non_negative() const {
  const double value = number();
  if (value < 0.0) fail(fmt::format("must not be negative, is {}", value));
  return value;
}

std::size_t YamlField::count() const {
  const double value = number();
  if (value < 1.0 || value > kLargestCount || value != std::floor(value)) {
    fail(fmt::format("must be a whole number from 1 to {:.0f}, is {}", kLargestCount, value));
  }
  return static_cast<std::size_t>(value);
}

std::vector<double> YamlField::numbers(std::size_t expected_size) const {
  std::vector<double> result;
  for (const YamlField& item : items()) result.push_back(item.number());
  if (result.size() != expected_size) {
    fail(fmt::format("must hold {} numbers, holds {}", expected_size, result.size()));
  }
  return result;
}

std::string YamlField::choice(std::initializer_list<std::string_view> words) const {
  const std::string word = text();
  if (std::ranges::find(words, word) == words.end()) {
    fail(fmt::format("must be one of {}; is '{}'", fmt::join(words, ", "), shortened(word)));
  }
  return word;
}

std::string YamlField::dump() const { return YAML::Dump(node_); }

}  // namespace graybox
