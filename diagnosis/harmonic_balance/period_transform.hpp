// Between lines of one period and a grid of times over it, in the scaling of real_transform.hpp for
// a period of N samples:
//
//   x(t_j) = N^(-1/2) (X_0 + 2 Re sum_{k=1..K} X_k exp(2 pi i j k / L)),   t_j = j N T_s / L,
//   X_k    = N^(1/2) / L  sum_j x(t_j) exp(-2 pi i j k / L).
//
// L is as the caller needs it, finer than the samples or coarser: laws with kinks need L well above
// 2 K, for what they add above the line L - K folds back onto the lines.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>

namespace graybox {

// One object for each thread.
class PeriodTransform {
 public:
  // K lines besides line 0; L >= 2 K + 2. Throws InputError for fewer.
  PeriodTransform(std::size_t period, Eigen::Index lines, std::size_t grid);
  ~PeriodTransform();
  PeriodTransform(const PeriodTransform&) = delete;
  PeriodTransform& operator=(const PeriodTransform&) = delete;

  [[nodiscard]] Eigen::Index lines() const { return lines_; }
  [[nodiscard]] Eigen::Index grid() const { return grid_; }
  // `spectrum`: lines 0 ... K. `times`: L values.
  void to_times(const Eigen::Ref<const Eigen::VectorXcd>& spectrum,
                Eigen::Ref<Eigen::VectorXd> times);
  void to_lines(const Eigen::Ref<const Eigen::VectorXd>& times,
                Eigen::Ref<Eigen::VectorXcd> spectrum);

 private:
  struct Work;
  Eigen::Index lines_, grid_;
  double to_times_, to_lines_;  // scales
  std::unique_ptr<Work> work_;
};

// The least L >= `least` of the form 2^a 3^b 5^c, even.
[[nodiscard]] std::size_t fast_grid(std::size_t least);

}  // namespace graybox
