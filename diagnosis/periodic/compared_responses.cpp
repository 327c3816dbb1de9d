#include "diagnosis/periodic/compared_responses.hpp"

#include <cstddef>
#include <numbers>

#include "diagnosis/harmonic_balance/sampled_response.hpp"

namespace graybox {

ComparedResponses compared_responses(const PlantFamily& family, const PeriodicData& data,
                                     const Eigen::VectorXd& parameters) {
  ComparedResponses compared;
  for (const FrequencyResponseEstimate& estimate : data.responses) {
    compared.inputs = estimate.inputs;
    compared.outputs = estimate.outputs;
    compared.input_units = estimate.input_units;
    compared.output_units = estimate.output_units;
    const Eigen::VectorXd degrees = Eigen::Map<const Eigen::VectorXd>(
        estimate.position.data(), static_cast<Eigen::Index>(estimate.position.size()));
    const LinearPlant plant = family.plant(degrees * (std::numbers::pi / 180.0), parameters, {});
    const bool has_covariance = !estimate.noise.empty() || !estimate.total.empty();
    for (std::size_t k = 0; k < estimate.frequencies.size(); ++k) {
      ComparedResponse& line = compared.lines.emplace_back();
      line.measured = estimate.responses[k];
      line.model = sampled_response(plant, estimate.frequencies[k], data.sample_time);
      line.variance = has_covariance
                          ? estimate.variance(k)
                          : Eigen::MatrixXd::Zero(line.measured.rows(), line.measured.cols());
    }
  }
  return compared;
}

}  // namespace graybox
