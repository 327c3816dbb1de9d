// PlantFamily: a model as the periodic route sees it, robot or lumped: one linear plant for each
// position and each value of its parameters, and what of the model is not linear.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/sampled_response.hpp"
#include "diagnosis/hypotheses/candidate_place.hpp"
#include "problems/elements/element.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

struct ModelParameter {
  std::string name;
  std::string unit;
  double start = 0.0;
  bool positive = false;  // estimated by its logarithm
};

// The forces that the model itself has beyond its linear plant: for a robot, in deviations from
// rest,
//   f = -[(M(q) - M) q'' + c(q, q') + g(q) - g(q*) - K_g (q - q*)]   on the arm.
class OwnForce {
 public:
  virtual ~OwnForce() = default;
  // Each n x times; q counts from rest.
  virtual void evaluate(const Eigen::MatrixXd& q, const Eigen::MatrixXd& velocity,
                        const Eigen::MatrixXd& acceleration, Eigen::MatrixXd& force) = 0;
};

struct PeriodEnd {
  Eigen::VectorXd input,
      error;  // u and r - y at the last sample of a period; no error without references
  Eigen::VectorXd output;           // y at the sample after it
  Eigen::VectorXd output_integral;  // of the periodic part of y, of mean zero, there
  Eigen::VectorXd output_mean;      // of y over the period
};

class PlantFamily {
 public:
  virtual ~PlantFamily() = default;

  [[nodiscard]] const std::vector<ModelParameter>& parameters() const { return parameters_; }
  // Their starts.
  [[nodiscard]] Eigen::VectorXd start_values() const {
    Eigen::VectorXd values(static_cast<Eigen::Index>(parameters_.size()));
    for (Eigen::Index p = 0; p < values.size(); ++p) {
      values(p) = parameters_[static_cast<std::size_t>(p)].start;
    }
    return values;
  }
  [[nodiscard]] double sample_time() const { return sample_time_; }
  [[nodiscard]] Eigen::Index input_count() const { return inputs_; }
  [[nodiscard]] Eigen::Index output_count() const { return outputs_; }
  // Laws of the model that are not part of the linear plant; their parameters are free as well.
  [[nodiscard]] const std::vector<Element>& elements() const { return elements_; }
  [[nodiscard]] const std::vector<CandidatePlace>& places() const { return places_; }

  // `bodies`: elements that change the plant itself: inertia and payload (arm axes and flange of
  // robots), and constant forces where places shift the rest. Throws InputError where there is no
  // rest.
  [[nodiscard]] virtual LinearPlant plant(const Eigen::VectorXd& joint_angles,
                                          const Eigen::VectorXd& parameters,
                                          std::span<const Element> bodies) const = 0;
  // Null where the model is linear. The plant must outlive it.
  [[nodiscard]] virtual std::unique_ptr<OwnForce> own_force(
      const LinearPlant& plant, std::span<const Element> bodies) const = 0;
  // F^-1 of the model's controller at w, empty without one. Inputs and outputs are as many then.
  [[nodiscard]] virtual Eigen::MatrixXcd inverse_controller(double w) const = 0;
  [[nodiscard]] virtual bool shifts_rest(const Location&) const { return false; }
  // How far the held coordinates (LinearPlant::held) stand from rest on average over the period:
  // from what the controller knows at the period's end, which is taken to have started at rest, or
  // from a sensor of position. Empty where it can't be told.
  [[nodiscard]] virtual Eigen::VectorXd mean_offset(const PeriodEnd& end) const = 0;

  // Those of a graybox-places/1 file besides.
  virtual void add_places_of(const std::filesystem::path& file) = 0;

 protected:
  std::vector<ModelParameter> parameters_;
  std::vector<Element> elements_;
  std::vector<CandidatePlace> places_;
  double sample_time_ = 0.0;
  Eigen::Index inputs_ = 0, outputs_ = 0;
};

// A graybox-robot/1 or graybox-lumped/1 file, and graybox-places/1 files with further places
// (place_file.hpp). Throws InputError of one line.
[[nodiscard]] std::unique_ptr<PlantFamily> plant_family(
    const std::filesystem::path& model, std::span<const std::filesystem::path> places = {});

enum class PlantKind : std::int8_t {
  kFull,   // with the arm's own forces: Coriolis, changing inertia and gravity
  kLocal,  // motions so small that nothing but the linear plant shows
};

// A robot without elements or places for laws.
[[nodiscard]] std::unique_ptr<PlantFamily> robot_family(const RobotModel& robot,
                                                        PlantKind dynamics);

}  // namespace graybox
