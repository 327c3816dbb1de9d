#include "problems/information/jacobian_information.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/aligned_array.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/information/factor_form.hpp"

namespace graybox {
namespace {

void require_shape(const Jacobians& jacobians) {
  const std::size_t needed = jacobians.candidates * jacobians.outputs * jacobians.parameters;
  if (needed == 0) throw InputError(jacobians.source + ": there are no numbers");
  if (jacobians.values.size() != needed) {
    throw InputError(fmt::format("{}: {} numbers, but {} candidates of {} x {} need {}",
                                 jacobians.source, jacobians.values.size(), jacobians.candidates,
                                 jacobians.outputs, jacobians.parameters, needed));
  }
  const auto bad =
      std::ranges::find_if_not(jacobians.values, [](double x) { return std::isfinite(x); });
  if (bad != jacobians.values.end()) {
    const auto place = static_cast<std::size_t>(bad - jacobians.values.begin());
    throw InputError(fmt::format("{}: candidate {} has an entry {}; remove or repair it",
                                 jacobians.source,
                                 place / (jacobians.outputs * jacobians.parameters), *bad));
  }
}

// packed += row row^T.
void add_square(const double* row, std::size_t d, double* packed) {
  for (std::size_t i = 0; i < d; ++i) {
    const double factor = row[i];
    for (std::size_t j = 0; j <= i; ++j) packed[j] += factor * row[j];
    packed += i + 1;
  }
}

// Row k of W J.
void whitened_row(const double* jacobian, std::size_t d, const JacobianNoise& noise, std::size_t k,
                  std::span<double> row) {
  std::ranges::fill(row, 0.0);
  for (std::size_t l = 0; l <= k; ++l) {
    const double weight = noise.whitening()[k * noise.outputs() + l];
    if (weight == 0.0) continue;
    for (std::size_t j = 0; j < d; ++j) row[j] += weight * jacobian[l * d + j];
  }
}

// packed += J^T W^T W J; `row` holds d numbers.
void add_information(const double* jacobian, std::size_t d, const JacobianNoise& noise,
                     std::span<double> row, double* packed) {
  for (std::size_t k = 0; k < noise.outputs(); ++k) {
    whitened_row(jacobian, d, noise, k, row);
    add_square(row.data(), d, packed);
  }
}

// A set of factors with the Jacobians' names and coordinates.
InformationSet finished_factors(Jacobians jacobians, AlignedArray factors) {
  require_finite_factors(jacobians.source, factors.span(), jacobians.outputs, jacobians.parameters);
  return InformationSet::of_factors(jacobians.parameters, jacobians.outputs, std::move(factors),
                                    std::move(jacobians.table), std::move(jacobians.names),
                                    std::move(jacobians.source));
}

AlignedArray room_for(const Jacobians& jacobians) {
  const std::size_t size = jacobians.candidates * packed_size(jacobians.parameters);
  require_memory_for_numbers(static_cast<long double>(size), jacobians.source);
  return AlignedArray(size, 0.0);
}

InformationSet finished(Jacobians jacobians, AlignedArray information) {
  const auto bad =
      std::ranges::find_if_not(information.span(), [](double x) { return std::isfinite(x); });
  if (bad != information.span().end()) {
    const auto place = static_cast<std::size_t>(bad - information.span().begin());
    throw InputError(fmt::format(
        "{}: the information matrix of candidate {} overflows; choose other units or parameters",
        jacobians.source, place / packed_size(jacobians.parameters)));
  }
  return InformationSet(jacobians.parameters, std::move(information), std::move(jacobians.table),
                        std::move(jacobians.names), std::move(jacobians.source));
}

}  // namespace

JacobianNoise JacobianNoise::deviations(std::span<const double> deviations) {
  JacobianNoise noise;
  noise.outputs_ = deviations.size();
  noise.whitening_.assign(noise.outputs_ * noise.outputs_, 0.0);
  for (std::size_t k = 0; k < noise.outputs_; ++k) {
    if (!(deviations[k] > 0.0) || !std::isfinite(deviations[k])) {
      throw InputError(
          fmt::format("noise: the standard deviation {} must be a positive number", deviations[k]));
    }
    noise.whitening_[k * noise.outputs_ + k] = 1.0 / deviations[k];
  }
  return noise;
}

JacobianNoise JacobianNoise::covariance(std::span<const double> matrix, std::size_t outputs) {
  if (outputs == 0 || matrix.size() != outputs * outputs) {
    throw InputError(fmt::format("noise: the covariance of {} outputs has {} entries, not {}",
                                 outputs, outputs * outputs, matrix.size()));
  }
  const auto r = static_cast<Eigen::Index>(outputs);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const RowMajor covariance = Eigen::Map<const RowMajor>(matrix.data(), r, r);
  if (!covariance.allFinite() || !((covariance - covariance.transpose()).cwiseAbs().maxCoeff() <=
                                   1e-12 * covariance.cwiseAbs().maxCoeff())) {
    throw InputError("noise: the covariance must be symmetric, of finite numbers");
  }
  const Eigen::LLT<RowMajor> cholesky(covariance);
  if (cholesky.info() != Eigen::Success) {
    throw InputError("noise: the covariance must be positive definite");
  }
  JacobianNoise noise;
  noise.outputs_ = outputs;
  noise.whitening_.resize(outputs * outputs);
  Eigen::Map<RowMajor>(noise.whitening_.data(), r, r) =
      cholesky.matrixL().solve(RowMajor::Identity(r, r));
  return noise;
}

std::vector<double> information(std::span<const double> jacobian, std::size_t parameters,
                                const JacobianNoise& noise) {
  if (parameters == 0 || jacobian.size() != noise.outputs() * parameters) {
    throw InputError(
        fmt::format("a Jacobian of {} outputs and {} parameters has {} entries, not {}",
                    noise.outputs(), parameters, noise.outputs() * parameters, jacobian.size()));
  }
  std::vector<double> packed(packed_size(parameters), 0.0), row(parameters);
  add_information(jacobian.data(), parameters, noise, row, packed.data());
  return packed;
}

InformationSet information_set_from_jacobians(Jacobians jacobians, const JacobianNoise& noise,
                                              SetForm form) {
  require_shape(jacobians);
  if (noise.outputs() != jacobians.outputs) {
    throw InputError(fmt::format("noise: of {} outputs, but {} has {} a candidate", noise.outputs(),
                                 jacobians.source, jacobians.outputs));
  }
  const std::size_t d = jacobians.parameters, p = packed_size(d);
  if (form == SetForm::kFactors) {
    AlignedArray factors(jacobians.values.size());
    for (std::size_t k = 0; k < jacobians.candidates * jacobians.outputs; ++k) {
      const std::size_t output = k % jacobians.outputs;
      whitened_row(jacobians.values.data() + (k - output) * d, d, noise, output,
                   factors.span().subspan(k * d, d));
    }
    return finished_factors(std::move(jacobians), std::move(factors));
  }
  AlignedArray matrices = room_for(jacobians);
  std::vector<double> row(d);
  for (std::size_t i = 0; i < jacobians.candidates; ++i) {
    add_information(jacobians.values.data() + i * jacobians.outputs * d, d, noise, row,
                    matrices.data() + i * p);
  }
  return finished(std::move(jacobians), std::move(matrices));
}

// The logistic weight is 1 / (2 + exp(eta) + exp(-eta)): without cancellation and overflow.
double information_weight(GeneralisedLinearModel model, double linear_predictor) {
  if (model == GeneralisedLinearModel::kPoisson) return std::exp(linear_predictor);
  const double small = std::exp(-std::abs(linear_predictor));
  return small / ((1.0 + small) * (1.0 + small));
}

InformationSet generalised_linear_set(Jacobians regressors, GeneralisedLinearModel model,
                                      std::span<const double> theta, SetForm form) {
  require_shape(regressors);
  const std::size_t d = regressors.parameters, p = packed_size(d);
  if (theta.size() != d) {
    throw InputError(fmt::format("nominal parameters: {} are given, but {} has {} columns",
                                 theta.size(), regressors.source, d));
  }
  const bool factors = form == SetForm::kFactors;
  AlignedArray numbers = factors ? AlignedArray(regressors.values.size()) : room_for(regressors);
  std::vector<double> row(d);
  for (std::size_t k = 0; k < regressors.candidates * regressors.outputs; ++k) {
    const double* x = regressors.values.data() + k * d;
    double eta = 0.0;
    for (std::size_t j = 0; j < d; ++j) eta += x[j] * theta[j];
    const double root = std::sqrt(information_weight(model, eta));
    for (std::size_t j = 0; j < d; ++j) row[j] = root * x[j];
    if (factors) {
      std::ranges::copy(row, numbers.begin() + k * d);
    } else {
      add_square(row.data(), d, numbers.data() + k / regressors.outputs * p);
    }
  }
  return factors ? finished_factors(std::move(regressors), std::move(numbers))
                 : finished(std::move(regressors), std::move(numbers));
}

}  // namespace graybox
