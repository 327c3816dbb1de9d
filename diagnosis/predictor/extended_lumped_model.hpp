// A lumped model with laws that were found, and where a search may move its parameters.
//
// Every law is one more part of the model, so an extended model is a model like any other.
// Parameters are searched in coordinates z:
//
//   logarithmic   value = exp(z)           masses, springs, dampers of the model; sizes of shapes
//   linear        value = scale z          forces, offsets, what may be zero or negative
//
// A stated mass or spring may move by a factor about the value of the first fit; a stated damping
// may vanish, since it often stands in for a friction that is found later.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

struct ParameterSpace {
  bool logarithmic = false;
  double scale = 1.0;
  double low, high;
  [[nodiscard]] bool may_vanish() const;  // a damping
  [[nodiscard]] double coordinate(double value) const;
  [[nodiscard]] double value(double coordinate) const;
};

struct PlacedFinding {
  std::size_t hypothesis = 0;
  std::size_t part = 0;  // of the model
};

struct ExtendedLumpedModel {
  LumpedModel model;
  std::vector<ParameterSpace> space;  // of each parameter of the model
  std::vector<PlacedFinding> laws;    // in the order of their parts

  [[nodiscard]] std::vector<std::size_t> free_parameters() const;
  [[nodiscard]] std::vector<double> values() const;
  [[nodiscard]] std::size_t first_parameter(std::size_t part) const;
  [[nodiscard]] std::size_t own_parameters() const;  // of the model as it was given
};

// A law in a form that a search can add: parameters = base + amplitude * direction.
struct LawExtension {
  std::size_t hypothesis = 0;
  Location location;
  std::string law;
  std::vector<double> base, direction;
  std::vector<bool> fixed;        // not fitted
  std::vector<double> most = {};  // where not empty, of each parameter
  double unit = 1.0;              // amplitude of the order of what acts at all
  bool one_sided = false;         // amplitudes below zero can't be
  // A law that has no useful slope at zero: scored by the step to amplitude one.
  bool is_secant = false;
  std::optional<std::size_t> replaces;  // a part of the model, that this law contains
  // Where a parameter of the model starts beside this law; it moves on from there.
  struct OwnStart {
    std::size_t parameter = 0;
    double value = 0.0;
  };
  std::optional<OwnStart> own_start = {};
  int complexity = 0;
};

// Whether one mass that moves by itself is all that the model has besides dampers, and springs of a
// known stiffness, as a servo's.
[[nodiscard]] bool is_one_mass_alone(const LumpedModel& model);

// `factor`: how far masses and springs may move.
[[nodiscard]] ExtendedLumpedModel as_given(const LumpedModel& model, double factor);
[[nodiscard]] ExtendedLumpedModel extended(const ExtendedLumpedModel& model,
                                           const LawExtension& law, double amplitude);
[[nodiscard]] ExtendedLumpedModel without_part(const ExtendedLumpedModel& model, std::size_t part);
// `model` and the last law of another one.
[[nodiscard]] ExtendedLumpedModel with_last_law_of(const ExtendedLumpedModel& donor,
                                                   const ExtendedLumpedModel& model);
[[nodiscard]] ExtendedLumpedModel with_values(const ExtendedLumpedModel& model,
                                              const std::vector<double>& values);

}  // namespace graybox
