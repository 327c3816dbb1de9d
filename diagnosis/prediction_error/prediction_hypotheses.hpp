// What may be missing from a lumped model that is seen in any motion: places and laws, and the
// shapes in which a search starts them in the light of the present fit.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/prediction_error/ripple_trials.hpp"
#include "diagnosis/predictor/extended_lumped_model.hpp"
#include "diagnosis/predictor/prediction_data.hpp"
#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

class PredictionHypotheses {
 public:
  // `excluded`: laws that are not tried.
  PredictionHypotheses(const LumpedModel& model, const PredictionData& data,
                       const std::vector<std::string>& excluded);

  [[nodiscard]] const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  [[nodiscard]] const Location& location(std::size_t hypothesis) const {
    return locations_[hypothesis];
  }
  // This law at the sensor of this output; none: it is not tried.
  [[nodiscard]] std::optional<std::size_t> at_sensor(std::size_t output,
                                                     std::string_view law) const;
  // Friction, constant forces, weights, late channels: what many machines have. Others must gain
  // more (prediction_search.hpp).
  [[nodiscard]] bool is_plain(std::size_t hypothesis) const;
  // A delay or a lag.
  [[nodiscard]] bool is_late_channel(std::size_t hypothesis) const;
  // One that acts in the few moments in which something changes: a late channel, or dry friction,
  // where the motion stops or turns.
  [[nodiscard]] bool acts_in_moments(std::size_t hypothesis) const;
  // A weight that pulls about as this spring of the model does, by least squares over the motion.
  // None where no angle is measured, or hardly a part of a turn.
  [[nodiscard]] std::optional<LawExtension> weight_like(const ExtendedLumpedModel& present,
                                                        std::size_t spring,
                                                        const Eigen::MatrixXd& motion) const;
  // What friction held while the only mass stood still under forces that differ by much; 0: it did
  // not. Dry friction then does not slide over gradually.
  [[nodiscard]] double held_at_standstill() const { return held_at_standstill_; }
  // z of a fit with this law over the one without it: z_as_given() of late channels, z_between() of
  // others.
  [[nodiscard]] double z_of_law(std::size_t hypothesis, const PredictionFit& poorer,
                                const PredictionFit& richer) const;
  // Every law in every start that the motion suggests. `motion`: q and q' of all coordinates
  // (PredictionFitter::motion). Ripples as they are given.
  [[nodiscard]] std::vector<LawExtension> extensions(
      const ExtendedLumpedModel& present, const Eigen::MatrixXd& motion,
      const std::vector<RippleTrial>& ripples = {}) const;

 private:
  struct MotionAt;
  void add_place(const Location& place, const std::string& yaml);
  void add_driven_laws(const Location& mass, Eigen::Index at, const LumpedModel& model);
  [[nodiscard]] bool coasts(const LumpedModel& model, Eigen::Index mass, Eigen::Index input) const;
  void add_signal(LocationKind kind, std::size_t channel, const LumpedModel& model);
  void measure_input(Eigen::Index channel, const PredictionData& data);
  void add(const Location& place, const std::string& yaml, const std::string& law);
  void extend_force(std::size_t hypothesis, const ExtendedLumpedModel& present, const MotionAt& at,
                    const std::vector<RippleTrial>& ripples, std::vector<LawExtension>& list) const;
  void extend_friction(const LawExtension& plain, const ExtendedLumpedModel& present,
                       const MotionAt& at, std::vector<LawExtension>& list) const;
  void extend_driven(const LawExtension& plain, const ExtendedLumpedModel& present,
                     const MotionAt& at, std::vector<LawExtension>& list) const;
  [[nodiscard]] bool winds_up(const Location& place, const MotionAt& at) const;
  void extend_spring(const LawExtension& plain, const ExtendedLumpedModel& present,
                     const MotionAt& at, std::vector<LawExtension>& list) const;
  void extend_play(const LawExtension& plain, const ExtendedLumpedModel& present,
                   std::size_t spring, const MotionAt& at, std::vector<LawExtension>& list) const;
  void extend_modes(const LawExtension& plain, const ExtendedLumpedModel& present,
                    std::vector<LawExtension>& list) const;
  void extend_ripples(const LawExtension& plain, const ExtendedLumpedModel& present,
                      const std::vector<RippleTrial>& ripples,
                      std::vector<LawExtension>& list) const;
  void extend_memory(const LawExtension& plain, const ExtendedLumpedModel& present,
                     const MotionAt& at, std::vector<LawExtension>& list) const;
  void extend_bouc_wen(const LawExtension& plain, const ExtendedLumpedModel& present,
                       const MotionAt& at, std::vector<LawExtension>& list) const;
  void extend_signal(std::size_t hypothesis, const ExtendedLumpedModel& present,
                     std::vector<LawExtension>& list) const;
  [[nodiscard]] MotionAt motion_at(const Location& place, const Eigen::MatrixXd& motion) const;

  const PredictionData* data_;
  std::vector<std::string> excluded_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<Location> locations_;
  std::vector<double> input_peaks_, input_scales_;
  std::vector<bool> has_sizes_between_;  // of inputs: a drive that is on or off shows no curve
  double held_at_standstill_ = 0.0;
  bool rotates_ = false;
  bool measures_position_ = false;  // some output is a position
  bool has_known_scale_ = false;    // some parameter of the model is stated as known
};

}  // namespace graybox
