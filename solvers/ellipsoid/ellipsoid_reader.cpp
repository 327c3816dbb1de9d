// The reading half of ellipsoid_file.hpp. It needs no solver, so that the fuzzer links it alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/files/json_fields.hpp"
#include "problems/files/json_file.hpp"
#include "solvers/ellipsoid/ellipsoid_file.hpp"

namespace graybox {
namespace {

using EllipsoidJson = nlohmann::ordered_json;

class EllipsoidReader {
 public:
  EllipsoidReader(const std::string& path, const PointSet& points)
      : fields_(path), points_(points), n_(points.dimension) {}

  EllipsoidFile read(const std::string& path) {
    parse(path);
    EllipsoidFile file;
    file.ellipsoid.dimension = n_;
    const auto centred = root_.find("centred");
    file.centred = centred != root_.end() && centred->is_boolean() && centred->get<bool>();
    file.ellipsoid.centre = numbers(root_, "centre");
    file.ellipsoid.remainder.assign(n_, 0.0);
    if (root_.contains("centre_remainder")) {
      file.ellipsoid.remainder = numbers(root_, "centre_remainder");
    }
    const auto is_zero = [](double x) { return x == 0.0; };
    if (file.centred && !(std::ranges::all_of(file.ellipsoid.centre, is_zero) &&
                          std::ranges::all_of(file.ellipsoid.remainder, is_zero))) {
      fields_.fail("centred is true, but the centre is not zero");
    }
    file.ellipsoid.factor = root_.contains("factor") ? factor() : factor_from_shape();
    file.support = support();
    file.dropped = dropped();
    for (const std::size_t i : file.support.indices) {
      if (std::ranges::find(file.dropped, i) != file.dropped.end()) {
        fields_.fail(fmt::format("point {} is both in contact and dropped", i));
      }
    }
    return file;
  }

 private:
  void parse(const std::string& path) {
    root_ = read_json_file<EllipsoidJson>(path);
    const auto format = root_.is_object() ? root_.find("format") : root_.end();
    if (format == root_.end() || *format != kEllipsoidFormat) {
      fields_.fail(fmt::format("no object of format {}", kEllipsoidFormat));
    }
  }

  [[nodiscard]] std::vector<double> numbers(const EllipsoidJson& parent, const char* key) const {
    const auto found = parent.find(key);
    if (found == parent.end()) fields_.fail(fmt::format("{} is missing", key));
    return row(*found, key);
  }

  [[nodiscard]] std::vector<double> row(const EllipsoidJson& entry, const char* key) const {
    const auto is_finite = [](const EllipsoidJson& x) {
      return x.is_number() && std::isfinite(x.get<double>());
    };
    if (!entry.is_array() || entry.size() != n_ || !std::ranges::all_of(entry, is_finite)) {
      fields_.fail(fmt::format("{} must have {} finite numbers a row, one for each column of {}",
                               key, n_, points_.path));
    }
    return entry.get<std::vector<double>>();
  }

  [[nodiscard]] std::vector<double> square(const char* key) const {
    const auto found = root_.find(key);
    if (found == root_.end()) fields_.fail("factor or shape is missing");
    if (!found->is_array() || found->size() != n_) {
      fields_.fail(fmt::format("{} must have {} rows", key, n_));
    }
    std::vector<double> full;
    for (const EllipsoidJson& entry : *found) {
      const std::vector<double> values = row(entry, key);
      full.insert(full.end(), values.begin(), values.end());
    }
    return full;
  }

  [[nodiscard]] std::vector<double> factor() const {
    const std::vector<double> full = square("factor");
    std::vector<double> packed(packed_size(n_));
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) {
        const double value = full[i * n_ + j];
        if (j > i ? value != 0.0 : j == i && !(value > 0.0)) {
          fields_.fail("factor must be lower triangular with a positive diagonal");
        }
        if (j <= i) packed[packed_index(i, j)] = value;
      }
    }
    return packed;
  }

  [[nodiscard]] std::vector<double> factor_from_shape() const {
    const std::vector<double> shape = square("shape");
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double difference = std::abs(shape[i * n_ + j] - shape[j * n_ + i]);
        const double size = std::sqrt(std::abs(shape[i * n_ + i] * shape[j * n_ + j]));
        if (!(difference <= 1e-12 * size)) fields_.fail("shape must be symmetric");
      }
    }
    std::vector<double> packed = factor_of_shape(shape, n_);
    if (packed.empty()) fields_.fail("shape must be positive definite");
    return packed;
  }

  [[nodiscard]] WeightedPoints support() const {
    WeightedPoints found;
    const auto contact = root_.find("contact");
    if (contact == root_.end() || !contact->is_array()) return found;
    for (std::size_t k = 0; k < contact->size(); ++k) {
      const EllipsoidJson& entry = (*contact)[k];
      const std::size_t index = point_index(entry, "contact", k);
      const auto weight = entry.find("weight");
      if (weight == entry.end()) return {};  // they prove nothing
      if (!weight->is_number() || !(weight->get<double>() >= 0.0) ||
          !std::isfinite(weight->get<double>())) {
        fields_.fail(fmt::format("contact[{}]: weight must be a number of at least 0", k));
      }
      found.indices.push_back(index);
      found.weights.push_back(weight->get<double>());
    }
    return found;
  }

  [[nodiscard]] std::vector<std::size_t> dropped() const {
    std::vector<std::size_t> found;
    const auto list = root_.find("dropped");
    if (list == root_.end() || !list->is_array()) return found;
    for (std::size_t k = 0; k < list->size(); ++k) {
      found.push_back(point_index((*list)[k], "dropped", k));
    }
    return found;
  }

  [[nodiscard]] std::size_t point_index(const EllipsoidJson& entry, const char* key,
                                        std::size_t k) const {
    const std::optional<std::size_t> index = JsonFields::index_below(entry, points_.count);
    if (!index) {
      fields_.fail(
          fmt::format("{}[{}]: index must be an integer from 0 to {}", key, k, points_.count - 1));
    }
    return *index;
  }

  JsonFields fields_;
  const PointSet& points_;
  std::size_t n_;
  EllipsoidJson root_;
};

}  // namespace

EllipsoidFile read_ellipsoid(const std::string& path, const PointSet& points) {
  return EllipsoidReader(path, points).read(path);
}

}  // namespace graybox
