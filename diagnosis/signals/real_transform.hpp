// The discrete Fourier transform of real signals, by FFTW, in the scaling that graybox uses
// throughout (multisine.hpp):
//
//   X(k) = n^(-1/2) sum_t x(t) exp(-2 pi j k t / n),   k = 0 ... n/2.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <mutex>

namespace graybox {

// FFTW makes and destroys plans in one thread at a time: hold this meanwhile.
[[nodiscard]] std::mutex& fourier_planning();

// Transforms of one length; one object for each thread. Results depend on the signal alone.
class RealTransform {
 public:
  explicit RealTransform(std::size_t length);
  ~RealTransform();
  RealTransform(const RealTransform&) = delete;
  RealTransform& operator=(const RealTransform&) = delete;

  [[nodiscard]] std::size_t length() const;
  // Valid until the next call. `signal` has the length of this transform.
  const Eigen::VectorXcd& run(const Eigen::Ref<const Eigen::VectorXd>& signal);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace graybox
