#include "diagnosis/force_balance/balance_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr Index kShownChannels = 8;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// That lasted for as long as the filter of the signals takes to rise.
double slowest_speed(const Motion& piece, Index joint) {
  constexpr double kRise = 0.35;  // times the reciprocal of a low-pass's frequency
  double seconds = 0.0;
  for (const FilterPass& filter : piece.filters) {
    seconds = std::max(seconds, kRise / filter.frequency);
  }
  const double samples = piece.sample_time() > 0.0 ? seconds / piece.sample_time() : 0.0;
  return slowest_lasting_speed(piece.velocity.col(joint), std::max<Index>(1, std::lround(samples)));
}

void add_spans(const ForceBalanceData& data, const ForceBalanceRows& rows, Index j,
               CheckedRange& range) {
  const BalanceCoordinate& moving = data.coordinates[static_cast<std::size_t>(j)];
  constexpr double kNever = std::numeric_limits<double>::infinity();
  CheckedRange::Span position{"position of " + moving.name, moving.units.deflection, kNever,
                              -kNever};
  CheckedRange::Span velocity{"velocity of " + moving.name, moving.units.deflection + "/s", kNever,
                              -kNever};
  const auto widen = [](CheckedRange::Span& span, const auto& values) {
    span.from = std::min(span.from, values.minCoeff());
    span.to = std::max(span.to, values.maxCoeff());
  };
  for (const Motion& piece : rows.pieces) {
    widen(position, piece.position.col(j));
    widen(velocity, piece.velocity.col(j));
  }
  CheckedRange::Span recorded = velocity;
  for (const ForceBalanceRows* all : {&data.estimation, &data.validation}) {
    for (const Motion& piece : all->pieces) {
      widen(recorded, piece.velocity.col(j));
      const double slowest = slowest_speed(piece, j);
      const bool is_slower = recorded.slowest == 0.0 || slowest < recorded.slowest;
      if (slowest > 0.0 && is_slower) recorded.slowest = slowest;
    }
  }
  velocity.slowest = recorded.slowest;
  range.recorded.push_back(std::move(recorded));
  if (data.position_is_recorded) range.spans.push_back(std::move(position));
  range.spans.push_back(std::move(velocity));
  range.spans.push_back({moving.channel(), moving.units.force, rows.measured.col(j).minCoeff(),
                         rows.measured.col(j).maxCoeff()});
}

// Pieces of one recording are told apart by their number.
std::string piece_name(const ForceBalanceRows& rows, std::size_t piece) {
  const std::string& name = rows.names[piece];
  if (std::ranges::count(rows.names, name) < 2) return name;
  return name +
         fmt::format(", piece {}",
                     1 + std::count(rows.names.begin(),
                                    rows.names.begin() + static_cast<std::ptrdiff_t>(piece), name));
}

}  // namespace

ForcePicture force_picture(const ForceBalanceData& data, std::size_t hypothesis,
                           const PlacedLaw& law, const Eigen::MatrixXd& rest) {
  const BalanceColumns own = law_force_column(law, data, data.estimation);
  const Eigen::VectorXd& direction = law.place->location.output;
  Eigen::VectorXd law_force = Eigen::VectorXd::Zero(rest.rows());
  for (Index j = 0; j < rest.cols(); ++j) {
    const Eigen::MatrixXd& block = own.in[static_cast<std::size_t>(j)];
    if (block.size() > 0) law_force += direction(j) * block.col(0);
  }
  law_force /= direction.squaredNorm();
  const Eigen::VectorXd force = law_force + rest * direction / direction.squaredNorm();
  const PlaceUnits& units = law.place->location.units;
  ForcePicture result{
      hypothesis, units.deflection, units.deflection + "/s", units.force, {}, {}, {}, {}};
  for (const Motion& piece : data.estimation.pieces) {
    const RecordedPlaceMotion motion = motion_at(*law.place, piece);
    result.deflection.insert(result.deflection.end(), motion.deflection.begin(),
                             motion.deflection.end());
    result.rate.insert(result.rate.end(), motion.rate.begin(), motion.rate.end());
  }
  result.force.assign(force.begin(), force.end());
  result.law_force.assign(law_force.begin(), law_force.end());
  return result;
}

void add_curves(const ForceBalanceData& data, const ForceBalanceRows& rows,
                const Eigen::MatrixXd& rest, bool held_out, std::vector<ResidualCurve>& curves) {
  const Index channels = std::min(rows.coordinates(), kShownChannels);
  const std::size_t shown = std::min(rows.pieces.size(), shown_recordings(channels));
  Index first = 0;
  for (std::size_t p = 0; p < shown; ++p) {
    const Motion& piece = rows.pieces[p];
    const auto own = Eigen::seqN(first, piece.samples());
    for (Index j = 0; j < channels; ++j) {
      const BalanceCoordinate& moving = data.coordinates[static_cast<std::size_t>(j)];
      ResidualCurve curve;
      curve.channel = moving.channel();
      curve.unit = moving.units.force;
      curve.experiment = piece_name(rows, p);
      curve.predicted_how = "at the measured motion";
      curve.over_time = true;
      curve.held_out = held_out;
      Eigen::VectorXd measured = rows.measured(own, j), left = rest(own, j);
      if (rows.counts.size() > 0) {
        const auto is_out = rows.counts(own, j).array() == 0.0;
        measured = is_out.select(kNaN, measured);
        left = is_out.select(kNaN, left);
      }
      curve.axis.assign(piece.time.begin(), piece.time.end());
      curve.measured.assign(measured.begin(), measured.end());
      curve.residual.assign(left.begin(), left.end());
      curves.push_back(std::move(curve));
    }
    first += piece.samples();
  }
}

CheckedRange checked_range(const ForceBalanceData& data) {
  CheckedRange range;
  range.kept_out = !data.validation.empty();
  const ForceBalanceRows& rows = range.kept_out ? data.validation : data.estimation;
  for (const std::string& name : rows.names) {
    if (std::ranges::find(range.files, name) == range.files.end()) range.files.push_back(name);
  }
  for (Index j = 0; j < rows.coordinates(); ++j) add_spans(data, rows, j, range);
  if (tells_standing(data)) {
    const BalanceCoordinate& axis = data.coordinates.front();
    range.standing = {axis.name, axis.units.force, data.standing, kNaN};
  }
  return range;
}

void describe_physics(const ForceBalanceData& data, const PlacedLaw& law,
                      PhysicalContext::OfLaw& own) {
  const Location& place = law.place->location;
  if (place.input != place.output) return;  // driven from elsewhere, it may well feed energy in
  own.inertia = data.known_inertia;
  if (place.units.deflection == "m") own.stiffness = 0.0;  // gravity may make a joint topple
  own.damping = 0.0;
  for (const Element& element : data.robot.elements) {
    const bool is_there = are_one_place(element.location, place);
    if (is_there && element.law_name == "viscous") own.damping += element.parameters[0];
  }
  const ForceBalanceRows& rows = data.estimation;
  const BalanceColumns force = law_force_column(law, data, rows);
  const Eigen::VectorXd direction = place.output / place.output.squaredNorm();
  Eigen::VectorXd at_place = Eigen::VectorXd::Zero(rows.samples());
  for (Index j = 0; j < rows.coordinates(); ++j) {
    const Eigen::MatrixXd& block = force.in[static_cast<std::size_t>(j)];
    const Eigen::VectorXd column =
        block.size() > 0 ? Eigen::VectorXd(block.col(0)) : Eigen::VectorXd::Zero(rows.samples());
    own.trace.acting.insert(own.trace.acting.end(), column.begin(), column.end());
    at_place += direction(j) * column;
  }
  own.trace.force.assign(at_place.begin(), at_place.end());
  for (const Motion& piece : rows.pieces) {
    const RecordedPlaceMotion motion = motion_at(*law.place, piece);
    own.trace.deflection.insert(own.trace.deflection.end(), motion.deflection.begin(),
                                motion.deflection.end());
    own.trace.rate.insert(own.trace.rate.end(), motion.rate.begin(), motion.rate.end());
  }
  const Eigen::VectorXd measured = rows.measured * direction;
  const Eigen::Map<const Eigen::VectorXd> rate(own.trace.rate.data(), rows.samples());
  own.trace.carried = measured.cwiseAbs().maxCoeff();
  own.trace.fed_in = measured.cwiseProduct(rate).cwiseMax(0.0).mean();
}

}  // namespace graybox
