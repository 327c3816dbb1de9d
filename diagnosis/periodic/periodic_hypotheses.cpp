#include "diagnosis/periodic/periodic_hypotheses.hpp"

#include <limits>
#include <utility>

#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/periodic/periodic_assessment.hpp"
#include "diagnosis/periodic/periodic_shapes.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// log det(1 + D S D) of the parameters after those of the model (ExtendedFit::laws_information).
double information_of_laws(const PeriodicFit& fitted, std::size_t model_parameters) {
  const auto own = static_cast<Index>(model_parameters);
  const Index count = fitted.information.rows() - own;
  if (count == 0) return 0.0;
  VectorXd values(count);
  Index k = -own;
  for (const double value : fitted.parameters) {
    if (k >= 0) values(k) = value;
    ++k;
  }
  for (const ActingLaw& law : fitted.laws) {
    for (const double value : law.parameters) {
      if (k >= 0) values(k) = value;
      ++k;
    }
  }
  MatrixXd information = fitted.information.bottomRightCorner(count, count);
  if (own > 0) {
    const MatrixXd cross = fitted.information.topRightCorner(own, count);
    information -=
        cross.transpose() * solve_information(fitted.information.topLeftCorner(own, own), cross);
  }
  return log_determinant_with_prior(information, values);
}

}  // namespace

PeriodicHypotheses::PeriodicHypotheses(std::shared_ptr<const PlantFamily> family,
                                       std::size_t positions)
    : family_(std::move(family)) {
  list_base_laws();
  list_hypotheses(positions);
}

void PeriodicHypotheses::list_base_laws() {
  const std::vector<Element>& elements = family_->elements();
  base_places_ = std::make_shared<std::vector<CandidatePlace>>(elements.size());
  for (std::size_t e = 0; e < elements.size(); ++e) {
    CandidatePlace& place = (*base_places_)[e];
    place.location = elements[e].location;
    place.shifts_rest = family_->shifts_rest(elements[e].location);
    const bool is_signal = elements[e].location.kind != LocationKind::kElement;
    const LawEntry* entry = find_law(elements[e].law_name, is_signal);
    require_one_state(*entry);
    base_laws_.push_back({&place, entry, elements[e].parameters, elements[e].fixed});
    base_names_.push_back(elements[e].name);
  }
}

void PeriodicHypotheses::list_hypotheses(std::size_t positions) {
  for (const CandidatePlace& place : family_->places()) {
    for (const LawEntry* entry : hypothetical_laws(place, positions)) {
      add_hypothesis(place, *entry);
      const LawEntry* twin = twin_of(*entry, place, positions);
      if (twin == nullptr) continue;
      hypotheses_.back().twins = {hypotheses_.size()};
      add_hypothesis(place, *twin);
      hypotheses_.back().only_named = true;
    }
  }
}

void PeriodicHypotheses::add_hypothesis(const CandidatePlace& place, const LawEntry& entry) {
  require_one_state(entry);
  hypotheses_.push_back(
      {place.location.name, place.yaml, entry.name, special_cases_of(entry, true)});
  hypotheses_.back().characteristic = characteristic_of(entry, place);
  places_.push_back(&place);
  entries_.push_back(&entry);
}

std::size_t PeriodicHypotheses::model_parameter_count() const {
  std::size_t count = family_->parameters().size();
  for (const ActingLaw& law : base_laws_) count += law.parameters.size();
  return count;
}

std::vector<ActingLaw> PeriodicHypotheses::with_base_laws(std::span<const LawStart> laws) const {
  std::vector<ActingLaw> acting = base_laws_;
  for (const LawStart& law : laws) {
    acting.push_back({places_[law.hypothesis], entries_[law.hypothesis], law.parameters, {}});
  }
  return acting;
}

std::vector<ActingLaw> PeriodicHypotheses::laws_of(const ExtendedFit& fit) const {
  std::vector<ActingLaw> laws = base_laws_;
  for (const FittedLaw& law : fit.laws) {
    laws.push_back({places_[law.hypothesis], entries_[law.hypothesis], law.values(), {}});
  }
  return laws;
}

void PeriodicHypotheses::take_model_parameters(const ExtendedFit& fit, VectorXd& parameters,
                                               std::vector<ActingLaw>& laws) const {
  std::size_t k = 0;
  for (double& value : parameters) value = fit.model_parameters[k++].value;
  for (std::size_t l = 0; l < base_laws_.size(); ++l) {
    for (double& value : laws[l].parameters) value = fit.model_parameters[k++].value;
  }
}

ExtendedFit PeriodicHypotheses::report(const PeriodicFit& fitted,
                                       std::span<const LawStart> laws) const {
  ExtendedFit result;
  result.usable = fitted.converged;
  result.trouble = fitted.trouble;
  if (fitted.parameters.size() == 0) return result;
  result.parameter_count = static_cast<std::size_t>(fitted.information.rows());
  const VectorXd errors = standard_errors(fitted);
  Index k = 0;
  for (const ModelParameter& parameter : family_->parameters()) {
    result.model_parameters.push_back(
        {parameter.name, parameter.unit, fitted.parameters(k), errors(k)});
    ++k;
  }
  for (std::size_t l = 0; l < fitted.laws.size(); ++l) {
    const ActingLaw& law = fitted.laws[l];
    const bool is_base = l < base_laws_.size();
    if (!is_base) result.laws.push_back({laws[l - base_laws_.size()].hypothesis, {}});
    for (std::size_t p = 0; p < law.parameters.size(); ++p, ++k) {
      LawParameterEstimate estimate = estimate_of(
          law.entry->parameters[p], law.place->location.units, law.parameters[p], errors(k));
      if (is_base) {  // whoever states a law knows its sizes
        estimate.name = base_names_[l] + "." + estimate.name;
        estimate.standard_error = errors(k);
        estimate.conditional_error = std::numeric_limits<double>::quiet_NaN();
        estimate.sets_scale = estimate.sets_scale && is_fixed(law, p);
      }
      if (is_fixed(law, p)) --result.parameter_count;
      (is_base ? result.model_parameters : result.laws.back().parameters).push_back(estimate);
    }
  }
  result.deviance = fitted.chi_square;
  result.laws_information = information_of_laws(fitted, result.model_parameters.size());
  return result;
}

VectorXd values_of(const ExtendedFit& fit) {
  std::vector<double> values;
  for (const LawParameterEstimate& each : fit.model_parameters) values.push_back(each.value);
  for (const FittedLaw& law : fit.laws) {
    for (const LawParameterEstimate& each : law.parameters) values.push_back(each.value);
  }
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

}  // namespace graybox
