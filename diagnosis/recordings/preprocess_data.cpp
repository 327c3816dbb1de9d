#include "diagnosis/recordings/preprocess_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "problems/base/error.hpp"

namespace graybox {

using Index = Eigen::Index;

void PreprocessData::fail(const std::string& text) const {
  throw InputError(fmt::format("{}: preprocess: {}", source_, text));
}

double PreprocessData::even(const char* step) const {
  if (!data_.sample_time) {
    fail(fmt::format(
        "{} needs even samples, but sample_time is irregular; put a resample before it", step));
  }
  return *data_.sample_time;
}

std::size_t PreprocessData::index_of(const std::string& name) const {
  const auto found = std::ranges::find(data_.signals, name, &Signal::name);
  if (found == data_.signals.end()) fail(fmt::format("there is no channel '{}'", name));
  return static_cast<std::size_t>(found - data_.signals.begin());
}

std::vector<Index> PreprocessData::indices(const std::vector<std::string>& names) const {
  std::vector<Index> result;
  for (const std::string& name : names) result.push_back(static_cast<Index>(index_of(name)));
  return result;
}

const Signal& PreprocessData::least_filtered(const std::vector<std::string>& names) const {
  const auto height = [](const Signal& signal) {
    return signal.low_pass > 0.0 ? signal.low_pass : std::numeric_limits<double>::infinity();
  };
  const Signal* least = &data_.signals[index_of(names.front())];
  for (const std::string& name : names) {
    const Signal& signal = data_.signals[index_of(name)];
    if (height(signal) > height(*least)) least = &signal;
  }
  return *least;
}

void PreprocessData::expect_unit(const char* step, const std::string& name,
                                 const std::string& unit) const {
  const Signal& signal = data_.signals[index_of(name)];
  if (signal.unit == unit) return;
  fail(fmt::format("{}: {} is in {}, but must be in {}; correct the channel's unit or gain", step,
                   name, signal.unit, unit));
}

void PreprocessData::append(SignalPiece& piece, const Eigen::MatrixXd& columns) {
  const Index before = piece.values.cols();
  piece.values.conservativeResize(Eigen::NoChange, before + columns.cols());
  piece.values.rightCols(columns.cols()) = columns;
}

}  // namespace graybox
