#include "diagnosis/signals/real_transform.hpp"

#include <fftw3.h>

#include <cmath>
#include <complex>

namespace graybox {

std::mutex& fourier_planning() {
  static std::mutex mutex;
  return mutex;
}

struct RealTransform::Work {
  explicit Work(std::size_t n)
      : length(n),
        signal(fftw_alloc_real(n), fftw_free),
        spectrum(fftw_alloc_complex(n / 2 + 1), fftw_free),
        scaled(static_cast<Eigen::Index>(n / 2 + 1)) {
    const std::scoped_lock lock(fourier_planning());
    plan = fftw_plan_dft_r2c_1d(static_cast<int>(n), signal.get(), spectrum.get(), FFTW_ESTIMATE);
  }
  ~Work() {
    const std::scoped_lock lock(fourier_planning());
    fftw_destroy_plan(plan);
  }
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  std::size_t length;
  std::unique_ptr<double[], void (*)(void*)> signal;
  std::unique_ptr<fftw_complex[], void (*)(void*)> spectrum;
  Eigen::VectorXcd scaled;
  fftw_plan plan = nullptr;
};

RealTransform::RealTransform(std::size_t length) : work_(std::make_unique<Work>(length)) {}
RealTransform::~RealTransform() = default;

std::size_t RealTransform::length() const { return work_->length; }

const Eigen::VectorXcd& RealTransform::run(const Eigen::Ref<const Eigen::VectorXd>& signal) {
  Eigen::Map<Eigen::VectorXd>(work_->signal.get(), signal.size()) = signal;
  fftw_execute(work_->plan);
  const double scale = 1.0 / std::sqrt(static_cast<double>(work_->length));
  for (Eigen::Index k = 0; k < work_->scaled.size(); ++k) {
    const fftw_complex& value = work_->spectrum[static_cast<std::size_t>(k)];
    work_->scaled(k) = scale * std::complex<double>(value[0], value[1]);
  }
  return work_->scaled;
}

}  // namespace graybox
