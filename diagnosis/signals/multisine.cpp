#include "diagnosis/signals/multisine.hpp"

#include <fftw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <mutex>
#include <numbers>

#include "diagnosis/signals/real_transform.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Phases = std::vector<Eigen::VectorXd>;  // one vector of n_u phases for each line

void check(const MultisineOptions& options) {
  if (options.lines.empty()) throw InputError("multisine: no excited lines");
  if (options.inputs < 1) throw InputError("multisine: needs at least one input");
  if (!(options.rms > 0.0) || !std::isfinite(options.rms)) {
    throw InputError(fmt::format("multisine: rms {} must be positive", options.rms));
  }
  for (std::size_t k = 0; k < options.lines.size(); ++k) {
    if (options.lines[k] == 0 || 2 * options.lines[k] >= options.period) {
      throw InputError(
          fmt::format("multisine: line {} must lie between 1 and {}, below half the "
                      "period of {} samples",
                      options.lines[k], (options.period - 1) / 2, options.period));
    }
    if (k > 0 && options.lines[k] <= options.lines[k - 1]) {
      throw InputError("multisine: lines must increase");
    }
  }
  const auto& amplitude = options.relative_amplitude;
  if (!amplitude.empty() && amplitude.size() != options.lines.size()) {
    throw InputError(fmt::format("multisine: {} relative amplitudes for {} lines", amplitude.size(),
                                 options.lines.size()));
  }
  if (std::ranges::any_of(amplitude, [](double a) { return !(a > 0.0) || !std::isfinite(a); })) {
    throw InputError("multisine: relative amplitudes must be positive");
  }
}

// A(k), scaled so that each input's mean square 2/(n_u N) sum_k A(k)^2 is rms^2.
std::vector<double> scaled_amplitudes(const MultisineOptions& options) {
  std::vector<double> amplitudes = options.relative_amplitude;
  if (amplitudes.empty()) amplitudes.assign(options.lines.size(), 1.0);
  double power = 0.0;
  for (const double a : amplitudes) power += a * a;
  power *= 2.0 / (static_cast<double>(options.inputs) * static_cast<double>(options.period));
  for (double& a : amplitudes) a *= options.rms / std::sqrt(power);
  return amplitudes;
}

// The real signal with given coefficients at the lines, by FFTW's inverse real transform.
class InverseTransform {
 public:
  explicit InverseTransform(std::size_t period)
      : period_(period),
        spectrum_(fftw_alloc_complex(period / 2 + 1), fftw_free),
        signal_(fftw_alloc_real(period), fftw_free) {
    const std::scoped_lock lock(fourier_planning());
    plan_ = fftw_plan_dft_c2r_1d(static_cast<int>(period), spectrum_.get(), signal_.get(),
                                 FFTW_ESTIMATE);
  }
  ~InverseTransform() {
    const std::scoped_lock lock(fourier_planning());
    fftw_destroy_plan(plan_);
  }
  InverseTransform(const InverseTransform&) = delete;
  InverseTransform& operator=(const InverseTransform&) = delete;

  Eigen::RowVectorXd run(const std::vector<std::size_t>& lines,
                         const std::vector<std::complex<double>>& coefficients) {
    std::fill_n(&spectrum_.get()[0][0], 2 * (period_ / 2 + 1), 0.0);
    const double scale = 1.0 / std::sqrt(static_cast<double>(period_));
    for (std::size_t k = 0; k < lines.size(); ++k) {
      spectrum_.get()[lines[k]][0] = scale * coefficients[k].real();
      spectrum_.get()[lines[k]][1] = scale * coefficients[k].imag();
    }
    fftw_execute(plan_);
    return Eigen::Map<const Eigen::RowVectorXd>(signal_.get(), static_cast<Eigen::Index>(period_));
  }

 private:
  std::size_t period_;
  std::unique_ptr<fftw_complex[], void (*)(void*)> spectrum_;
  std::unique_ptr<double[], void (*)(void*)> signal_;
  fftw_plan plan_ = nullptr;
};

std::vector<Eigen::MatrixXd> references_of(const MultisineOptions& options,
                                           const std::vector<double>& amplitudes,
                                           const Phases& phases, InverseTransform& transform) {
  const Eigen::Index inputs = options.inputs;
  std::vector<Eigen::MatrixXd> references;
  std::vector<std::complex<double>> coefficients(options.lines.size());
  for (Eigen::Index e = 0; e < inputs; ++e) {
    Eigen::MatrixXd reference(inputs, static_cast<Eigen::Index>(options.period));
    for (Eigen::Index a = 0; a < inputs; ++a) {
      const double turn =
          2.0 * std::numbers::pi * static_cast<double>(a * e) / static_cast<double>(inputs);
      for (std::size_t k = 0; k < coefficients.size(); ++k) {
        coefficients[k] =
            std::polar(amplitudes[k] / std::sqrt(static_cast<double>(inputs)), phases[k](a) + turn);
      }
      reference.row(a) = transform.run(options.lines, coefficients);
    }
    references.push_back(std::move(reference));
  }
  return references;
}

double largest(const std::vector<Eigen::MatrixXd>& references) {
  double peak = 0.0;
  for (const auto& reference : references) peak = std::max(peak, reference.cwiseAbs().maxCoeff());
  return peak;
}

}  // namespace

Multisine::Multisine(const MultisineOptions& options, std::uint64_t seed) : options_(options) {
  check(options);
  amplitudes_ = scaled_amplitudes(options);
  InverseTransform transform(options.period);
  Random random(seed);
  Phases phases(options.lines.size(), Eigen::VectorXd(options.inputs));
  for (std::size_t draw = 0; draw < std::max<std::size_t>(1, options.phase_draws); ++draw) {
    for (Eigen::VectorXd& line : phases) {
      for (double& phase : line) phase = random.uniform(0.0, 2.0 * std::numbers::pi);
    }
    auto references = references_of(options, amplitudes_, phases, transform);
    const double crest = largest(references) / options.rms;
    if (draw == 0 || crest < crest_factor_) {
      crest_factor_ = crest;
      references_ = std::move(references);
    }
    if (crest_factor_ <= options.crest_limit) return;
  }
  if (options.crest_limit > 0.0) {
    throw InputError(
        fmt::format("multisine: the least crest factor of {} draws of the phases is {:.3g}, above "
                    "the limit {:g}",
                    options.phase_draws, crest_factor_, options.crest_limit));
  }
}

std::vector<std::size_t> odd_lines(const std::vector<double>& frequencies, std::size_t period,
                                   double sample_time) {
  std::vector<std::size_t> lines;
  const double resolution = 1.0 / (static_cast<double>(period) * sample_time);
  for (const double frequency : frequencies) {
    if (!(frequency > 0.0)) throw InputError("multisine: frequencies must be positive");
    const auto half =
        static_cast<std::size_t>(std::max(0.0, 0.5 * (frequency / resolution - 1.0) + 0.5));
    const std::size_t line = 2 * half + 1;
    if (lines.empty() || line > lines.back()) lines.push_back(line);
  }
  return lines;
}

}  // namespace graybox
