#include "solvers/ellipsoid/ellipsoid_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string_view>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

using EllipsoidJson = nlohmann::ordered_json;

constexpr std::string_view kEllipsoidFormat = "graybox-ellipsoid/1";

EllipsoidJson matrix_rows(const std::vector<double>& values, std::size_t columns) {
  EllipsoidJson rows = EllipsoidJson::array();
  for (std::size_t from = 0; from < values.size(); from += columns) {
    rows.push_back(
        std::vector<double>(values.begin() + static_cast<std::ptrdiff_t>(from),
                            values.begin() + static_cast<std::ptrdiff_t>(from + columns)));
  }
  return rows;
}

std::vector<double> full_lower(const Ellipsoid& ellipsoid) {
  const std::size_t n = ellipsoid.dimension;
  std::vector<double> full(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) full[i * n + j] = ellipsoid.factor[packed_index(i, j)];
  }
  return full;
}

double distance(const PointSet& points, std::size_t i, const Ellipsoid& ellipsoid,
                ExtendedPlace& place) {
  place_in_frame(points, i, ellipsoid, place);
  return static_cast<double>(
      std::sqrt(std::inner_product(place.y.begin(), place.y.end(), place.y.begin(), 0.0L)));
}

EllipsoidJson contact_entries(const PointSet& points, const EllipsoidSolution& solution) {
  std::vector<std::size_t> order(solution.support.indices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto& weights = solution.support.weights;
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
  EllipsoidJson entries = EllipsoidJson::array();
  ExtendedPlace place;
  for (const std::size_t k : order) {
    const std::size_t i = solution.support.indices[k];
    const double* x = points.point(i);
    entries.push_back({{"index", i},
                       {"weight", weights[k]},
                       {"distance", distance(points, i, solution.ellipsoid, place)},
                       {"point", std::vector<double>(x, x + points.dimension)}});
  }
  return entries;
}

EllipsoidJson dropped_entries(const PointSet& points, const std::vector<DroppedPoint>& dropped) {
  EllipsoidJson entries = EllipsoidJson::array();
  for (const DroppedPoint& point : dropped) {
    const double* x = points.point(point.index);
    entries.push_back({{"index", point.index},
                       {"weight", point.weight},
                       {"volume_factor", point.volume_factor},
                       {"point", std::vector<double>(x, x + points.dimension)}});
  }
  return entries;
}

class EllipsoidReader {
 public:
  EllipsoidReader(const std::string& path, const PointSet& points)
      : path_(path), points_(points), n_(points.dimension) {}

  EllipsoidFile read() {
    parse();
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
      fail("centred is true, but the centre is not zero");
    }
    file.ellipsoid.factor = root_.contains("factor") ? factor() : factor_from_shape();
    file.support = support();
    file.dropped = dropped();
    for (const std::size_t i : file.support.indices) {
      if (std::ranges::find(file.dropped, i) != file.dropped.end()) {
        fail(fmt::format("point {} is both in contact and dropped", i));
      }
    }
    return file;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError(fmt::format("{}: {}", path_, problem));
  }

  void parse() {
    { const InputFile present(path_); }  // missing, a folder, empty
    std::ifstream stream(path_, std::ios::binary);
    try {
      root_ = EllipsoidJson::parse(stream);
    } catch (const EllipsoidJson::parse_error& error) {
      fail(fmt::format("not valid JSON at byte {}; is the file truncated?", error.byte));
    }
    const auto format = root_.is_object() ? root_.find("format") : root_.end();
    if (format == root_.end() || *format != kEllipsoidFormat) {
      fail(fmt::format("no object of format {}", kEllipsoidFormat));
    }
  }

  [[nodiscard]] std::vector<double> numbers(const EllipsoidJson& parent, const char* key) const {
    const auto found = parent.find(key);
    if (found == parent.end()) fail(fmt::format("{} is missing", key));
    return row(*found, key);
  }

  [[nodiscard]] std::vector<double> row(const EllipsoidJson& entry, const char* key) const {
    const auto is_finite = [](const EllipsoidJson& x) {
      return x.is_number() && std::isfinite(x.get<double>());
    };
    if (!entry.is_array() || entry.size() != n_ || !std::ranges::all_of(entry, is_finite)) {
      fail(fmt::format("{} must have {} finite numbers a row, one for each column of {}", key, n_,
                       points_.path));
    }
    return entry.get<std::vector<double>>();
  }

  [[nodiscard]] std::vector<double> square(const char* key) const {
    const auto found = root_.find(key);
    if (found == root_.end()) fail("factor or shape is missing");
    if (!found->is_array() || found->size() != n_) {
      fail(fmt::format("{} must have {} rows", key, n_));
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
          fail("factor must be lower triangular with a positive diagonal");
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
        if (!(difference <= 1e-12 * size)) fail("shape must be symmetric");
      }
    }
    std::vector<double> packed = factor_of_shape(shape, n_);
    if (packed.empty()) fail("shape must be positive definite");
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
        fail(fmt::format("contact[{}]: weight must be a number of at least 0", k));
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
    const auto index = entry.is_object() ? entry.find("index") : entry.end();
    if (index == entry.end() || !index->is_number_integer() || *index < 0 ||
        *index >= points_.count) {
      fail(fmt::format("{}[{}]: index must be an integer from 0 to {}", key, k, points_.count - 1));
    }
    return index->get<std::size_t>();
  }

  std::string path_;
  const PointSet& points_;
  std::size_t n_;
  EllipsoidJson root_;
};

}  // namespace

nlohmann::ordered_json ellipsoid_json(const PointSet& points, const EllipsoidOptions& options,
                                      const PeeledEllipsoid& found) {
  const EllipsoidSolution& solution = found.solution;
  const Ellipsoid& ellipsoid = solution.ellipsoid;
  const EllipsoidCertificate& certificate = solution.certificate;
  EllipsoidJson axes = EllipsoidJson::array();
  for (const SemiAxis& axis : semi_axes(ellipsoid)) {
    axes.push_back({{"length", axis.length}, {"direction", axis.direction}});
  }
  EllipsoidJson root{
      {"format", kEllipsoidFormat},
      {"written_by", written_by()},
      {"points", points.path},
      {"count", points.count},
      {"dimension", points.dimension},
      {"names", points.names},
      {"centred", options.centred},
      {"status", to_string(solution.status)},
      {"options",
       {{"gap", options.gap},
        {"time_limit", options.time_limit},
        {"threads", options.threads},
        {"seed", options.seed}}},
      {"centre", ellipsoid.centre},
      {"centre_remainder", ellipsoid.remainder},
      {"factor", matrix_rows(full_lower(ellipsoid), points.dimension)},
      {"shape", matrix_rows(shape_matrix(ellipsoid), points.dimension)},
      {"semi_axes", std::move(axes)},
      {"log_volume", certificate.log_volume},
      {"volume_bound", certificate.volume_bound},
      {"rounding_bound", certificate.rounding_bound},
      {"largest_distance", certificate.largest_distance},
      {"contact", contact_entries(points, solution)},
      {"counters",
       {{"rounds", solution.rounds}, {"passes", solution.passes}, {"seconds", solution.seconds}}}};
  if (!found.dropped.empty()) root["dropped"] = dropped_entries(points, found.dropped);
  return root;
}

EllipsoidFile read_ellipsoid(const std::string& path, const PointSet& points) {
  return EllipsoidReader(path, points).read();
}

}  // namespace graybox
