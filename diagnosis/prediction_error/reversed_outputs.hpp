// Sensors of coupled masses that count in opposite directions: told by prediction, before any law.
//
// Patterns of signs of the outputs are tried: the model at its best start (search_start.hpp),
// fitted ten samples ahead. Coupled masses move together below their resonance and against each
// other above, so that no wrong pattern predicts. A fault is claimed where another pattern leaves
// less than half of the cost that the stated one leaves and its blocks are better predicted by
// z > 3 (is_clearly_better). Positions that move together (kTogether) have one sign: a pattern that
// turns one of them is not tried. A spring to the ground that the model lacks asks for it, too.
//
// Two that always move alike (kGeared), but one kSmallestGear times as far as the other, may be
// tied by a gear or a belt. That is claimed where their ratio as a factor is clearly better than
// the model as stated, and no model with a spring at every free mass, with or without a constant
// force, is clearly better than it.
//
// Monte Carlo of two masses, free or on springs, which two thirds of the models lack: of 288
// recordings with right signs none raises an alarm; before positions that move together were asked,
// 20 of 144. Of 285 with one sign turned, 58 % are told; all move against each other (correlation
// below -0.45), so that nothing was lost. Of 253 behind a gear 32 % are told.
//
// All outputs together are reversed where the force that acts is. At low frequency a spring that
// the model lacks looks the same. So this pattern is held against the model with a spring at every
// free mass, and with a constant force beside it, and claimed by the same limits. A single start
// moves in few blocks: it is claimed, too, where it leaves less than 20 % of either cost, or 50 %
// where the force mostly acts against the motion. Where it does so both ways (drive_work.hpp), any
// gain is enough. It is asked of one mass, too.
//
// Cost: 2^outputs short fits; at most four outputs.
#pragma once

#include <optional>
#include <vector>

#include "diagnosis/hypotheses/channel_faults.hpp"
#include "diagnosis/prediction_error/prediction_hypotheses.hpp"
#include "diagnosis/predictor/prediction_data.hpp"

namespace graybox {

// At most one entry, which names all reversed channels. Throws Stopped on request.
[[nodiscard]] std::vector<ChannelFault> find_reversed_outputs(
    const LumpedModel& model, const PredictionData& data, const PredictionHypotheses& hypotheses,
    int threads);

// What the model alone leaves with the sign of its one force turned: rms over the signal, fitted so
// many samples ahead, 0: in free run. None where it has not one force, or no fit is usable.
[[nodiscard]] std::optional<double> error_with_force_reversed(
    const LumpedModel& model, const PredictionData& data, const PredictionHypotheses& hypotheses,
    Eigen::Index horizon, int threads);

}  // namespace graybox
