#include "diagnosis/force_balance_data/force_balance_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "diagnosis/hypotheses/law_trend.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"

namespace graybox {
namespace {

// `samples` along b_out.
BalanceColumns along(const Eigen::VectorXd& output, const Eigen::MatrixXd& samples) {
  BalanceColumns columns{std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(output.size())),
                         samples.cols()};
  for (Eigen::Index j = 0; j < output.size(); ++j) {
    if (output(j) != 0.0) columns.in[static_cast<std::size_t>(j)] = output(j) * samples;
  }
  return columns;
}

// Zero in recordings without the load that the place needs.
void clear_other_loads(const std::string& load, const ForceBalanceRows& rows,
                       BalanceColumns& columns) {
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    if (piece.load != load) {
      for (Eigen::MatrixXd& block : columns.in) {
        if (block.size() > 0) block.middleRows(row, piece.samples()).setZero();
      }
    }
    row += piece.samples();
  }
}

BalanceColumns payload_columns(const PlacedLaw& law, std::span<const double> parameters,
                               const ForceBalanceData& data, const ForceBalanceRows& rows) {
  const Eigen::Vector3d offset(parameters[1], parameters[2], parameters[3]);
  const StandardParameters body =
      standard_parameters({parameters[0], data.flange * offset, Eigen::Matrix3d::Zero()});
  BalanceColumns columns{{}, 1};
  for (std::size_t j = 0; j < rows.flange_body.in.size(); ++j) {
    const bool has_gains = law.inverse_gains.size() > 0;
    const double gain = has_gains ? law.inverse_gains(static_cast<Eigen::Index>(j)) : 1.0;
    columns.in.emplace_back(rows.flange_body.in[j] * (gain * body));
  }
  return columns;
}

BalanceColumns force_of_any_load(const PlacedLaw& law, std::span<const double> parameters,
                                 const ForceBalanceData& data, const ForceBalanceRows& rows) {
  if (law.entry->use == LawUse::kPayload) return payload_columns(law, parameters, data, rows);
  const auto samples = rows.laws->get(
      {law.place, law.entry, {parameters.begin(), parameters.end()}}, [&]() -> Eigen::VectorXd {
        if (law.entry->use == LawUse::kInertia) {
          return parameters[0] * inertia_samples(*law.place, rows);
        }
        return law_samples(*law.place, *law.entry->make(parameters), rows);
      });
  BalanceColumns columns = along(law.place->location.output, *samples);
  rows.leave_out_standing(columns);
  return columns;
}

BalanceColumns one_column(const PlacedLaw& law, std::span<const double> parameters,
                          const ForceBalanceData& data, const ForceBalanceRows& rows) {
  BalanceColumns columns = force_of_any_load(law, parameters, data, rows);
  const std::string& load = law.place->location.load;
  if (!load.empty()) clear_other_loads(load, rows, columns);
  return columns;
}

void append(BalanceColumns&& more, BalanceColumns& columns) {
  if (columns.count == 0) {
    columns = std::move(more);
    return;
  }
  for (std::size_t j = 0; j < columns.in.size(); ++j) {
    if (more.in[j].size() == 0) continue;
    columns.in[j].conservativeResize(Eigen::NoChange, columns.count + more.count);
    columns.in[j].rightCols(more.count) = more.in[j];
  }
  columns.count += more.count;
}

}  // namespace

std::vector<std::size_t> PlacedLaw::linear() const {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    if (entry->parameters[i].is_linear) result.push_back(i);
  }
  return result;
}

std::vector<std::size_t> PlacedLaw::scaled() const {
  std::vector<std::size_t> result;
  if (!linear().empty()) return result;
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    if (entry->parameters[i].unit.starts_with('F')) result.push_back(i);
  }
  return result;
}

std::vector<std::size_t> PlacedLaw::refined() const {
  std::vector<std::size_t> result;
  if (entry->use == LawUse::kInertia) return result;
  const std::vector<std::size_t> scale = scaled();
  for (std::size_t i = 0; i < entry->parameters.size(); ++i) {
    const LawParameter& parameter = entry->parameters[i];
    const bool is_scale = parameter.sets_scale || (!scale.empty() && scale.front() == i);
    if (!parameter.is_linear && !is_scale) result.push_back(i);
  }
  return result;
}

Eigen::Index PlacedLaw::amplitudes() const {
  const std::vector<std::size_t> own = linear();
  return own.empty() ? 1 : static_cast<Eigen::Index>(own.size());
}

void PlacedLaw::set_amplitudes(const Eigen::Ref<const Eigen::VectorXd>& values) {
  const std::vector<std::size_t> own = linear();
  for (std::size_t k = 0; k < own.size(); ++k) {
    parameters[own[k]] = values(static_cast<Eigen::Index>(k));
  }
  for (const std::size_t index : scaled()) parameters[index] *= values(0);
}

BalanceColumns law_columns(const PlacedLaw& law, const ForceBalanceData& data,
                           const ForceBalanceRows& rows) {
  const std::vector<std::size_t> linear = law.linear();
  if (linear.empty()) return law_force_column(law, data, rows);
  std::vector<std::vector<double>> basis;
  for (const std::size_t index : linear) {
    std::vector<double>& unit = basis.emplace_back(law.parameters);
    for (const std::size_t other : linear) unit[other] = 0.0;
    unit[index] = 1.0;
  }
  return basis_columns(law, basis, data, rows);
}

BalanceColumns law_force_column(const PlacedLaw& law, const ForceBalanceData& data,
                                const ForceBalanceRows& rows) {
  return one_column(law, law.parameters, data, rows);
}

BalanceColumns law_slopes(const PlacedLaw& law, std::span<const std::size_t> parameters,
                          const ForceBalanceData& data, const ForceBalanceRows& rows) {
  constexpr double kStep = 1e-4;
  BalanceColumns slopes;
  for (const std::size_t index : parameters) {
    std::vector<double> moved = law.parameters;
    const double value = moved[index];
    const bool has_own_scale = law.entry->parameters[index].unit == "rad" ||
                               law.entry->use == LawUse::kPayload;  // a place, m
    const double step = kStep * (has_own_scale ? 1.0 : std::max(std::abs(value), 1e-9));
    moved[index] = value + step;
    BalanceColumns slope = one_column(law, moved, data, rows);
    moved[index] = value - step;
    const BalanceColumns below = one_column(law, moved, data, rows);
    for (std::size_t j = 0; j < slope.in.size(); ++j) {
      slope.in[j] = (slope.in[j] - below.in[j]).eval() / (2.0 * step);
    }
    append(std::move(slope), slopes);
  }
  return slopes;
}

BalanceColumns basis_columns(const PlacedLaw& law, std::span<const std::vector<double>> basis,
                             const ForceBalanceData& data, const ForceBalanceRows& rows) {
  BalanceColumns columns;
  for (const std::vector<double>& parameters : basis) {
    append(one_column(law, parameters, data, rows), columns);
  }
  return columns;
}

namespace {

// Whether all joints stand that a place moves with.
bool stands(const CandidatePlace& place, const Motion& piece, Eigen::Index sample) {
  if (piece.stands.size() == 0) return false;
  for (Eigen::Index j = 0; j < place.location.input.size(); ++j) {
    if (place.location.input(j) != 0.0 && !piece.stands(sample, j)) return false;
  }
  return true;
}

// What neighbouring joints may share that no transmission couples: a bearing, a cable, a rod. Any
// law may act at a place that a place file states.
bool may_be_shared(const LawEntry& entry) {
  constexpr std::array<std::string_view, 5> kShared{"viscous", "coulomb", "stiffness", "offset",
                                                    "inertia"};
  return std::ranges::find(kShared, entry.name) != kShared.end();
}

// What a load adds at a joint: its weight, along a line a constant force, and its inertia.
bool may_be_a_load(const LawEntry& entry, const CandidatePlace& place) {
  return entry.name == "inertia" || entry.name == (place.turns ? "gravity" : "offset");
}

bool needs_position(const LawEntry& entry) {
  if (entry.use != LawUse::kForce) return false;
  std::vector<double> parameters(entry.parameters.size());
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    parameters[i] = 0.6 + 0.05 * static_cast<double>(i);
  }
  return depends_on_position(*entry.make(parameters));
}

}  // namespace

std::vector<const LawEntry*> force_balance_laws(const CandidatePlace& place,
                                                bool position_is_recorded) {
  std::vector<const LawEntry*> laws;
  for (const LawEntry& entry : law_catalogue()) {
    if (place.location.is_flange) {
      if (entry.use == LawUse::kPayload) laws.push_back(&entry);
      continue;
    }
    if (entry.use != LawUse::kForce && entry.use != LawUse::kInertia) continue;
    // A hidden mass on a spring needs its own motion, which a force balance does not follow.
    if (entry.name == "mode") continue;
    if (place.is_compound && !may_be_shared(entry)) continue;
    if (!place.location.load.empty() && !may_be_a_load(entry, place)) continue;
    if (entry.name == "balancer" && !place.turns) continue;
    if (entry.name == "gravity" && !place.may_lift) continue;
    if (!position_is_recorded && needs_position(entry)) continue;
    laws.push_back(&entry);
  }
  return laws;
}

MotionScale motion_scale(const CandidatePlace& place, const ForceBalanceRows& rows) {
  MotionScale scale;
  if (place.location.is_flange) return scale;
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  double lesser = 0.0, squares = 0.0;  // of velocities; the way that each piece has less of
  for (const Motion& piece : rows.pieces) {
    if (!place.location.load.empty() && piece.load != place.location.load) continue;
    const RecordedPlaceMotion motion = motion_at(place, piece);
    const double mean = motion.deflection.mean();
    double forwards = 0.0, backwards = 0.0;
    for (Eigen::Index t = 0; t < motion.deflection.size(); ++t) {
      if (stands(place, piece, t)) continue;
      scale.deflections.push_back(std::abs(motion.deflection(t)));
      scale.excursions.push_back(std::abs(motion.deflection(t) - mean));
      scale.rates.push_back(std::abs(motion.rate(t)));
      (motion.rate(t) > 0.0 ? forwards : backwards) += motion.rate(t) * motion.rate(t);
      lowest = std::min(lowest, motion.deflection(t));
      highest = std::max(highest, motion.deflection(t));
    }
    lesser += std::min(forwards, backwards);
    squares += forwards + backwards;
  }
  std::sort(scale.deflections.begin(), scale.deflections.end());
  std::sort(scale.excursions.begin(), scale.excursions.end());
  std::sort(scale.rates.begin(), scale.rates.end());
  scale.range = highest - lowest;
  scale.goes_one_way = lesser < kOneWay * squares;
  const Motion& piece = rows.pieces.front();
  if (place.location.units.deflection == "m") {
    constexpr double kSamplesAWave = 2.0;
    scale.finest_wave = kSamplesAWave * scale.rate(0.9) * piece.sample_time();
  }
  constexpr double kSamplesShown = 4.0;
  scale.shown_wave = kSamplesShown * scale.rate(0.5) * piece.sample_time();
  for (const FilterPass& filter : piece.filters) {
    scale.shown_wave = std::max(scale.shown_wave, scale.rate(0.5) / filter.frequency);
  }
  return scale;
}

}  // namespace graybox
