// Chi-square of a model with laws under periodic recordings at one value of its unknowns, with the
// information and the gradient that a step of Levenberg and Marquardt's method needs.
//
// Unknowns are the parameters of the model, then those of each law. Positive ones move by their
// logarithm, so that steps cannot leave what is allowed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {

// The factor of the multiple of b b^T that is nearest to a matrix, b^T M b / (b^T b)^2: of a change
// of C or K what acts as a force at a place.
[[nodiscard]] double multiple_along(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& b);

// How the parameters of a model and of laws move. Keeps references to both.
class FitUnknowns {
 public:
  FitUnknowns(const PlantFamily& family, const std::vector<ActingLaw>& laws);

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(kinds_.size()); }
  [[nodiscard]] Eigen::Index model_size() const;

  // Parameters of the model, then those that the laws have.
  [[nodiscard]] Eigen::VectorXd start_values(const Eigen::VectorXd& parameters) const;
  // The laws with the parameters that `values` holds for them.
  [[nodiscard]] std::vector<ActingLaw> laws_at(const Eigen::VectorXd& values) const;
  // dvalue / dunknown
  [[nodiscard]] double scale(Eigen::Index k, const Eigen::VectorXd& values) const;
  [[nodiscard]] Eigen::VectorXd moved(const Eigen::VectorXd& values,
                                      const Eigen::VectorXd& step) const;

 private:
  enum class Kind : std::int8_t { kFree, kPositive, kNonNegative, kUnitInterval };
  static Kind kind_of(ParameterRange range);

  const PlantFamily& family_;
  const std::vector<ActingLaw>& laws_;
  std::vector<Kind> kinds_;
};

// Everything at one value of the unknowns. Chi-square is infinite where there is no rest, or no
// finite force.
struct PeriodicEvaluation {
  Eigen::VectorXd values;
  double chi_square = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd information;           // J^T J by the unknowns
  Eigen::VectorXd gradient;              // J^T r, likewise
  Eigen::MatrixXd record_gradients;      // of each record (rows), by the parameters themselves
  std::vector<bool> imitated;            // parameters of the model that the freed force imitates
  std::vector<Eigen::MatrixXcd> forces;  // of each record, to start the next from
  double unsettled = 0.0;                // rms over the records
};

struct PeriodicEvaluatorOptions {
  // Where any force (or signal) may act, another at each line; null for none.
  const Location* freed = nullptr;
  int threads = 1;
};

class PeriodicEvaluator {
 public:
  PeriodicEvaluator(const PlantFamily& family, const PeriodicData& data,
                    const FitUnknowns& unknowns, const PeriodicEvaluatorOptions& options)
      : family_(family), data_(data), unknowns_(unknowns), options_(options) {}

  // `starts`: forces of each record to begin with, or null. `exact`: derivatives, else by mean
  // slopes. Throws Stopped.
  [[nodiscard]] PeriodicEvaluation evaluate(const Eigen::VectorXd& values,
                                            const std::vector<Eigen::MatrixXcd>* starts,
                                            bool exact) const;

 private:
  struct Workspace;   // of one thread
  struct RecordSums;  // what one recording adds

  [[nodiscard]] RecordSums sums_of(Workspace& work, const ModelState& model,
                                   const MeasuredRecord& record, const Eigen::MatrixXcd* start,
                                   bool exact) const;
  void add_up(std::vector<RecordSums>& sums, PeriodicEvaluation& result) const;
  static void hold_unseen(const std::vector<RecordSums>& sums, PeriodicEvaluation& result);

  const PlantFamily& family_;
  const PeriodicData& data_;
  const FitUnknowns& unknowns_;
  PeriodicEvaluatorOptions options_;
};

}  // namespace graybox
