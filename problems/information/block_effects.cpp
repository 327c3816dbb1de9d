#include "problems/information/block_effects.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Eigen::Index;

void require_effects(const Jacobians& jacobians, const BlockEffects& effects) {
  if (effects.blocks < 2) {
    throw InputError(fmt::format("blocks: {}; there must be two or more", effects.blocks));
  }
  const std::size_t rows = jacobians.candidates * jacobians.outputs;
  if (rows == 0 || jacobians.parameters == 0) {
    throw InputError(jacobians.source + ": there are no numbers");
  }
  if (effects.effects == 0 || effects.values.size() != rows * effects.effects) {
    throw InputError(fmt::format("{}: {} numbers; {} rows as in {} need {}", effects.source,
                                 effects.values.size(), rows, jacobians.source,
                                 rows * effects.effects));
  }
  if (jacobians.values.size() != rows * jacobians.parameters) {
    throw InputError(fmt::format("{}: {} numbers, but {} rows of {} need {}", jacobians.source,
                                 jacobians.values.size(), rows, jacobians.parameters,
                                 rows * jacobians.parameters));
  }
  for (const auto& [values, source] : {std::pair{&jacobians.values, &jacobians.source},
                                       std::pair{&effects.values, &effects.source}}) {
    if (std::ranges::all_of(*values, [](double x) { return std::isfinite(x); })) continue;
    throw InputError(*source + ": an entry is not finite; remove or repair it");
  }
}

std::string parameter_name(const Jacobians& jacobians, std::size_t j) {
  return jacobians.names.empty() ? std::to_string(j) : jacobians.names[j];
}

// The columns of J and K together must be independent. Scaled to unit length, so that units do not
// matter.
void require_independent(const Jacobians& jacobians, const BlockEffects& effects) {
  constexpr double kDependent = 1e-12, kTakesPart = 1e-3;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto rows = static_cast<Index>(jacobians.candidates * jacobians.outputs);
  const auto d = static_cast<Index>(jacobians.parameters), q = static_cast<Index>(effects.effects);
  Eigen::MatrixXd columns(rows, d + q);
  columns.leftCols(d) = Eigen::Map<const RowMajor>(jacobians.values.data(), rows, d);
  columns.rightCols(q) = Eigen::Map<const RowMajor>(effects.values.data(), rows, q);
  for (Index j = 0; j < d + q; ++j) {
    const double size = columns.col(j).norm();
    if (size > 0.0) columns.col(j) /= size;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum(columns.transpose() * columns);
  for (Index k = 0; k < d + q && spectrum.eigenvalues()(k) < kDependent; ++k) {
    const Eigen::VectorXd part = spectrum.eigenvectors().col(k);
    if (part.tail(q).norm() < kTakesPart) continue;  // of the model alone, which may have a prior
    if (part.head(d).norm() < kTakesPart) {
      throw InputError(fmt::format("{}: its columns depend on each other; leave some of them out",
                                   effects.source));
    }
    Index largest = 0;
    part.head(d).cwiseAbs().maxCoeff(&largest);
    throw InputError(fmt::format(
        "{}: column '{}' can't be told from the effects of the blocks; leave it out, for each "
        "block has its own",
        jacobians.source, parameter_name(jacobians, static_cast<std::size_t>(largest))));
  }
}

std::vector<std::string> names_with_blocks(const Jacobians& jacobians,
                                           const BlockEffects& effects) {
  std::vector<std::string> names;
  for (std::size_t j = 0; j < jacobians.parameters; ++j) {
    names.push_back(parameter_name(jacobians, j));
  }
  for (std::size_t b = 1; b <= effects.blocks; ++b) {
    for (std::size_t k = 0; k < effects.effects; ++k) {
      std::string effect = effects.effects == 1 ? "offset" : fmt::format("offset_{}", k + 1);
      if (!effects.names.empty()) effect = effects.names[k];
      names.push_back(fmt::format("block_{}.{}", b, effect));
      if (std::ranges::count(names, names.back()) == 1) continue;
      throw InputError(fmt::format("{}: there is a column '{}' already; rename it",
                                   jacobians.source, names.back()));
    }
  }
  return names;
}

CandidateTable table_with_blocks(const Jacobians& jacobians, std::size_t blocks) {
  const CandidateTable& before = jacobians.table;
  const std::size_t columns = before.names.size();
  CandidateTable table{before.names, before.units, {}};
  if (columns == 0) {
    table.names.emplace_back("experiment");
    table.units.emplace_back();
  }
  if (std::ranges::count(before.names, "block") > 0) {
    throw InputError(jacobians.source + ": there is a coordinate 'block' already; rename it");
  }
  table.names.emplace_back("block");
  table.units.emplace_back();
  for (std::size_t b = 0; b < blocks; ++b) {
    for (std::size_t i = 0; i < jacobians.candidates; ++i) {
      for (std::size_t c = 0; c < columns; ++c) {
        table.values.push_back(before.values[i * columns + c]);
      }
      if (columns == 0) table.values.push_back(static_cast<double>(i));
      table.values.push_back(static_cast<double>(b + 1));
    }
  }
  return table;
}

}  // namespace

BlockEffects offsets_of_outputs(const Jacobians& jacobians, std::size_t blocks) {
  const std::size_t r = jacobians.outputs;
  BlockEffects effects{.blocks = blocks, .effects = r};
  effects.values.assign(jacobians.candidates * r * r, 0.0);
  for (std::size_t row = 0; row < jacobians.candidates * r; ++row) {
    effects.values[row * r + row % r] = 1.0;
  }
  return effects;
}

BlockEffects common_offset(const Jacobians& jacobians, std::size_t blocks) {
  BlockEffects effects{.blocks = blocks, .effects = 1};
  effects.values.assign(jacobians.candidates * jacobians.outputs, 1.0);
  return effects;
}

Jacobians with_block_effects(Jacobians jacobians, const BlockEffects& effects) {
  require_effects(jacobians, effects);
  require_independent(jacobians, effects);
  const std::size_t d = jacobians.parameters, q = effects.effects;
  const std::size_t rows = jacobians.candidates * jacobians.outputs;
  const std::size_t all = d + effects.blocks * q;
  Jacobians out{.candidates = effects.blocks * jacobians.candidates,
                .outputs = jacobians.outputs,
                .parameters = all,
                .values = std::vector<double>(effects.blocks * rows * all, 0.0),
                .names = names_with_blocks(jacobians, effects),
                .table = table_with_blocks(jacobians, effects.blocks),
                .source = std::move(jacobians.source)};
  for (std::size_t b = 0; b < effects.blocks; ++b) {
    for (std::size_t row = 0; row < rows; ++row) {
      double* to = out.values.data() + (b * rows + row) * all;
      std::copy_n(jacobians.values.data() + row * d, d, to);
      std::copy_n(effects.values.data() + row * q, q, to + d + b * q);
    }
  }
  return out;
}

}  // namespace graybox
