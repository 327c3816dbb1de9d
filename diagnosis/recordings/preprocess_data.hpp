// What the steps of preprocessing share: channels by name, units, refusals in one line. For the
// files of preprocess.hpp alone.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {

class PreprocessData {
 public:
  PreprocessData(const std::string& source, Signals& data) : source_(source), data_(data) {}

  [[nodiscard]] Signals& data() const { return data_; }
  // Throws InputError "source: preprocess: text".
  [[noreturn]] void fail(const std::string& text) const;
  // The sample time; refuses irregular samples for `step`.
  [[nodiscard]] double even(const char* step) const;
  [[nodiscard]] std::size_t index_of(const std::string& name) const;
  [[nodiscard]] std::vector<Eigen::Index> indices(const std::vector<std::string>& names) const;
  // A combination of channels is filtered as its least filtered one.
  [[nodiscard]] const Signal& least_filtered(const std::vector<std::string>& names) const;
  // Refuses a channel in another unit.
  void expect_unit(const char* step, const std::string& name, const std::string& unit) const;
  static void append(SignalPiece& piece, const Eigen::MatrixXd& columns);

 private:
  const std::string& source_;
  Signals& data_;
};

}  // namespace graybox
