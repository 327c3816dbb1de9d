#include "diagnosis/harmonic_balance/period_transform.hpp"

#include <fftw3.h>

#include <cmath>
#include <complex>

#include "diagnosis/signals/real_transform.hpp"
#include "problems/base/error.hpp"

namespace graybox {

struct PeriodTransform::Work {
  explicit Work(std::size_t n)
      : times(fftw_alloc_real(n), fftw_free), lines(fftw_alloc_complex(n / 2 + 1), fftw_free) {
    const std::scoped_lock lock(fourier_planning());
    forward = fftw_plan_dft_r2c_1d(static_cast<int>(n), times.get(), lines.get(), FFTW_ESTIMATE);
    backward = fftw_plan_dft_c2r_1d(static_cast<int>(n), lines.get(), times.get(), FFTW_ESTIMATE);
  }
  ~Work() {
    const std::scoped_lock lock(fourier_planning());
    fftw_destroy_plan(forward);
    fftw_destroy_plan(backward);
  }
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  std::unique_ptr<double[], void (*)(void*)> times;
  std::unique_ptr<fftw_complex[], void (*)(void*)> lines;
  fftw_plan forward = nullptr, backward = nullptr;
};

PeriodTransform::PeriodTransform(std::size_t period, Eigen::Index lines, std::size_t grid)
    : lines_(lines),
      grid_(static_cast<Eigen::Index>(grid)),
      to_times_(1.0 / std::sqrt(static_cast<double>(period))),
      to_lines_(std::sqrt(static_cast<double>(period)) / static_cast<double>(grid)) {
  if (grid_ < 2 * lines_ + 2) throw InputError("a period's grid needs two points a line and two");
  work_ = std::make_unique<Work>(grid);
}

PeriodTransform::~PeriodTransform() = default;

void PeriodTransform::to_times(const Eigen::Ref<const Eigen::VectorXcd>& spectrum,
                               Eigen::Ref<Eigen::VectorXd> times) {
  fftw_complex* lines = work_->lines.get();
  for (Eigen::Index k = 0; k <= grid_ / 2; ++k) {
    const std::complex<double> value = k <= lines_ ? spectrum(k) : std::complex<double>(0.0);
    lines[k][0] = to_times_ * value.real();
    lines[k][1] = k == 0 ? 0.0 : to_times_ * value.imag();
  }
  fftw_execute(work_->backward);
  times = Eigen::Map<const Eigen::VectorXd>(work_->times.get(), grid_);
}

void PeriodTransform::to_lines(const Eigen::Ref<const Eigen::VectorXd>& times,
                               Eigen::Ref<Eigen::VectorXcd> spectrum) {
  Eigen::Map<Eigen::VectorXd>(work_->times.get(), grid_) = times;
  fftw_execute(work_->forward);
  for (Eigen::Index k = 0; k <= lines_; ++k) {
    const fftw_complex& value = work_->lines.get()[k];
    spectrum(k) = to_lines_ * std::complex<double>(value[0], value[1]);
  }
}

std::size_t fast_grid(std::size_t least) {
  for (std::size_t n = least + least % 2;; n += 2) {
    std::size_t rest = n;
    for (const std::size_t factor : {2U, 3U, 5U}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1) return n;
  }
}

}  // namespace graybox
