#include "diagnosis/recording_files/record_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox::formats {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 16;
constexpr std::size_t kMostColumns = 10000;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

}  // namespace

RecordColumns::RecordColumns(std::string path) : path_(std::move(path)) {}

void RecordColumns::fail(const std::string& text) const {
  throw InputError(fmt::format("{}: record {}: {}", path_, records_ + 1, text));
}

RecordColumns::Values& RecordColumns::column(const std::string& name) {
  const auto [place, is_new] = values_.try_emplace(name);
  if (is_new) {
    if (names_.size() == kMostColumns) {
      fail(fmt::format("more than {} different keys; keys are names, not data", kMostColumns));
    }
    names_.push_back(name);
  }
  std::vector<double>& numbers = place->second.numbers;
  numbers.resize(records_, kMissing);
  return place->second;
}

void RecordColumns::add_value(const std::string& name, const Json& value, int depth) {
  if (depth > kDeepest) fail(name.substr(0, 40) + ": nested too deep; write fewer levels");
  if (value.is_object()) {
    for (const auto& [key, child] : value.items()) {
      add_value(name.empty() ? key : name + "." + key, child, depth + 1);
    }
    return;
  }
  if (value.is_array()) {
    for (std::size_t k = 0; k < value.size(); ++k) {
      add_value(fmt::format("{}[{}]", name, k + 1), value[k], depth + 1);
    }
    return;
  }
  Values& values = column(name);
  double number = kMissing;
  const bool is_stamp = value.is_string() && !values.has_text &&
                        values.stamps.take(value.get_ref<const std::string&>(), number);
  values.has_text = values.has_text || (value.is_string() && !is_stamp);
  values.has_numbers = values.has_numbers || value.is_number() || value.is_boolean();
  if ((values.has_text || values.stamps.has_any()) && values.has_numbers) {
    fail(fmt::format("'{}' holds text in one record and a number in another; write numbers or null",
                     name));
  }
  if (values.numbers.size() > records_) fail(fmt::format("'{}' is there twice", name));
  if (value.is_boolean()) number = value.get<bool>() ? 1.0 : 0.0;
  if (value.is_number()) number = value.get<double>();
  values.numbers.push_back(number);
}

void RecordColumns::add(const Json& record) {
  if (!record.is_object()) fail("is no object; write {\"name\": number, ...}");
  add_value("", record, 0);
  ++records_;
}

std::vector<RecordedColumn> RecordColumns::columns() const {
  std::vector<RecordedColumn> columns;
  for (const std::string& name : names_) {
    const Values& values = values_.at(name);
    const bool are_stamps = values.stamps.has_any() && !values.has_text;
    if (!values.has_numbers && !are_stamps) continue;
    Eigen::VectorXd all = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(records_), kMissing);
    std::copy(values.numbers.begin(), values.numbers.end(), all.begin());
    columns.push_back({name, {}, std::move(all)});
    if (!are_stamps) continue;
    columns.back().unit = "s";
    columns.back().origin = values.stamps.description();
  }
  return columns;
}

}  // namespace graybox::formats
