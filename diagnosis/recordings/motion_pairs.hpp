// Channels that measure one motion, compared directly, without a model of the mechanism: position
// and velocity of one coordinate, reference and measured value, two encoders of one axis. What is
// found (late_signal.hpp): a reversed sign, another gain, a channel that is late.
//
// A velocity is compared with the rate of every position that varies like it, two channels of one
// unit with each other. Of several partners the one that varies most alike is taken (correlation
// over shifts of up to eight samples). Two channels are one motion where less than 15 % of the
// deviation is left; two outputs where less than 2 % is left and the gain is within 5 % of 1, as
// joints that move in step vary alike. Motion follows its reference as a loop does, so references
// are compared where they are currents, torques or voltages. Then
//   sign   the gain is negative,
//   gain   it is further than 2 % and 4 standard errors from 1 (velocity against position, and
//          reference against measured value; two outputs may have a gear between them),
//   late   by more than 4 standard errors and a fifth of a sample, and the misfit falls by 30 %,
//   rate   a velocity beside the only position that is not its derivative: more than half is left.
// What it finds in published recordings: docs/how_to/channels_that_disagree.md.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/recordings/preprocess.hpp"
#include "diagnosis/signal_faults/finding.hpp"

namespace graybox {

// Adds warnings; `source` is the experiment's name. Even samples only; the longest piece is used.
// Cost: late_signal.hpp's for each channel that has a partner.
void find_late_channels(const std::string& source, const Signals& data,
                        std::vector<Finding>& findings);

}  // namespace graybox
