#include "diagnosis/output_error/lumped_system.hpp"

#include <algorithm>
#include <array>

namespace graybox {

namespace {

bool is_linear_force(const Element& element) {
  return element.location.kind == LocationKind::kElement &&
         (element.law_name == "stiffness" || element.law_name == "viscous");
}

}  // namespace

LumpedSystem::LumpedSystem(const LumpedModel& model, std::span<const std::size_t> free,
                           Eigen::Index initial_columns)
    : parameter_columns_(static_cast<Eigen::Index>(free.size())),
      mass_(model.mass),
      damping_(model.damping),
      stiffness_(model.stiffness),
      inputs_(model.inputs),
      outputs_(model.outputs) {
  columns_ = 1 + parameter_columns_ + initial_columns;
  std::vector<Eigen::Index> columns(model.parameters.size(), 0);
  for (std::size_t i = 0; i < free.size(); ++i) {
    columns[free[i]] = static_cast<Eigen::Index>(i) + 1;
  }
  split_coordinates(model);
  place_laws(model, columns);
  add_linear(model, columns);
  build_linear_part();
  is_linear_ = forces_.empty() && law_states_ == 0;
  deflection_.setZero(columns_);
  rate_ = force_ = signal_ = deflection_;
  input_rows_.setZero(static_cast<Eigen::Index>(inputs_.size()), columns_);
  balance_.setZero(n_, columns_);
  acceleration_rows_ = balance_;
  imposed_force_.setZero(static_cast<Eigen::Index>(imposed_.size()), columns_);
  scratch_rates_.setZero(state_count(), columns_);
  output_rows_.setZero(output_count(), columns_);
}

bool LumpedSystem::has_free_delay() const {
  return std::ranges::any_of(delay_columns_, [](Eigen::Index column) { return column > 0; });
}

void LumpedSystem::split_coordinates(const LumpedModel& model) {
  const auto count = static_cast<Eigen::Index>(model.imposed.size());
  is_imposed_ = model.imposed;
  for (Eigen::Index i = 0; i < count; ++i) {
    auto& list = is_imposed_[static_cast<std::size_t>(i)] ? imposed_ : free_;
    slot_.push_back(static_cast<Eigen::Index>(list.size()));
    list.push_back(i);
  }
  n_ = static_cast<Eigen::Index>(free_.size());
  auto next = static_cast<Eigen::Index>(inputs_.size());
  for (const Eigen::Index mass : imposed_) {
    std::array<Eigen::Index, 3> channels{-1, -1, -1};
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      using enum LumpedInput::Kind;
      if (inputs_[j].kind == kForce || inputs_[j].kind == kSignal) continue;
      if (inputs_[j].mass != mass) continue;
      const std::size_t kind = inputs_[j].kind == kPosition   ? 0
                               : inputs_[j].kind == kVelocity ? 1
                                                              : 2;
      channels[kind] = static_cast<Eigen::Index>(j);
    }
    for (std::size_t kind = 1; kind < 3; ++kind) {
      if (channels[kind] >= 0) continue;
      derived_.push_back({channels[kind - 1]});
      channels[kind] = next++;
    }
    position_.push_back(channels[0]);
    velocity_.push_back(channels[1]);
    acceleration_.push_back(channels[2]);
  }
}

LumpedSystem::PlacedLaw LumpedSystem::placed(const Element& element,
                                             std::span<const Eigen::Index> columns) {
  PlacedLaw result;
  result.law = element.law;
  result.channel = element.location.channel;
  result.driver = element.location.driver;
  result.columns.assign(columns.begin(), columns.end());
  const auto pick = [](const Eigen::VectorXd& from, const std::vector<Eigen::Index>& which) {
    Eigen::VectorXd picked(static_cast<Eigen::Index>(which.size()));
    for (std::size_t i = 0; i < which.size(); ++i) {
      picked(static_cast<Eigen::Index>(i)) = from(which[i]);
    }
    return picked;
  };
  if (element.location.kind == LocationKind::kElement) {
    result.input_free = pick(element.location.input, free_);
    result.output_free = pick(element.location.output, free_);
    result.input_imposed = pick(element.location.input, imposed_);
    result.output_imposed = pick(element.location.output, imposed_);
  }
  result.states = static_cast<Eigen::Index>(element.law->state_count());
  return result;
}

void LumpedSystem::place_laws(const LumpedModel& model, std::span<const Eigen::Index> all) {
  delays_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(inputs_.size()));
  delay_columns_.assign(inputs_.size(), 0);
  output_delays_ = Eigen::VectorXd::Zero(output_count());
  output_delay_columns_.assign(outputs_.size(), 0);
  std::size_t next = all.size();
  for (const Element& part : model.parts) next -= part.parameters.size();
  std::vector<std::size_t> first_parameter;
  std::vector<Eigen::Index> first_state(model.parts.size(), 0);
  for (std::size_t k = 0; k < model.parts.size(); ++k) {
    const Element& part = model.parts[k];
    const auto columns = all.subspan(next, part.parameters.size());
    first_parameter.push_back(next);
    next += part.parameters.size();
    if (part.use == LawUse::kDelay) {
      const bool at_input = part.location.kind == LocationKind::kActuator;
      (at_input ? delays_ : output_delays_)(part.location.channel) += part.parameters[0];
      (at_input ? delay_columns_
                : output_delay_columns_)[static_cast<std::size_t>(part.location.channel)] =
          columns[0];
    }
    if (part.law == nullptr || is_linear_force(part)) continue;
    PlacedLaw law = placed(part, columns);
    law.first_state = first_state[k] = 2 * n_ + law_states_;
    law_states_ += law.states;
    auto& list = part.location.kind == LocationKind::kElement    ? forces_
                 : part.location.kind == LocationKind::kActuator ? actuators_
                                                                 : sensors_;
    list.push_back(std::move(law));
  }
  for (const LumpedOutput& output : outputs_) {
    if (output.quantity != LumpedOutput::Quantity::kElementForce) {
      measured_parts_.emplace_back();
      continue;
    }
    const Element& part = model.parts[output.part];
    measured_parts_.push_back(
        placed(part, all.subspan(first_parameter[output.part], part.parameters.size())));
    measured_parts_.back().first_state = first_state[output.part];
  }
}

void LumpedSystem::add_linear(const LumpedModel& model, std::span<const Eigen::Index> columns) {
  const Eigen::Index count = mass_.rows();
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(count, count);
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (model.masses(i) == 0.0) continue;
    const Eigen::Index column = columns[next++];
    if (column == 0) continue;
    linear_.push_back({column, zero, zero, zero});
    linear_.back().mass(i, i) = 1.0;
  }
  for (const Element& part : model.parts) {
    const Eigen::Index column = columns[next];
    next += part.parameters.size();
    const bool is_inertia = part.use == LawUse::kInertia;
    if (column == 0 || !(is_inertia || is_linear_force(part))) continue;
    const Location& place = part.location;
    linear_.push_back({column, zero, zero, zero});
    Eigen::MatrixXd& matrix = is_inertia                     ? linear_.back().mass
                              : part.law_name == "stiffness" ? linear_.back().stiffness
                                                             : linear_.back().damping;
    matrix = place.output * (is_inertia ? place.output : place.input).transpose();
  }
}

void LumpedSystem::build_linear_part() {
  const auto of_free = [&](const Eigen::MatrixXd& matrix) {
    Eigen::MatrixXd part(n_, n_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      for (Eigen::Index j = 0; j < n_; ++j) {
        part(i, j) = matrix(free_[static_cast<std::size_t>(i)], free_[static_cast<std::size_t>(j)]);
      }
    }
    return part;
  };
  free_mass_ = of_free(mass_);
  inverse_mass_ = free_mass_.llt().solve(Eigen::MatrixXd::Identity(n_, n_));
  a_ = Eigen::MatrixXd::Zero(2 * n_, 2 * n_);
  a_.topRightCorner(n_, n_).setIdentity();
  a_.bottomLeftCorner(n_, n_) = -inverse_mass_ * of_free(stiffness_);
  a_.bottomRightCorner(n_, n_) = -inverse_mass_ * of_free(damping_);
  for (const LinearParameter& parameter : linear_) {
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(2 * n_, 2 * n_);
    slope.bottomRows(n_) = -inverse_mass_ * of_free(parameter.mass) * a_.bottomRows(n_);
    slope.bottomLeftCorner(n_, n_) -= inverse_mass_ * of_free(parameter.stiffness);
    slope.bottomRightCorner(n_, n_) -= inverse_mass_ * of_free(parameter.damping);
    if (slope.isZero(0.0)) continue;
    a_slopes_.push_back(slope);
    a_columns_.push_back(parameter.column);
  }
}

// z and z' of a place, as rows.
void LumpedSystem::deflect(const PlacedLaw& law, const Rows& state, const double* inputs) {
  deflection_.setZero();
  rate_.setZero();
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double b = law.input_free(i);
    if (b == 0.0) continue;
    deflection_ += b * state.row(i);
    rate_ += b * state.row(n_ + i);
  }
  for (std::size_t k = 0; k < imposed_.size(); ++k) {
    const double b = law.input_imposed(static_cast<Eigen::Index>(k));
    deflection_(0) += b * inputs[position_[k]];
    rate_(0) += b * inputs[velocity_[k]];
  }
  if (law.driver >= 0) deflection_ = input_rows_.row(law.driver);
}

// The force of the law at deflection_ and rate_, and the rates of its states.
void LumpedSystem::apply(const PlacedLaw& law, const Rows& state, bool with_rates, Rows* rates,
                         Row& force) {
  std::array<double, kMaxLawStates> x{};
  for (Eigen::Index s = 0; s < law.states; ++s) {
    x[static_cast<std::size_t>(s)] = state(law.first_state + s, 0);
  }
  const std::span<const double> states(x.data(), static_cast<std::size_t>(law.states));
  if (columns_ == 1) {
    force(0) = law.law->force(deflection_(0), rate_(0), states);
    if (!with_rates || law.states == 0) return;
    std::array<double, kMaxLawStates> change{};
    law.law->state_rate(deflection_(0), rate_(0), states, {change.data(), states.size()});
    for (Eigen::Index s = 0; s < law.states; ++s) {
      (*rates)(law.first_state + s, 0) = change[static_cast<std::size_t>(s)];
    }
    return;
  }
  law.law->differentiate(deflection_(0), rate_(0), states, law_);
  const auto carry = [&](const LawDerivative& from, auto&& to) {
    to = from.by_deflection * deflection_ + from.by_rate * rate_;
    for (Eigen::Index s = 0; s < law.states; ++s) {
      to += from.by_state[static_cast<std::size_t>(s)] * state.row(law.first_state + s);
    }
    for (std::size_t p = 0; p < law.columns.size(); ++p) {
      if (law.columns[p] > 0) to(law.columns[p]) += from.by_parameter[p];
    }
    to(0) = from.value;
  };
  carry(law_.force, force);
  if (!with_rates) return;
  for (Eigen::Index s = 0; s < law.states; ++s) {
    carry(law_.state_rate[static_cast<std::size_t>(s)], rates->row(law.first_state + s));
  }
}

void LumpedSystem::pass_signal(const PlacedLaw& law, const Rows& state, Row& signal, Rows* rates) {
  if (law.driver >= 0) {
    deflection_ = input_rows_.row(law.driver);
  } else {
    deflection_ = signal;
  }
  rate_.setZero();
  apply(law, state, rates != nullptr, rates, force_);
  signal += force_;
}

void LumpedSystem::compute_inputs(const Rows& state, const double* inputs, const double* slopes,
                                  Rows* rates) {
  for (std::size_t j = 0; j < inputs_.size(); ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    input_rows_.row(row).setZero();
    input_rows_(row, 0) = inputs[j];
    if (slopes != nullptr && delay_columns_[j] > 0) input_rows_(row, delay_columns_[j]) = slopes[j];
  }
  for (const PlacedLaw& law : actuators_) {
    signal_ = input_rows_.row(law.channel);
    pass_signal(law, state, signal_, rates);
    input_rows_.row(law.channel) = signal_;
  }
}

// M^-1 (B u - imposed parts - laws), whole: less K q + C q' too; and the rates of the laws' states.
void LumpedSystem::compute_acceleration(const Rows& state, const double* inputs, bool whole,
                                        Rows& rates) {
  balance_.setZero();
  imposed_force_.setZero();
  for (std::size_t j = 0; j < inputs_.size(); ++j) {
    if (inputs_[j].kind != LumpedInput::Kind::kForce) continue;
    balance_.row(slot_[static_cast<std::size_t>(inputs_[j].mass)]) +=
        input_rows_.row(static_cast<Eigen::Index>(j));
  }
  for (const PlacedLaw& law : forces_) {
    deflect(law, state, inputs);
    apply(law, state, true, &rates, force_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (law.output_free(i) != 0.0) balance_.row(i) -= law.output_free(i) * force_;
    }
    for (Eigen::Index k = 0; k < law.output_imposed.size(); ++k) {
      if (law.output_imposed(k) != 0.0) imposed_force_.row(k) += law.output_imposed(k) * force_;
    }
  }
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Eigen::Index row = free_[static_cast<std::size_t>(i)];
    for (std::size_t k = 0; k < imposed_.size(); ++k) {
      const Eigen::Index other = imposed_[k];
      const double q = inputs[position_[k]], v = inputs[velocity_[k]], a = inputs[acceleration_[k]];
      balance_(i, 0) -=
          stiffness_(row, other) * q + damping_(row, other) * v + mass_(row, other) * a;
      for (const LinearParameter& p : linear_) {
        balance_(i, p.column) -=
            p.stiffness(row, other) * q + p.damping(row, other) * v + p.mass(row, other) * a;
      }
    }
    if (!whole) continue;
    for (Eigen::Index j = 0; j < n_; ++j) {
      const Eigen::Index other = free_[static_cast<std::size_t>(j)];
      balance_.row(i) -= stiffness_(row, other) * state.row(j);
      balance_.row(i) -= damping_(row, other) * state.row(n_ + j);
      for (const LinearParameter& p : linear_) {
        balance_(i, p.column) -=
            p.stiffness(row, other) * state(j, 0) + p.damping(row, other) * state(n_ + j, 0);
      }
    }
  }
  divide_by_mass();
}

void LumpedSystem::divide_by_mass() {
  for (Eigen::Index i = 0; i < n_; ++i) {
    auto to = acceleration_rows_.row(i);
    to = inverse_mass_(i, 0) * balance_.row(0);
    for (Eigen::Index j = 1; j < n_; ++j) to += inverse_mass_(i, j) * balance_.row(j);
  }
  // d(M^-1) r = -M^-1 dM (M^-1 r)
  for (const LinearParameter& p : linear_) {
    for (Eigen::Index j = 0; j < n_; ++j) {
      double moved = 0.0;
      for (Eigen::Index k = 0; k < n_; ++k) {
        moved += p.mass(free_[static_cast<std::size_t>(j)], free_[static_cast<std::size_t>(k)]) *
                 acceleration_rows_(k, 0);
      }
      if (moved == 0.0) continue;
      for (Eigen::Index i = 0; i < n_; ++i) {
        acceleration_rows_(i, p.column) -= inverse_mass_(i, j) * moved;
      }
    }
  }
}

void LumpedSystem::rates(const Rows& state, const double* inputs, const double* slopes, bool whole,
                         Rows& rates) {
  compute_inputs(state, inputs, slopes, &rates);
  compute_acceleration(state, inputs, whole, rates);
  if (whole) {
    rates.topRows(n_) = state.middleRows(n_, n_);
  } else {
    rates.topRows(n_).setZero();
  }
  rates.middleRows(n_, n_) = acceleration_rows_;
  for (const PlacedLaw& law : sensors_) {
    if (law.states == 0) continue;
    measure(static_cast<std::size_t>(law.channel), state, inputs, signal_);
    for (const PlacedLaw& before : sensors_) {
      if (before.channel != law.channel) continue;
      pass_signal(before, state, signal_, &rates);
      if (&before == &law) break;
    }
  }
}

void LumpedSystem::imposed_force(Eigen::Index mass, const Rows& state, const double* inputs,
                                 Row& row) {
  row = imposed_force_.row(slot_[static_cast<std::size_t>(mass)]);
  const auto add_linear_part = [&](const Eigen::MatrixXd& m, const Eigen::MatrixXd& c,
                                   const Eigen::MatrixXd& k, auto&& add_imposed, auto&& add_free) {
    for (std::size_t i = 0; i < imposed_.size(); ++i) {
      const Eigen::Index other = imposed_[i];
      add_imposed(m(mass, other) * inputs[acceleration_[i]] +
                  c(mass, other) * inputs[velocity_[i]] + k(mass, other) * inputs[position_[i]]);
    }
    for (Eigen::Index i = 0; i < n_; ++i) {
      const Eigen::Index other = free_[static_cast<std::size_t>(i)];
      add_free(i, m(mass, other), c(mass, other), k(mass, other));
    }
  };
  add_linear_part(
      mass_, damping_, stiffness_, [&](double force) { row(0) += force; },
      [&](Eigen::Index i, double m, double c, double k) {
        row += m * acceleration_rows_.row(i) + c * state.row(n_ + i) + k * state.row(i);
      });
  for (const LinearParameter& p : linear_) {
    add_linear_part(
        p.mass, p.damping, p.stiffness, [&](double force) { row(p.column) += force; },
        [&](Eigen::Index i, double m, double c, double k) {
          row(p.column) += m * acceleration_rows_(i, 0) + c * state(n_ + i, 0) + k * state(i, 0);
        });
  }
}

// One output before the sensors' laws; accelerations and forces must be there.
void LumpedSystem::measure(std::size_t output, const Rows& state, const double* inputs, Row& row) {
  const LumpedOutput& what = outputs_[output];
  const Eigen::Index slot = slot_[static_cast<std::size_t>(what.mass)];
  const bool is_imposed = is_imposed_[static_cast<std::size_t>(what.mass)];
  const auto k = static_cast<std::size_t>(slot);
  using enum LumpedOutput::Quantity;
  const auto take = [&](const Rows& rows, Eigen::Index at,
                        const std::vector<Eigen::Index>& channel) {
    if (is_imposed) {
      row.setZero();
      row(0) = inputs[channel[k]];
    } else {
      row = rows.row(at);
    }
  };
  switch (what.quantity) {
    case kPosition:
      return take(state, slot, position_);
    case kVelocity:
      return take(state, n_ + slot, velocity_);
    case kAcceleration:
      return take(acceleration_rows_, slot, acceleration_);
    case kForce:
      return imposed_force(what.mass, state, inputs, row);
    case kElementForce:
      deflect(measured_parts_[output], state, inputs);
      return apply(measured_parts_[output], state, false, nullptr, row);
  }
}

void LumpedSystem::outputs(const Rows& state, const double* inputs, const double* slopes,
                           Rows& outputs) {
  const bool needs_forces = std::ranges::any_of(outputs_, [](const LumpedOutput& output) {
    using enum LumpedOutput::Quantity;
    return output.quantity == kAcceleration || output.quantity == kForce;
  });
  const bool needs_inputs =
      std::ranges::any_of(sensors_, [](const PlacedLaw& law) { return law.driver >= 0; }) ||
      std::ranges::any_of(forces_, [](const PlacedLaw& law) { return law.driver >= 0; });
  if (needs_forces || needs_inputs) compute_inputs(state, inputs, slopes, &scratch_rates_);
  if (needs_forces) compute_acceleration(state, inputs, true, scratch_rates_);
  for (std::size_t j = 0; j < outputs_.size(); ++j) {
    measure(j, state, inputs, signal_);
    outputs.row(static_cast<Eigen::Index>(j)) = signal_;
  }
  for (const PlacedLaw& law : sensors_) {
    signal_ = outputs.row(law.channel);
    pass_signal(law, state, signal_, nullptr);
    outputs.row(law.channel) = signal_;
  }
}

// At rest a law's states are linear in z (law_catalogue.hpp: the mode hangs at z, the lag is at its
// signal), so one difference gives their slope.
void LumpedSystem::rest_laws(const double* inputs, Rows& state) {
  std::array<double, kMaxLawStates> at{}, beyond{};
  const auto rest = [&](const PlacedLaw& law, const Row& z) {
    const auto count = static_cast<std::size_t>(law.states);
    law.law->rest(z(0), {at.data(), count});
    law.law->rest(z(0) + 1.0, {beyond.data(), count});
    for (std::size_t s = 0; s < count; ++s) {
      auto row = state.row(law.first_state + static_cast<Eigen::Index>(s));
      row = (beyond[s] - at[s]) * z;
      row(0) = at[s];
    }
    at.fill(0.0);
    beyond.fill(0.0);
  };
  for (const PlacedLaw& law : forces_) {
    deflect(law, state, inputs);
    rest(law, deflection_);
  }
  compute_inputs(state, inputs, nullptr, &scratch_rates_);
  for (const PlacedLaw& law : actuators_) {
    deflection_.setZero();
    deflection_(0) = inputs[law.driver >= 0 ? law.driver : law.channel];
    rest(law, deflection_);
  }
  for (const PlacedLaw& law : sensors_) {
    measure(static_cast<std::size_t>(law.channel), state, inputs, signal_);
    deflection_ = signal_;
    if (law.driver >= 0) deflection_ = input_rows_.row(law.driver);
    rest(law, deflection_);
  }
}

}  // namespace graybox
