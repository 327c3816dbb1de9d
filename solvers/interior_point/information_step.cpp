#include "solvers/interior_point/information_step.hpp"

#include <algorithm>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"

namespace graybox {

InformationStep::InformationStep(const NormalizedSet& normal, const NesterovTodd& scaling)
    : normal_(normal), scaling_(scaling), packed_(normal.packed_size()) {
  const auto d = static_cast<Eigen::Index>(normal.dimension());
  w_step_.resize(d, d);
  scaled_step_.resize(d, d);
  product_.resize(d, d);
}

void InformationStep::compute(std::span<const double> weight_step, std::span<double> traces) {
  scale_information_step(weight_step);
  scaled_step_ = scaling_.residual() - scaled_step_;
  price_scaled_step(traces);
}

void InformationStep::residual_traces(std::span<double> traces) {
  scaled_step_ = scaling_.residual();
  price_scaled_step(traces);
}

void InformationStep::apply_hessian(std::span<const double> weight_step, std::span<double> traces) {
  scale_information_step(weight_step);
  price_scaled_step(traces);
}

void InformationStep::scale_information_step(std::span<const double> weight_step) {
  std::ranges::fill(packed_, 0.0);
  kernels().accumulate(normal_.rows(), normal_.candidate_count(), normal_.packed_size(),
                       weight_step.data(), packed_.data());
  unpack(packed_.data(), normal_.dimension(), w_step_.data());
  product_.noalias() = w_step_ * scaling_.scaling();
  scaled_step_.noalias() = scaling_.scaling().transpose() * product_;
}

void InformationStep::price_scaled_step(std::span<double> traces) {
  product_.noalias() = scaled_step_ * scaling_.scaling().transpose();
  w_step_.noalias() = scaling_.scaling() * product_;
  pack_trace_dual(w_step_.data(), normal_.dimension(), packed_.data());
  kernels().price(normal_.rows(), normal_.candidate_count(), normal_.packed_size(), packed_.data(),
                  traces.data());
}

}  // namespace graybox
