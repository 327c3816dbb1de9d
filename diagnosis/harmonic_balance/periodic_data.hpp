// PeriodicData: the recordings of a periodic campaign as spectra of one period, freed of leakage,
// with the covariance of the noise V = Y - G U of each line.
//
// Lines: all up to `line_factor` times the highest excited one. Lines that are not excited say
// which non-linear physics is at work. Only lines from the lowest excited one on count.
//
// Noise, by level, comes from samples between the lines of the period (line_spectra.hpp). They are
// y - G u with the measured response at excited lines and the model's above them. They are pooled
// over positions, recordings and neighbouring lines until there are `noise_samples` degrees of
// freedom q. Between those lines it is interpolated. Whitening uses Phi_hat^-1 (q - n_y) / q, which
// has the mean Phi^-1. With one period the noise stated in the campaign is taken. `model_accuracy`
// times the output's own size is added, for equations are solved to finite accuracy only.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/common_error.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/responses/frequency_response_estimate.hpp"
#include "diagnosis/signals/real_transform.hpp"

namespace graybox {

struct PeriodicDataOptions {
  double line_factor = 2.5;
  double noise_samples = 200.0;
  double model_accuracy = 1e-6;
  int threads = 1;
};

// Degrees of freedom that a covariance of so many outputs is pooled to.
[[nodiscard]] double wanted_noise_samples(const PeriodicDataOptions& options, Eigen::Index outputs);

struct MeasuredRecord {
  std::string name;
  std::size_t position = 0;  // of PeriodicData::positions
  std::size_t group = 0;     // of noise
  double level = 0.0;
  Eigen::MatrixXcd output;       // n_y x (K + 1), line 0 not used
  Eigen::MatrixXcd input;        // n_u x (K + 1)
  Eigen::MatrixXd input_period;  // n_u x N, mean of the periods
  // The spectra of all periods together, scaled alike: line k is bin k P. Empty for a single
  // period.
  Eigen::Index periods = 1;                  // P
  Eigen::MatrixXcd output_bins, input_bins;  // n_y and n_u x bins from 0 on
  Eigen::VectorXd mean_offset;  // of the held coordinates (PlantFamily); empty: none known
  // Of the free motion that was taken out, beside the noise; null: none was.
  std::shared_ptr<const CommonError> common_error;
  // With it: the plant of motions beside the periodic one, what is left between the lines, n_y x
  // bins, and the power there of what was taken out, in the noise's.
  std::shared_ptr<const LinearPlant> free_plant;
  Eigen::MatrixXcd between_lines;
  double free_power = 0.0;

  // Whitened residuals or derivatives, [n_y (K + 1)] columns, made independent of each other.
  void decorrelate(Eigen::Ref<Eigen::MatrixXcd> columns) const {
    if (common_error) common_error->take_out(columns);
  }
};

// What the covariance of a line typically was estimated from.
struct NoisePool {
  double samples = 0.0;  // q, complex degrees of freedom
  double lines = 1.0;    // that share them
  double own = 0.0;      // complex degrees of freedom of all lines together, each counted once
};

struct PeriodicData {
  std::size_t period = 0;
  double sample_time = 0.0;
  Eigen::Index first_line = 1;               // that counts
  Eigen::Index last_line = 0;                // K
  std::vector<double> frequencies;           // rad/s, of lines 0 ... K
  std::vector<std::size_t> excited;          // lines
  std::vector<Eigen::VectorXd> positions;    // rad; one of size 0 for lumped models
  std::vector<std::vector<double>> degrees;  // the same
  std::vector<std::string> position_names;
  std::vector<std::string> outputs, output_units;  // channels
  std::vector<MeasuredRecord> estimation, validation;
  // [group][line]: L with E |(L V)_c|^2 = 2, so that real and imaginary parts have variance one.
  std::vector<std::vector<Eigen::MatrixXcd>> whitening;
  std::vector<NoisePool> noise_pools;                // by group; empty: stated noise
  std::vector<FrequencyResponseEstimate> responses;  // of the estimation records, where complete

  // Index of a position given in degrees; the number of positions if it is none of them.
  [[nodiscard]] std::size_t position_of(const std::vector<double>& degrees) const;
  [[nodiscard]] Eigen::Index line_count() const { return last_line - first_line + 1; }
  [[nodiscard]] double numbers_in(const std::vector<MeasuredRecord>& records) const {
    return 2.0 * static_cast<double>(static_cast<Eigen::Index>(outputs.size()) * line_count()) *
           static_cast<double>(records.size());
  }
};

// Lines and frequencies of `excited` lines (ascending) and those up to `line_factor` times the last
// of them, without records.
[[nodiscard]] PeriodicData periodic_frame(std::size_t period, double sample_time,
                                          const std::vector<std::size_t>& excited,
                                          double line_factor);

// One record in memory, [samples x (n_y + n_u)], outputs first: lines as they are, free motion
// included.
[[nodiscard]] MeasuredRecord measured_record(const PeriodicData& frame,
                                             const Eigen::Ref<const Eigen::MatrixXd>& signals,
                                             Eigen::Index outputs, RealTransform& transform);

// Throws InputError of one line for what the periodic route can't use.
[[nodiscard]] PeriodicData read_periodic_data(const Campaign& campaign, const PlantFamily& family,
                                              const PeriodicDataOptions& options);

}  // namespace graybox
