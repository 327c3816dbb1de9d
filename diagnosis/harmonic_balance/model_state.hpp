// A model with laws at one value of its parameters: what each position answers at each line, and
// the laws beside it.
//
// Laws are forces of their own (steady_state.hpp solves for those), or part of the plant (bodies).
// Cost: a factorisation of n coordinates for each position and line, and two plants more a position
// for each body parameter.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "diagnosis/harmonic_balance/sampled_response.hpp"

namespace graybox {

struct ActingLaw {
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;
  std::vector<double> parameters;
  std::vector<bool> fixed{};  // known, so that derivatives are zero; empty: none is
};

// Known, or, where no other parameter of the law is, for any value of it others make the same
// force.
[[nodiscard]] bool is_fixed(const ActingLaw& law, std::size_t parameter);

// A law that is part of the plant (inertia of an arm, payload, a constant force that shifts the
// rest) rather than a force of its own.
[[nodiscard]] bool is_body(const CandidatePlace& place, const LawEntry& entry);

// By how much a body law's parameter is changed to see what the plant does.
[[nodiscard]] double small_change(const LinearPlant& plant, const Element& body, double value);

// The entries of a PlantDerivative's matrices that are not zero, and what becomes of the rest. Laws
// act on the motion from there, so that a spring which yields under the weight changes the slope of
// another beside it.
struct PlantChange {
  struct Entry {
    Eigen::Index row = 0, column = 0;
    double mass = 0.0, damping = 0.0, stiffness = 0.0;
  };
  std::vector<Entry> entries;  // by rows
  Eigen::VectorXd rest;        // empty: stays
};
[[nodiscard]] PlantChange entries_of(const PlantDerivative& derivative);

// One position of the model at one value of its parameters.
struct PositionResponse {
  LinearPlant plant;
  std::vector<PlantChange> changes;          // by each parameter of the plant
  std::vector<Eigen::MatrixXcd> receptance;  // D^-1 of lines 0 ... K
  std::optional<HeldImages> held_images;
  std::vector<Eigen::MatrixXcd> images;  // A of each line
  // dA by each parameter of each line, where some parameter is a mass: springs and dampers alone
  // hardly change what happens above all modes.
  std::vector<std::vector<Eigen::MatrixXcd>> image_changes;
  std::vector<Eigen::MatrixXcd> sight;    // (S_0 + j w S_1) D^-1
  std::vector<PlantChange> body_changes;  // by each parameter of body laws
};

struct ModelState {
  std::uint64_t version = 0;  // another one for each state ever made
  Eigen::VectorXd parameters;
  std::vector<ActingLaw> laws;  // all, in order
  std::vector<Element> bodies;  // those of them that are part of the plant
  std::vector<PositionResponse> positions;
};

// Derivatives by body laws' parameters are filled in where `with_derivatives`.
[[nodiscard]] ModelState evaluate_model(const PlantFamily& family, const PeriodicData& data,
                                        const Eigen::VectorXd& parameters,
                                        std::vector<ActingLaw> laws, bool with_derivatives,
                                        int threads);

}  // namespace graybox
