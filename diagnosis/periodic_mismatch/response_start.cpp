#include "graybox/diagnosis/periodic_mismatch/response_start.hpp"

#include <algorithm>
#include <complex>
#include <memory>
#include <vector>

#include "graybox/diagnosis/maximum_likelihood.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXd;

class FamilyLocalResponse : public LocalResponse {
 public:
  FamilyLocalResponse(const PlantFamily& family, VectorXd position, const VectorXd& theta)
      : family_(family),
        position_(std::move(position)),
        plant_(family.plant(position_, theta, {})),
        images_(plant_, family.sample_time()) {}

  // The operating point follows: the plant is built again.
  void set_parameters(const VectorXd& theta) override {
    plant_ = family_.plant(position_, theta, {});
    images_ = HeldImages(plant_, family_.sample_time());
  }

  void evaluate(double w, MatrixXcd& response,
                std::vector<ResponseDerivative>* derivatives) override {
    const MatrixXcd inverse = receptance(plant_, w);
    const MatrixXcd driven =
        inverse * (hold_factor(w, family_.sample_time()) * plant_.input.cast<Complex>());
    MatrixXcd seen = plant_.velocity_output.cast<Complex>() * Complex(0.0, w);
    seen += plant_.position_output.cast<Complex>();
    response = seen * driven + images_.response(w);
    if (derivatives == nullptr) return;
    seen = (seen * inverse).eval();
    derivatives->resize(plant_.derivatives.size());
    for (std::size_t p = 0; p < plant_.derivatives.size(); ++p) {
      const PlantDerivative& change = plant_.derivatives[p];
      MatrixXcd dynamic = MatrixXcd::Zero(inverse.rows(), inverse.cols());
      if (change.stiffness.size() > 0) dynamic += change.stiffness.cast<Complex>();
      if (change.mass.size() > 0) dynamic -= w * w * change.mass.cast<Complex>();
      if (change.damping.size() > 0) dynamic += Complex(0.0, w) * change.damping.cast<Complex>();
      (*derivatives)[p].columns = -seen * dynamic;
      (*derivatives)[p].rows = driven;
    }
  }

  // Measurements bring their own.
  [[nodiscard]] ResponseNoise noise(double) override {
    throw InputError("the noise of a measured response is not known");
  }

 private:
  const PlantFamily& family_;
  VectorXd position_;
  LinearPlant plant_;
  HeldImages images_;
};

class FamilyResponseModel : public ResponseModel {
 public:
  explicit FamilyResponseModel(const PlantFamily& family) : family_(family) {}

  [[nodiscard]] std::vector<std::string> parameter_names() const override {
    std::vector<std::string> names;
    for (const ModelParameter& parameter : family_.parameters()) names.push_back(parameter.name);
    return names;
  }
  [[nodiscard]] Index output_count() const override { return family_.output_count(); }
  [[nodiscard]] Index input_count() const override { return family_.input_count(); }
  [[nodiscard]] MatrixXcd inverse_controller(double w) const override {
    return family_.inverse_controller(w);
  }
  [[nodiscard]] std::unique_ptr<LocalResponse> linearise(const VectorXd& position,
                                                         const VectorXd& theta) const override {
    return std::make_unique<FamilyLocalResponse>(family_, position, theta);
  }

 private:
  const PlantFamily& family_;
};

}  // namespace

std::optional<VectorXd> response_start(const PlantFamily& family, const PeriodicData& data,
                                       int threads) {
  VectorXd start(static_cast<Index>(family.parameters().size()));
  for (Index p = 0; p < start.size(); ++p) {
    start(p) = family.parameters()[static_cast<std::size_t>(p)].start;
  }
  if (data.responses.empty() || start.size() == 0 || !(start.minCoeff() > 0.0)) return {};
  std::vector<ResponseMeasurement> measurements;
  FitOptions options;
  options.starts = 3;
  options.threads = threads;
  try {
    for (const FrequencyResponseEstimate& estimate : data.responses) {
      measurements.push_back(response_measurement(estimate));
    }
    const FitResult fit =
        fit_maximum_likelihood(FamilyResponseModel(family), measurements, start, options);
    if (fit.theta.size() != start.size() || !fit.theta.allFinite() || fit.theta.minCoeff() <= 0.0) {
      return {};
    }
    return fit.theta;
  } catch (const InputError&) {
    return {};  // too few recordings for a covariance, or no rest on the way
  }
}

}  // namespace graybox
