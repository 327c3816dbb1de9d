#include "diagnosis/periodic/telling_recordings.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "diagnosis/harmonic_balance/real_products.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Recordings of one position and level in which the same inputs move.
using Kind = std::tuple<std::size_t, double, std::vector<bool>>;

// Of those records, by index.
std::map<Kind, std::vector<std::size_t>> kinds_of(const std::vector<MeasuredRecord>& records,
                                                  const std::vector<std::size_t>& asked) {
  constexpr double kMoves = 1e-2;  // of that input's largest power
  std::vector<VectorXd> powers;
  for (const MeasuredRecord& record : records) {
    powers.push_back(record.input.rowwise().squaredNorm());
  }
  VectorXd largest = powers.front();
  for (const VectorXd& power : powers) largest = largest.cwiseMax(power);
  std::map<Kind, std::vector<std::size_t>> kinds;
  for (const std::size_t i : asked) {
    std::vector<bool> moves;
    for (Index u = 0; u < largest.size(); ++u) moves.push_back(powers[i](u) > kMoves * largest(u));
    kinds[{records[i].position, records[i].level, moves}].push_back(i);
  }
  return kinds;
}

// On the model's own parameters, of each position; empty if the model has no rest there.
std::vector<MatrixXd> information_of_positions(const PlantFamily& family, const PeriodicData& data,
                                               const std::vector<std::size_t>& records,
                                               const VectorXd& parameters,
                                               const std::vector<ActingLaw>& laws, int threads) {
  std::vector<MatrixXd> of_records(records.size());
  try {
    const ModelState model = evaluate_model(family, data, parameters, laws, true, threads);
    const StopClock clock;
#pragma omp parallel num_threads(threads)
    {
      SteadyStateSolver solver(family, data, {});
      MatrixXcd jacobian;
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records.size(); ++i) {
        if (clock.stops()) continue;
        const MeasuredRecord& record = data.estimation[records[i]];
        solver.solve(model, record, nullptr);
        solver.differentiate(model, record, false, jacobian);
        record.decorrelate(jacobian);
        const MatrixXd all = as_real(jacobian).transpose() * as_real(jacobian);
        of_records[i] = all.topLeftCorner(parameters.size(), parameters.size());
      }
    }
    stop_if_requested();
  } catch (const InputError&) {
    return {};
  }
  const MatrixXd zero = MatrixXd::Zero(parameters.size(), parameters.size());
  std::vector<MatrixXd> sums(data.positions.size(), zero);
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (of_records[i].allFinite()) sums[data.estimation[records[i]].position] += of_records[i];
  }
  return sums;
}

void scale_to_unit_diagonal(std::vector<MatrixXd>& matrices) {
  VectorXd diagonal = VectorXd::Zero(matrices.front().rows());
  for (const MatrixXd& matrix : matrices) diagonal += matrix.diagonal();
  const VectorXd unit =
      diagonal.unaryExpr([](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  for (MatrixXd& matrix : matrices) matrix = unit.asDiagonal() * matrix * unit.asDiagonal();
}

double log_determinant(const MatrixXd& matrix) {
  return 2.0 * matrix.llt().matrixLLT().diagonal().array().log().sum();
}

std::set<std::size_t> greedy_positions(std::vector<MatrixXd> information) {
  constexpr double kRidge = 1e-8;
  scale_to_unit_diagonal(information);
  const Index size = information.front().rows();
  MatrixXd sum = kRidge * MatrixXd::Identity(size, size);
  std::set<std::size_t> chosen;
  while (chosen.size() < std::min(kTellingPositions, information.size())) {
    std::size_t best = 0;
    double largest = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < information.size(); ++i) {
      if (chosen.contains(i)) continue;
      const double value = log_determinant(sum + information[i]);
      if (value > largest) {
        largest = value;
        best = i;
      }
    }
    sum += information[best];
    chosen.insert(best);
  }
  return chosen;
}

}  // namespace

std::vector<std::size_t> telling_recordings(const PlantFamily& family, const PeriodicData& data,
                                            const VectorXd& parameters,
                                            const std::vector<ActingLaw>& laws, int threads) {
  std::vector<std::size_t> all(data.estimation.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::map<Kind, std::vector<std::size_t>> kinds = kinds_of(data.estimation, all);
  std::vector<std::size_t> first;
  for (const auto& [kind, records] : kinds) first.push_back(records.front());
  std::ranges::sort(first);
  std::set<std::size_t> positions;
  for (const auto& [kind, records] : kinds) positions.insert(std::get<0>(kind));
  if (positions.size() <= kTellingPositions || parameters.size() == 0) return first;
  const std::vector<MatrixXd> information =
      information_of_positions(family, data, first, parameters, laws, threads);
  if (information.empty()) return first;
  const std::set<std::size_t> chosen = greedy_positions(information);
  std::erase_if(kinds, [&](const auto& kind) { return !chosen.contains(std::get<0>(kind.first)); });
  std::vector<std::size_t> telling;
  for (std::size_t round = 0; telling.size() < kTellingRecordings; ++round) {
    const std::size_t before = telling.size();
    for (const auto& [kind, records] : kinds) {
      if (round < records.size()) telling.push_back(records[round]);
    }
    if (telling.size() == before) break;
  }
  std::ranges::sort(telling);
  return telling;
}

std::vector<std::size_t> first_of_each_kind(const PeriodicData& data,
                                            const std::vector<std::size_t>& records) {
  std::vector<std::size_t> first;
  for (const auto& [kind, of_kind] : kinds_of(data.estimation, records)) {
    first.push_back(of_kind.front());
  }
  std::ranges::sort(first);
  return first;
}

PeriodicData with_records(const PeriodicData& data, const std::vector<std::size_t>& records) {
  PeriodicData few = data;
  few.estimation.clear();
  few.validation.clear();
  for (const std::size_t record : records) few.estimation.push_back(data.estimation[record]);
  return few;
}

}  // namespace graybox
