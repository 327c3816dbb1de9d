#include "graybox/diagnosis/periodic_mismatch/mismatch_map.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "graybox/diagnosis/periodic_mismatch/record_loop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

}  // namespace

std::vector<MismatchCell> mismatch_map(const PlantFamily& family, const PeriodicData& data,
                                       const ModelState& model, int threads) {
  constexpr int kBands = 5;
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
    return std::min(kBands - 1, static_cast<int>(share * kBands));
  };
  std::map<std::tuple<std::size_t, double, Index, int>, MismatchCell> cells;
  for (std::size_t i = 0; i < power.size(); ++i) {
    const MeasuredRecord& record = data.estimation[i];
    for (Index c = 0; c < power[i].rows(); ++c) {
      for (Index k = data.first_line; k <= data.last_line; ++k) {
        MismatchCell& cell = cells[{record.position, record.level, c, band_of(k)}];
        const double frequency = data.frequencies[at(k)] / (2.0 * std::numbers::pi);
        if (cell.degrees_of_freedom == 0.0) {
          cell.channel = data.outputs[at(c)];
          cell.position = data.position_names[record.position];
          cell.level = record.level;
          cell.from = frequency;
        }
        cell.to = std::max(cell.to, frequency);
        cell.statistic += power[i](c, k);
        cell.degrees_of_freedom += 2.0;
      }
    }
  }
  std::vector<MismatchCell> result;
  for (auto& [key, cell] : cells) result.push_back(std::move(cell));
  return result;
}

}  // namespace graybox
