// Faults of wiring, sign and unit: the commonest "missing physics" of all. Told from measured
// frequency responses and those of the model as it is, before anything is fitted.
//
// At each line and position the ratio of measured to modelled response, rho_ci = G_hat_ci / G_ci,
// would be one. Parameters that are off by tens of per cent and physics that is missing shift
// resonances and change it there. But over most of the band |log rho| stays small. A swapped wire,
// a wrong sign or unit changes all of it. With the dissimilarity
//   E_ci = median over lines and positions of |log rho_ci|   (complex logarithm),
// of the elements that stand out of their noise, a fault is claimed where undoing it brings the
// mean of E over the elements it touches from above `kSuspicious` = 0.7 to below `kSettled` = 0.35
// times that (and below 0.6). The best one is undone, then the next is looked for.
//
//   sign    of an input, an output, or both of one joint (a gear ratio's sign)
//   unit    of an input or output: a factor above 3 or below 1/3, named where it is a known one
//   swap    two inputs, two outputs, or both of two joints
//
// Faults that leave little more dissimilarity than the best and share elements with it are its
// rivals: the statement then is "one of".
//
// With one input and one output the sign or unit of one can't be told from that of the other; the
// fault then names both. Cost: O(lines positions n_y n_u (n_y + n_u)^2), milliseconds.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace graybox {

struct ComparedResponse {
  Eigen::MatrixXcd measured, model;  // n_y x n_u
  Eigen::MatrixXd variance;          // E |measured - truth|^2
};

struct ComparedResponses {
  std::vector<std::string> inputs, outputs;            // channels
  std::vector<std::string> input_units, output_units;  // as the campaign states them
  std::vector<ComparedResponse> lines;                 // of all positions
};

struct ChannelFault {
  std::vector<std::string> channels;
  std::string message;  // what is wrong, in one sentence without a final stop
  double dissimilarity_before = 0.0, dissimilarity_after = 0.0;
  std::string measure = "dissimilarity of responses";  // of what these are
  // Faults that would explain the recordings about as well; empty: this one is sure among those
  // tried.
  std::vector<std::string> rivals = {};

  // "one of: A; B", or what is wrong alone.
  [[nodiscard]] std::string statement() const;
  void add_rival(const ChannelFault& other);
};

[[nodiscard]] std::vector<ChannelFault> find_channel_faults(const ComparedResponses& compared);

// "torque is 1e+03 times too large for N m: thousandths of the unit stated?"
[[nodiscard]] std::string unit_fault_words(const std::string& channel, const std::string& unit,
                                           double factor);

}  // namespace graybox
