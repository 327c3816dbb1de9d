// Estimated frequency responses as files.
//
//   .h5    attribute format = graybox-responses/1; a group response_1, response_2, ... each with
//          attributes position (degrees), level, realisation, realisations, recordings, period,
//          periods, sample_time, method, hold, inputs, outputs, input_units, output_units, and
//          datasets (K lines, or frequencies)
//            frequency [K]                         Hz
//            line [K]                              of one period; periodic way only
//            response [K x n_y x n_u x 2]          real and imaginary part
//            input_gram [K x n_u x n_u x 2]        W^H W: covariance of vec(response) = gram^T (x)
//            Phi noise_covariance [K x n_y x n_y x 2]  Phi of noise, if known
//            total_covariance [K x n_y x n_y x 2]  Phi of noise and distortion, if known
//            noise_degrees_of_freedom, total_degrees_of_freedom [K]
//            bias [K x n_y x n_u x 2]              by feedback, if known
//            output_level [K x n_y]
//            detection_frequency [D], detection_level, detection_noise, detection_p_value [D x n_y]
//   .csv   a row for every response, frequency, output and input, with standard deviations, the
//   radius
//          of the 95 % region and the levels of output, noise, total and distortion
//
// Sizes and names: frequency_response_estimate.hpp.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/responses/frequency_response_estimate.hpp"

namespace graybox {

// Throws InputError for an ending that is not known.
void check_response_file_name(const std::string& path);

// By the ending. Written in full or not at all. Throws InputError for another ending and where the
// file can't be written.
void write_responses(const std::string& path,
                     const std::vector<FrequencyResponseEstimate>& estimates);

}  // namespace graybox
