#include "diagnosis/free_motion/free_feedback.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// Rms in standard deviations up to which a residual may be nothing but noise.
constexpr double kNoiseAtMost = 2.0;

class FeedbackRemoval {
 public:
  FeedbackRemoval(const FreeMotionFrame& frame, const std::vector<FreePlant>& plants)
      : frame_(frame), plants_(plants) {}

  void run(const std::vector<FreeRecord>& records) const {
    if (!knows_controller()) return;
#pragma omp parallel num_threads(frame_.options.threads)
    {
      SteadyStateSolver solver(frame_.family, frame_.data, {});
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records.size(); ++i) {
        if (!frame_.clock.stops()) take_out_feedback(solver, records[i]);
      }
    }
    stop_if_requested();
  }

 private:
  [[nodiscard]] bool knows_controller() const {
    const Index inputs = frame_.family.inverse_controller(frame_.data.frequencies[1]).rows();
    return inputs == frame_.family.input_count() && inputs == frame_.family.output_count();
  }

  // What the controller made of the outputs' noise and free motion, -(G + F^-1)^-1 of them. Of what
  // is more than noise may be, only so much.
  [[nodiscard]] VectorXcd feedback_of(const FreePlant& plant, Index bin, const VectorXcd& noise,
                                      const VectorXcd& free_motion) const {
    const double size = (frame_.weight(plant, bin) * noise).norm() /
                        std::sqrt(2.0 * static_cast<double>(noise.size()));
    const double share = std::min(1.0, kNoiseAtMost / std::max(size, 1e-300));
    const MatrixXcd loop =
        plant.response[at(bin)] + frame_.family.inverse_controller(frame_.frequency(plant, bin));
    return -loop.partialPivLu().solve(share * noise + free_motion);
  }

  // The residual stays what it is, also where the model is not linear.
  void take_out_feedback(SteadyStateSolver& solver, const FreeRecord& free) const {
    MeasuredRecord& record = *free.record;
    const FreePlant& plant = plants_[free.plant];
    const MatrixXcd noise = record.output - solver.solve(frame_.model, record, nullptr).output;
    for (Index k = frame_.data.first_line; k <= frame_.data.last_line; ++k) {
      const Index bin = k * plant.periods;
      record.input.col(k) -=
          feedback_of(plant, bin, noise.col(k), free.excess.col(bin) - free.rest.col(bin));
    }
    renew_input_period(record);
    record.output = solver.solve(frame_.model, record, nullptr).output + noise;
  }

  // Whatever earlier rounds did to it.
  void renew_input_period(MeasuredRecord& record) const {
    const Index last =
        std::min(frame_.data.last_line, (static_cast<Index>(frame_.data.period) - 2) / 2);
    PeriodTransform transform(frame_.data.period, last, frame_.data.period);
    VectorXd times(record.input_period.cols());
    VectorXcd lines(last + 1);
    for (Index c = 0; c < record.input.rows(); ++c) {
      times = record.input_period.row(c).transpose();
      transform.to_lines(times, lines);
      lines = record.input.row(c).head(last + 1).transpose() - lines;
      lines(0) = 0.0;
      transform.to_times(lines, times);
      record.input_period.row(c) += times.transpose();
    }
  }

  const FreeMotionFrame& frame_;
  const std::vector<FreePlant>& plants_;
};

}  // namespace

void take_out_feedback(const FreeMotionFrame& frame, const FreeRecords& free) {
  FeedbackRemoval(frame, free.plants).run(free.records);
}

}  // namespace graybox
