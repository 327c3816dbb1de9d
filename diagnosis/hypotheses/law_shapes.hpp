// What of a law its score test can estimate without a refit: amplitudes, for each of several
// shapes.
//
// At given thresholds, transition velocities and wave lengths a law is a sum of basis functions
// times amplitudes. Shapes are spread over the motion that was recorded: thresholds over quantiles
// of |z|, velocities over those of |z'|.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/hypotheses/candidate_place.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {

// Of the motion at one place, all recordings together.
struct MotionScale {
  std::vector<double> deflections;  // |z|, sorted
  std::vector<double> excursions;   // |z - its mean|, sorted: what laws with memory know of z
  std::vector<double> rates;        // |z'|, sorted
  double range = 0.0;               // of z
  // In no recording it turns back. Then laws with memory show nothing that laws without do not.
  bool goes_one_way = false;
  // Shortest wave along a line that the samples show, of magnets or screws; 0: not asked.
  double finest_wave = 0.0;
  // Shortest wave that half of the moving samples show: four samples long at least, and slow enough
  // for what they were filtered by. Sines that are shorter resemble any rest.
  double shown_wave = 0.0;
  // It stood still under forces that differ: dry friction that slides over gradually holds nothing.
  bool stands_under_force = false;

  // Quantiles; 0 without motion.
  [[nodiscard]] double deflection(double share) const;
  [[nodiscard]] double excursion(double share) const;
  [[nodiscard]] double rate(double share) const;
};

// Friction whose transition is wider is no friction but a damper: half of the speed that nine
// samples in ten stay below. What held a force at standstill turns much sooner.
[[nodiscard]] inline double widest_transition(const MotionScale& scale) {
  constexpr double kHalf = 0.5, kSoon = 0.02;
  return (scale.stands_under_force ? kSoon : kHalf) * scale.rate(0.9);
}

struct LawShape {
  // Parameters of the laws whose sum, weighed by the amplitudes, is this law.
  std::vector<std::vector<double>> basis;
  // The law's parameters at given amplitudes, within their ranges; empty where none are possible
  // (a friction that drives).
  std::function<std::vector<double>(const Eigen::VectorXd&)> parameters;
  // Added to the score statistic where shapes are compared: a shape that leaves a parameter at its
  // physical value is preferred by so much.
  double head_start = 0.0;
  [[nodiscard]] bool allows(const Eigen::VectorXd& amplitudes) const {
    return !parameters(amplitudes).empty();
  }
  // Fits that start at shapes of the same one end alike: of each the best is tried. Below zero: a
  // valley of its own.
  int valley = -1;
};

// One amplitude, the parameter at `index`, of the law with the parameters `unit`.
[[nodiscard]] LawShape single_amplitude(std::vector<double> unit, std::size_t index, bool positive);

// Balancers of these levers and free lengths, in units of the anchor's distance, and so many angles
// a turn: only ratios and the angle shape the torque.
[[nodiscard]] std::vector<LawShape> balancer_shapes(const std::vector<double>& levers,
                                                    const std::vector<double>& free_lengths,
                                                    int angles);

// The shapes to try for a law with a force, or for inertia. The list is empty where no motion could
// show the law, and for laws of several parameters that have no shapes.
[[nodiscard]] std::vector<LawShape> law_shapes(const LawEntry& entry, const CandidatePlace& place,
                                               const MotionScale& scale);

// kNone of linear laws, of drag, of what follows the position where the model has no spring, and of
// users' laws.
[[nodiscard]] Characteristic characteristic_of(const LawEntry& entry, const CandidatePlace& place);

// Friction with a level that it holds at standstill: a joint has one.
[[nodiscard]] bool is_dry_friction(std::string_view law);

// Whether two laws at one place would be the same physics twice: two dry frictions, or one that
// grows less than speed does beside a dry one that is shaped at low speed, too. Beside plain dry
// friction it is another.
[[nodiscard]] bool are_one_friction(std::string_view one, std::string_view other);

// Laws that this one is for some of its parameters. `dry_friction_may_creep`: its transition
// velocity may lie above all velocities that were recorded, so that it is viscous.
[[nodiscard]] std::vector<std::string> special_cases_of(const LawEntry& entry,
                                                        bool dry_friction_may_creep);

// Whether a ripple along an angle comes back about once in a turn: within three quarters and four
// thirds of one. A weight does so exactly, and a part of a turn tells no other period from that.
[[nodiscard]] bool is_about_a_turn(double period);

}  // namespace graybox
