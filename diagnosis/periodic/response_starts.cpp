#include "diagnosis/periodic/response_starts.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kStarts = 12;
constexpr double kSpread = 0.15;  // of the logarithm of a further start's parameters
constexpr int kIterations = 40;
constexpr double kGoodFit = 0.02;  // rms difference of phi, of which 1 is the most
constexpr std::size_t kMinima = 6;
constexpr double kMuchWorse = 1.4;  // times the least rms difference
constexpr double kSame = 0.05;      // of each parameter

// The responses of one position at one line, for all levels.
struct Measured {
  std::size_t position = 0;
  double frequency = 0.0;  // rad/s
  MatrixXcd images;        // of the model's values
  std::vector<MatrixXcd> responses;
  std::vector<MatrixXd> levels;  // m
};

struct Evaluation {
  VectorXd parameters;
  double cost = std::numeric_limits<double>::infinity();  // mean square
  MatrixXd information;
  VectorXd gradient;
};

// m of each element of one estimate at each of its lines.
std::vector<MatrixXd> levels_of(const FrequencyResponseEstimate& estimate,
                                const std::vector<double>& frequencies) {
  const std::size_t count = estimate.lines.size();
  const Index rows = estimate.responses.front().rows(), columns = estimate.responses.front().cols();
  std::vector<MatrixXd> levels(count, MatrixXd::Ones(rows, columns));
  MatrixXd powers(static_cast<Index>(count), 2);
  for (std::size_t k = 0; k < count; ++k) {
    powers.row(static_cast<Index>(k)) << 1.0, std::log(frequencies[estimate.lines[k]]);
  }
  const Eigen::LDLT<MatrixXd> normal(powers.transpose() * powers);
  VectorXd logarithms(static_cast<Index>(count));
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      for (std::size_t k = 0; k < count; ++k) {
        logarithms(static_cast<Index>(k)) =
            std::log(std::abs(estimate.responses[k](i, j)) + 1e-300);
      }
      VectorXd line = powers * normal.solve(powers.transpose() * logarithms);
      if (!line.allFinite()) line.setConstant(logarithms.mean());
      for (std::size_t k = 0; k < count; ++k)
        levels[k](i, j) = std::exp(line(static_cast<Index>(k)));
    }
  }
  return levels;
}

class ResponseFitter {
 public:
  ResponseFitter(const PlantFamily& family, const PeriodicData& data)
      : family_(family), data_(data) {}

  std::vector<VectorXd> run(int threads) {
    start_ = family_.start_values();
    if (data_.responses.empty() || start_.size() == 0) return {};
    collect();
    std::vector<Evaluation> minima{minimise(start_)};
    if (!(minima.front().cost < kGoodFit * kGoodFit)) {
      minima.resize(1 + kStarts);
#pragma omp parallel for num_threads(threads) schedule(dynamic)
      for (int k = 0; k < kStarts; ++k)
        minima[static_cast<std::size_t>(k) + 1] = minimise(drawn(k));
    }
    stop_if_requested();
    std::ranges::stable_sort(minima, {}, &Evaluation::cost);
    return distinct(minima);
  }

 private:
  // Of those that come close to the first.
  [[nodiscard]] std::vector<VectorXd> distinct(const std::vector<Evaluation>& minima) const {
    std::vector<VectorXd> kept;
    for (const Evaluation& minimum : minima) {
      const bool is_close = minimum.cost <= kMuchWorse * kMuchWorse * minima.front().cost;
      if (!std::isfinite(minimum.cost) || !is_close || kept.size() == kMinima) break;
      const auto is_same = [&](const VectorXd& other) {
        return (minimum.parameters - other).cwiseQuotient(other).cwiseAbs().maxCoeff() < kSame;
      };
      if (std::ranges::none_of(kept, is_same)) kept.push_back(minimum.parameters);
    }
    return kept;
  }

  void collect() {
    for (std::size_t position = 0; position < data_.positions.size(); ++position) {
      std::vector<const FrequencyResponseEstimate*> here;
      for (const FrequencyResponseEstimate& estimate : data_.responses) {
        if (data_.position_of(estimate.position) == position) here.push_back(&estimate);
      }
      if (here.empty()) continue;
      const LinearPlant plant = family_.plant(data_.positions[position], start_, {});
      const HeldImages images(plant, data_.sample_time);
      std::vector<std::vector<MatrixXd>> levels;
      for (const auto* estimate : here) levels.push_back(levels_of(*estimate, data_.frequencies));
      for (std::size_t k = 0; k < here.front()->lines.size(); ++k) {
        Measured& point = measured_.emplace_back();
        point.position = position;
        point.frequency = data_.frequencies[here.front()->lines[k]];
        point.images = images.response(point.frequency);
        for (std::size_t e = 0; e < here.size(); ++e) {
          if (k >= here[e]->lines.size() || here[e]->lines[k] != here.front()->lines[k]) continue;
          point.responses.push_back(here[e]->responses[k]);
          point.levels.push_back(levels[e][k]);
        }
      }
    }
  }

  [[nodiscard]] bool is_logarithmic(Index p) const {
    return family_.parameters()[static_cast<std::size_t>(p)].positive;
  }

  [[nodiscard]] VectorXd moved(const VectorXd& values, const VectorXd& step) const {
    VectorXd result = values;
    for (Index p = 0; p < values.size(); ++p) {
      if (is_logarithmic(p)) {
        result(p) *= std::exp(std::clamp(step(p), -0.3, 0.3));
      } else {
        result(p) += step(p);
      }
    }
    return result;
  }

  [[nodiscard]] VectorXd drawn(int start) const {
    Random random(static_cast<std::uint64_t>(start) + 1);
    VectorXd values = start_;
    for (Index p = 0; p < values.size(); ++p) {
      const double deviation = kSpread * random.normal();
      values(p) *= is_logarithmic(p) ? std::exp(deviation) : 1.0 + deviation;
    }
    return values;
  }

  [[nodiscard]] Evaluation minimise(const VectorXd& from) const {
    Evaluation now = evaluate(from);
    double damping = 1e-3;
    for (int iteration = 0; iteration < kIterations && std::isfinite(now.cost); ++iteration) {
      VectorXd scale = now.information.diagonal();
      scale =
          scale.unaryExpr([](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
      MatrixXd matrix = scale.asDiagonal() * now.information * scale.asDiagonal();
      matrix.diagonal().array() += damping + 1e-12;
      const VectorXd step =
          -scale.cwiseProduct(matrix.ldlt().solve(scale.cwiseProduct(now.gradient)));
      if (!step.allFinite()) break;
      Evaluation next = evaluate(moved(now.parameters, step));
      if (next.cost < now.cost) {
        const bool is_done = now.cost - next.cost < 1e-5 * now.cost;
        now = std::move(next);
        damping = std::max(0.2 * damping, 1e-9);
        if (is_done) break;
      } else {
        damping *= 6.0;
        if (damping > 1e4) break;
      }
    }
    return now;
  }

  [[nodiscard]] Evaluation evaluate(const VectorXd& parameters) const {
    Evaluation result;
    result.parameters = parameters;
    const Index size = parameters.size();
    MatrixXd information = MatrixXd::Zero(size, size);
    VectorXd gradient = VectorXd::Zero(size);
    double cost = 0.0, count = 0.0;
    std::size_t position = data_.positions.size();
    LinearPlant plant;
    std::vector<PlantChange> changes;
    std::vector<MatrixXcd> derivatives(static_cast<std::size_t>(size));
    for (const Measured& point : measured_) {
      if (point.position != position) {
        position = point.position;
        try {
          plant = family_.plant(data_.positions[position], parameters, {});
        } catch (const InputError&) {
          return result;  // no rest there
        }
        changes.clear();
        for (const PlantDerivative& change : plant.derivatives)
          changes.push_back(entries_of(change));
      }
      const MatrixXcd response = evaluate_response(plant, changes, point, derivatives);
      for (std::size_t e = 0; e < point.responses.size(); ++e) {
        for (Index i = 0; i < response.rows(); ++i) {
          for (Index j = 0; j < response.cols(); ++j) {
            add(point.levels[e](i, j), point.responses[e](i, j), i, j, response, derivatives,
                parameters, cost, information, gradient);
            count += 1.0;
          }
        }
      }
    }
    if (!std::isfinite(cost)) return result;
    result.cost = cost / count;
    result.information = information.selfadjointView<Eigen::Lower>();
    result.gradient = gradient;
    return result;
  }

  // G with its images, and its derivatives.
  [[nodiscard]] MatrixXcd evaluate_response(const LinearPlant& plant,
                                            const std::vector<PlantChange>& changes,
                                            const Measured& point,
                                            std::vector<MatrixXcd>& derivatives) const {
    const double w = point.frequency;
    const MatrixXcd inverse = receptance(plant, w);
    const MatrixXcd driven =
        inverse * (hold_factor(w, data_.sample_time) * plant.input.cast<Complex>());
    MatrixXcd seen = Complex(0.0, w) * plant.velocity_output.cast<Complex>();
    seen += plant.position_output;
    const MatrixXcd response = seen * driven + point.images;
    seen = (seen * inverse).eval();
    for (std::size_t p = 0; p < changes.size(); ++p) {
      derivatives[p].setZero(response.rows(), response.cols());
      for (const PlantChange::Entry& entry : changes[p].entries) {
        const Complex change(entry.stiffness - w * w * entry.mass, w * entry.damping);
        derivatives[p] -= change * seen.col(entry.row) * driven.row(entry.column);
      }
    }
    return response;
  }

  // phi and its derivatives of one element.
  void add(double level, Complex measured, Index i, Index j, const MatrixXcd& response,
           const std::vector<MatrixXcd>& derivatives, const VectorXd& parameters, double& cost,
           MatrixXd& information, VectorXd& gradient) const {
    const auto size = [level](Complex g) { return std::sqrt(level * level + std::norm(g)); };
    const Complex g = response(i, j);
    const double s = size(g);
    const Complex error = g / s - measured / size(measured);
    cost += std::norm(error);
    const Index count = parameters.size();
    Eigen::VectorXcd slopes(count);
    for (Index p = 0; p < count; ++p) {
      Complex change = derivatives[static_cast<std::size_t>(p)](i, j);
      if (is_logarithmic(p)) change *= parameters(p);
      slopes(p) = change / s - g * ((std::conj(g) * change).real() / (s * s * s));
    }
    gradient += (slopes.conjugate() * error).real();
    information.selfadjointView<Eigen::Lower>().rankUpdate(slopes.real());
    information.selfadjointView<Eigen::Lower>().rankUpdate(slopes.imag());
  }

  const PlantFamily& family_;
  const PeriodicData& data_;
  VectorXd start_;
  std::vector<Measured> measured_;
};

}  // namespace

std::vector<VectorXd> response_starts(const PlantFamily& family, const PeriodicData& data,
                                      int threads) {
  return ResponseFitter(family, data).run(threads);
}

}  // namespace graybox
