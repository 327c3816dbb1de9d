// Steps that compute channels from channels sample by sample: scale, integral, product, sum,
// constant and the torque of a motor from its voltage and speed (campaign.hpp has the formulas).
// Units are checked; a combination is as filtered as its least filtered part.
#pragma once

#include <string_view>

#include "diagnosis/recordings/preprocess_data.hpp"

namespace graybox {

void scale_channels(const PreprocessData& context, const Scale& step);
// Trapezoids: wrong by h^2/12 times the change of slope. Zero at the first sample of each piece.
void add_integrals(const PreprocessData& context, const Integral& step);
void add_product(const PreprocessData& context, const Product& step);
void add_sum(const PreprocessData& context, const WeightedSum& step);
void add_constant(const PreprocessData& context, const ConstantChannel& step);
void add_motor_torque(const PreprocessData& context, const MotorTorque& step);

// rad/s^2 -> rad/s -> rad; empty for what is no rate.
[[nodiscard]] std::string unit_of_integral(std::string_view base);

}  // namespace graybox
