#include "diagnosis/periodic_pictures/mismatch_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/harmonic_balance/record_loop.hpp"
#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

struct CountedCell {
  MismatchCell cell;
  std::map<std::size_t, double> numbers;  // by group of noise
  Index lines = 0;
};

// The noise of the groups is estimated, each for itself; stated noise is exact.
MismatchCell judged(const PeriodicData& data, CountedCell counted) {
  MismatchCell& cell = counted.cell;
  cell.effective = cell.degrees_of_freedom;
  double variance = 0.0;  // half of it
  for (const auto& [group, numbers] : counted.numbers) {
    if (group >= data.noise_pools.size() || !(data.noise_pools[group].own > 0.0)) return cell;
    const double share =
        static_cast<double>(counted.lines) / static_cast<double>(data.line_count());
    variance += half_variance(data.noise_pools[group], static_cast<Index>(data.outputs.size()),
                              numbers, 1.0, share);
  }
  cell.effective = cell.degrees_of_freedom * cell.degrees_of_freedom / variance;
  return cell;
}

}  // namespace

std::vector<MismatchCell> mismatch_map(const PlantFamily& family, const PeriodicData& data,
                                       const ModelState& model, int threads) {
  constexpr std::size_t kBands = 5;
  std::vector<MatrixXd> power(data.estimation.size());
  for_each_record(
      family, data, data.estimation, threads,
      [&](SteadyStateSolver& solver, const MeasuredRecord& record, std::size_t i, std::size_t) {
        const SteadyState& state = solver.solve(model, record, nullptr);
        VectorXcd residual = state.residual.reshaped();
        record.decorrelate(residual);
        power[i] = residual.reshaped(state.residual.rows(), state.residual.cols()).cwiseAbs2();
      });
  const double from = std::log(static_cast<double>(data.first_line));
  const double to = std::log(static_cast<double>(data.last_line) + 1.0);
  const auto band_of = [&](Index k) {
    const double share = (std::log(static_cast<double>(k)) - from) / (to - from);
    return std::min(kBands - 1, static_cast<std::size_t>(share * kBands));
  };
  std::array<Index, kBands> lines{};
  for (Index k = data.first_line; k <= data.last_line; ++k) ++lines[band_of(k)];
  std::map<std::tuple<std::size_t, double, Index, std::size_t>, CountedCell> cells;
  for (std::size_t i = 0; i < power.size(); ++i) {
    const MeasuredRecord& record = data.estimation[i];
    for (Index c = 0; c < power[i].rows(); ++c) {
      for (Index k = data.first_line; k <= data.last_line; ++k) {
        CountedCell& counted = cells[{record.position, record.level, c, band_of(k)}];
        MismatchCell& cell = counted.cell;
        const double frequency = data.frequencies[at(k)] / (2.0 * std::numbers::pi);
        if (cell.degrees_of_freedom == 0.0) {
          cell.channel = data.outputs[at(c)];
          cell.position = data.position_names[record.position];
          cell.level = record.level;
          cell.from = frequency;
          counted.lines = lines[band_of(k)];
        }
        cell.to = std::max(cell.to, frequency);
        cell.statistic += power[i](c, k);
        cell.degrees_of_freedom += 2.0;
        counted.numbers[record.group] += 2.0;
      }
    }
  }
  std::vector<MismatchCell> result;
  for (auto& [key, counted] : cells) result.push_back(judged(data, std::move(counted)));
  return result;
}

}  // namespace graybox
