// A start for the inertia and damping of one mass, from a log of its drive and its motion.
//
// Nothing is differentiated: encoder counts differentiated twice hold no acceleration. For a pole
// p = b/J the motion is linear in all that acts,
//
//   q(t) = q0 + v0 (1 - exp(-p t))/p + sum over forces k of (c_k/J) [G_p f_k](t),
//   G_p = 1/(s (s + p)), and 1/(s + p) for a velocity,
//
// with the drive f_0 (c_0 = 1), a constant, dry friction sign(v), and a weight sin q, cos q or a
// spring q. The drive is held between samples, which makes G_p exact. The log is cut into segments
// of one length; q0 and v0 of each are projected out (separable least squares: Golub and Pereyra
// 1973). So noise stays where it is, at q, and the least squares have no errors in their columns
// but for small ones in sign(v) and sin q. The pole is found by a scan, from 0 to one sample.
//
// How sure a value is: the jackknife over ten groups of segments, the pole fitted anew in each.
// Forces and lengths of segments are chosen by it: the richest list of forces that leaves the
// inertia an error of a fifth, and the longest segments whose error is at most twice the smallest.
// SI units, or those of the force. Values are starts: the diagnosis fits them.
//
//   const OneMassStart start = start_one_mass({force, position, false, true, 0.001});
//   if (start.told == OneMassTold::kInertia) use(start.inertia, start.damping);
//
// A single transient can't be left out by the jackknife. Then the whole log is one segment, and the
// fewest forces that leave 1 % of its squares (5 % of a velocity's) are enough.
//
// Several logs of one mass are one least squares: forces act alike in all, and each segment has a
// start of its own. So two logs, each at one level of the drive, may tell the inertia together.
// Their order does not matter.
//
// Cost: O(n) for each of 41 poles and at most six lengths; n is at most 20 000 in all logs (longer
// ones are averaged).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

struct OneMassLog {
  Eigen::VectorXd force, motion;
  bool is_velocity = false;
  bool is_rotary = true;  // a weight acts by sin q and cos q
  double sample_time = 0.0;
};

enum class OneMassTold {
  kInertia,  // the log tells it
  kNothing,  // its error is above a third; values are what fits best, or scales of the log
  // The inertia is negative by three errors, beside all forces, too: values of the drive with its
  // sign turned.
  kReversed,
};

struct OneMassStart {
  OneMassTold told = OneMassTold::kNothing;
  double inertia = 1.0;
  double damping = 0.01;   // at least a hundredth of what takes the motion's power
  double spread = 1.0;     // standard error of the inertia over its size
  bool has_value = false;  // inertia and damping are an estimate, however poor
  // Reversed, and neither a spring nor a weight explains it: the mass stays negative by five errors
  // beside either. Then its size and standard error, the less sure ones of both.
  bool is_proved = false;
  double proved = 0.0, proved_error = 0.0;
  // A weight's force, sine sin q + cosine cos q, against the motion; 0: none was needed.
  double sine = 0.0, cosine = 0.0;
};

[[nodiscard]] OneMassStart start_one_mass(const OneMassLog& log);
// Logs of one sample time; those that are too short or hold no numbers are left out.
[[nodiscard]] OneMassStart start_one_mass(const std::vector<OneMassLog>& logs);

}  // namespace graybox
