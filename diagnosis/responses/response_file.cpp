#include "diagnosis/responses/response_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <complex>
#include <filesystem>
#include <iterator>
#include <numbers>
#include <utility>

#include "diagnosis/responses/confidence.hpp"
#include "diagnosis/responses/response_summary.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/formats/hdf5_writer.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

std::string ending_of(const std::string& path) {
  return std::filesystem::path(path).extension().string();
}
bool is_hdf5(const std::string& path) {
  return ending_of(path) == ".h5" || ending_of(path) == ".hdf5";
}

const char* name_of_hold(InputHold hold) {
  if (hold == InputHold::kFirst) return "first";
  return hold == InputHold::kZero ? "zero" : "band_limited";
}

// ---- HDF5 ---------------------------------------------------------------------------------------

class Hdf5Group {
 public:
  Hdf5Group(const hdf5::Writer& writer, hid_t parent, const std::string& name)
      : writer_(&writer), group_(writer.group(parent, name.c_str())) {}

  template <typename Value>
  void attribute(const char* name, const Value& value) const {
    writer_->attribute(group_, name, value);
  }
  void dataset(const char* name, const std::vector<hsize_t>& shape,
               const std::vector<double>& values) const {
    (void)writer_->dataset(group_, name, shape, values.data());
  }
  void matrices(const char* name, const std::vector<MatrixXcd>& matrices) const {
    if (matrices.empty()) return;
    std::vector<double> values;
    for (const MatrixXcd& matrix : matrices) {
      for (Index i = 0; i < matrix.rows(); ++i) {
        for (Index j = 0; j < matrix.cols(); ++j) {
          values.push_back(matrix(i, j).real());
          values.push_back(matrix(i, j).imag());
        }
      }
    }
    dataset(name,
            {matrices.size(), static_cast<hsize_t>(matrices.front().rows()),
             static_cast<hsize_t>(matrices.front().cols()), 2},
            values);
  }

 private:
  const hdf5::Writer* writer_;
  hdf5::Handle group_;
};

void write_covariance(const Hdf5Group& group, const std::string& kind,
                      const std::vector<OutputCovariance>& covariances) {
  if (covariances.empty()) return;
  std::vector<MatrixXcd> matrices;
  std::vector<double> degrees;
  for (const OutputCovariance& one : covariances) {
    matrices.push_back(one.covariance);
    degrees.push_back(one.degrees_of_freedom);
  }
  group.matrices((kind + "_covariance").c_str(), matrices);
  group.dataset((kind + "_degrees_of_freedom").c_str(), {degrees.size()}, degrees);
}

void write_detection(const Hdf5Group& group, const FrequencyResponseEstimate& estimate) {
  const std::vector<DetectionLine>& lines = estimate.detection;
  if (lines.empty()) return;
  std::vector<double> frequency, level, noise, p_value;
  for (const DetectionLine& line : lines) {
    frequency.push_back(line.frequency / (2.0 * std::numbers::pi));
    level.insert(level.end(), line.level.begin(), line.level.end());
    noise.insert(noise.end(), line.noise.begin(), line.noise.end());
    p_value.insert(p_value.end(), line.p_value.begin(), line.p_value.end());
  }
  const std::vector<hsize_t> shape{lines.size(), estimate.outputs.size()};
  group.dataset("detection_frequency", {lines.size()}, frequency);
  group.dataset("detection_level", shape, level);
  group.dataset("detection_noise", shape, noise);
  group.dataset("detection_p_value", shape, p_value);
}

void write_group(const hdf5::Writer& writer, hid_t file, std::size_t number,
                 const FrequencyResponseEstimate& estimate) {
  const Hdf5Group group(writer, file, fmt::format("response_{}", number));
  group.attribute("method", std::string(to_string(estimate.method)));
  group.attribute("hold", std::string(name_of_hold(estimate.hold)));
  group.attribute("position", estimate.position);
  group.attribute("inputs", fmt::format("{}", fmt::join(estimate.inputs, ", ")));
  group.attribute("outputs", fmt::format("{}", fmt::join(estimate.outputs, ", ")));
  group.attribute("input_units", fmt::format("{}", fmt::join(estimate.input_units, ", ")));
  group.attribute("output_units", fmt::format("{}", fmt::join(estimate.output_units, ", ")));
  for (const auto& [name, value] :
       {std::pair{"level", estimate.level},
        std::pair{"realisation", static_cast<double>(estimate.realisation)},
        std::pair{"realisations", static_cast<double>(estimate.realisations)},
        std::pair{"recordings", static_cast<double>(estimate.recordings)},
        std::pair{"period", static_cast<double>(estimate.period)},
        std::pair{"periods", static_cast<double>(estimate.periods)},
        std::pair{"sample_time", estimate.sample_time}}) {
    group.attribute(name, std::vector<double>{value});
  }
  std::vector<double> hertz;
  for (const double w : estimate.frequencies) hertz.push_back(w / (2.0 * std::numbers::pi));
  group.dataset("frequency", {hertz.size()}, hertz);
  if (!estimate.lines.empty()) {
    group.dataset("line", {estimate.lines.size()}, {estimate.lines.begin(), estimate.lines.end()});
  }
  group.matrices("response", estimate.responses);
  group.matrices("input_gram", estimate.input_gram);
  write_covariance(group, "noise", estimate.noise);
  write_covariance(group, "total", estimate.total);
  group.matrices("bias", estimate.bias);
  const Eigen::MatrixXd& level = estimate.output_level;
  group.dataset("output_level",
                {static_cast<hsize_t>(level.cols()), static_cast<hsize_t>(level.rows())},
                {level.data(), level.data() + level.size()});
  write_detection(group, estimate);
}

void write_hdf5_responses(const std::string& path,
                          const std::vector<FrequencyResponseEstimate>& estimates) {
  hdf5::write_file(path, [&](const hdf5::Writer& writer, hid_t file) {
    writer.attribute(file, "format", std::string("graybox-responses/1"));
    for (std::size_t k = 0; k < estimates.size(); ++k) {
      write_group(writer, file, k + 1, estimates[k]);
    }
  });
}

// ---- CSV ----------------------------------------------------------------------------------------

// Empty where there is no number.
std::string field(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : ""; }
std::string field(const Eigen::MatrixXd& values, Index i, Index k) {
  return values.size() == 0 ? "" : field(values(i, k));
}

void append_rows(fmt::memory_buffer& text, std::size_t number,
                 const FrequencyResponseEstimate& estimate) {
  const bool known = !estimate.noise.empty() || !estimate.total.empty();
  const Eigen::MatrixXd noise = output_deviations(estimate.noise);
  const Eigen::MatrixXd total = output_deviations(estimate.total);
  const Eigen::MatrixXd odd = distortion_levels(estimate, false);
  const Eigen::MatrixXd even = distortion_levels(estimate, true);
  const std::string head =
      fmt::format("{},{:g},{:g},{}", number, fmt::join(estimate.position, " "), estimate.level,
                  estimate.realisation == 0 ? "all" : std::to_string(estimate.realisation));
  for (std::size_t k = 0; k < estimate.frequencies.size(); ++k) {
    const auto at = static_cast<Index>(k);
    const MatrixXcd& response = estimate.responses[k];
    Eigen::MatrixXd deviation, radius;
    if (known) {
      deviation = estimate.variance(k).cwiseSqrt();
      radius = confidence_radius(estimate, k, 0.95);
    }
    for (Index i = 0; i < response.rows(); ++i) {
      const std::string levels =
          fmt::format("{},{},{},{},{}", field(estimate.output_level, i, at), field(noise, i, at),
                      field(total, i, at), field(odd, i, at), field(even, i, at));
      for (Index j = 0; j < response.cols(); ++j) {
        const std::complex<double> bias =
            estimate.bias.empty() ? std::complex<double>(NAN, NAN) : estimate.bias[k](i, j);
        fmt::format_to(std::back_inserter(text),
                       "{},{},{:.9g},{},{},{:.12g},{:.12g},{},{},{},{},{}\n", head,
                       estimate.lines.empty() ? "" : std::to_string(estimate.lines[k]),
                       estimate.frequencies[k] / (2.0 * std::numbers::pi),
                       estimate.outputs[static_cast<std::size_t>(i)],
                       estimate.inputs[static_cast<std::size_t>(j)], response(i, j).real(),
                       response(i, j).imag(), field(deviation, i, j), field(radius, i, j),
                       field(bias.real()), field(bias.imag()), levels);
      }
    }
  }
}

void write_csv_responses(const std::string& path,
                         const std::vector<FrequencyResponseEstimate>& estimates) {
  fmt::memory_buffer text;
  fmt::format_to(
      std::back_inserter(text),
      "response,position,level,realisation,line,frequency_hz,output,input,real,imaginary,"
      "standard_deviation,radius_95,bias_real,bias_imaginary,output_level,noise_level,"
      "total_level,odd_level,even_level\n");
  for (std::size_t k = 0; k < estimates.size(); ++k) append_rows(text, k + 1, estimates[k]);
  write_text_file(path, {text.data(), text.size()});
}

}  // namespace

void check_response_file_name(const std::string& path) {
  if (is_hdf5(path) || ending_of(path) == ".csv") return;
  throw InputError(fmt::format("{}: unknown ending '{}'; responses are written as .h5 or .csv",
                               path, ending_of(path)));
}

void write_responses(const std::string& path,
                     const std::vector<FrequencyResponseEstimate>& estimates) {
  check_response_file_name(path);
  if (is_hdf5(path)) {
    write_hdf5_responses(path, estimates);
  } else {
    write_csv_responses(path, estimates);
  }
}

}  // namespace graybox
