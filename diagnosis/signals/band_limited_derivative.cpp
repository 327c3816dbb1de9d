#include "diagnosis/signals/band_limited_derivative.hpp"

#include <fftw3.h>

#include <mutex>
#include <numbers>

#include "diagnosis/signals/real_transform.hpp"

namespace graybox {
namespace {

// In place. FFTW_ESTIMATE neither looks at the values nor at a clock: the same result every time.
void transform(fftw_r2r_kind kind, double* values, Eigen::Index size) {
  fftw_plan plan = nullptr;
  {
    const std::scoped_lock lock(fourier_planning());
    plan = fftw_plan_r2r_1d(static_cast<int>(size), values, values, kind, FFTW_ESTIMATE);
  }
  fftw_execute(plan);
  const std::scoped_lock lock(fourier_planning());
  fftw_destroy_plan(plan);
}

}  // namespace

Eigen::VectorXd band_limited_derivative(double sample_time,
                                        const Eigen::Ref<const Eigen::VectorXd>& values) {
  const Eigen::Index last = values.size() - 1;
  const Eigen::VectorXd steps =
      Eigen::VectorXd::LinSpaced(values.size(), 0.0, static_cast<double>(last));
  const double rise = (values(last) - values(0)) / static_cast<double>(last);  // a step
  Eigen::VectorXd series = values - rise * steps;
  series.array() -= values(0);
  // FFTW's sine transform is 2 sum_j x_j sin(pi j k / last), that is last * b_k.
  transform(FFTW_RODFT00, series.data() + 1, last - 1);
  const double frequency = std::numbers::pi / static_cast<double>(last);  // of k = 1, rad a step
  series.array() *= 0.5 * frequency / static_cast<double>(last) * steps.array();
  series(0) = rise;
  series(last) = 0.0;
  // Its cosine transform is c_0 + (-1)^k c_last + 2 sum_j c_j cos(pi j k / last).
  transform(FFTW_REDFT00, series.data(), values.size());
  return series / sample_time;
}

}  // namespace graybox
