#include "diagnosis/harmonic_balance/model_state.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <exception>
#include <mutex>
#include <utility>

#include "problems/base/array_index.hpp"
#include "problems/base/stop.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Element as_element(const ActingLaw& law) {
  Element element;
  element.location = law.place->location;
  element.law_name = law.entry->name;
  element.use = law.entry->use;
  element.parameters = law.parameters;
  return element;
}

// M and K of the plant by each parameter of each body law, by central differences.
void differentiate_bodies(const PlantFamily& family, const VectorXd& angles,
                          const VectorXd& parameters, const std::vector<Element>& bodies,
                          PositionResponse& response) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    for (std::size_t p = 0; p < bodies[b].parameters.size(); ++p) {
      const double step = small_change(response.plant, bodies[b], bodies[b].parameters[p]);
      std::vector<Element> shifted = bodies;
      shifted[b].parameters[p] += step;
      const LinearPlant above = family.plant(angles, parameters, shifted);
      shifted[b].parameters[p] -= 2.0 * step;
      const LinearPlant below = family.plant(angles, parameters, shifted);
      response.body_changes.push_back(
          entries_of({(above.mass - below.mass) / (2.0 * step),
                      {},
                      (above.stiffness - below.stiffness) / (2.0 * step),
                      (above.rest - below.rest) / (2.0 * step)}));
    }
  }
}

}  // namespace

PlantChange entries_of(const PlantDerivative& derivative) {
  const Index n =
      std::max({derivative.mass.rows(), derivative.damping.rows(), derivative.stiffness.rows()});
  const auto entry = [](const MatrixXd& matrix, Index i, Index j) {
    return matrix.size() > 0 ? matrix(i, j) : 0.0;
  };
  PlantChange change;
  change.rest = derivative.rest;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      const PlantChange::Entry found{i, j, entry(derivative.mass, i, j),
                                     entry(derivative.damping, i, j),
                                     entry(derivative.stiffness, i, j)};
      if (found.mass != 0.0 || found.damping != 0.0 || found.stiffness != 0.0) {
        change.entries.push_back(found);
      }
    }
  }
  return change;
}

// A force that moves the arm by about 1e-4 rad: the rest is found to far less.
double small_change(const LinearPlant& plant, const Element& body, double value) {
  if (body.law_name != "offset") return 1e-4 * std::max(std::abs(value), 0.1);
  return 1e-4 * body.location.input.dot(plant.stiffness * body.location.output);
}

bool is_fixed(const ActingLaw& law, std::size_t i) {
  const bool some_are_known = std::ranges::count(law.fixed, true) > 0;
  return some_are_known ? static_cast<bool>(law.fixed[i]) : law.entry->parameters[i].sets_scale;
}

bool is_body(const CandidatePlace& place, const LawEntry& entry) {
  if (entry.use == LawUse::kPayload) return true;
  if (entry.name == "offset" && entry.use == LawUse::kForce) return place.shifts_rest;
  return entry.use == LawUse::kInertia && place.location.name.ends_with(".arm");
}

ModelState evaluate_model(const PlantFamily& family, const PeriodicData& data,
                          const VectorXd& parameters, std::vector<ActingLaw> laws,
                          bool with_derivatives, int threads) {
  static std::atomic<std::uint64_t> versions{0};
  ModelState state;
  state.version = ++versions;
  state.parameters = parameters;
  state.laws = std::move(laws);
  for (const ActingLaw& law : state.laws) {
    if (is_body(*law.place, *law.entry)) state.bodies.push_back(as_element(law));
  }
  state.positions.resize(data.positions.size());
  std::exception_ptr failure;
  std::mutex guard;
#pragma omp parallel for num_threads(threads) schedule(dynamic)
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    try {
      stop_if_requested();
      PositionResponse& response = state.positions[i];
      response.plant = family.plant(data.positions[i], parameters, state.bodies);
      if (with_derivatives) {
        differentiate_bodies(family, data.positions[i], parameters, state.bodies, response);
      }
      for (const PlantDerivative& derivative : response.plant.derivatives) {
        response.changes.push_back(entries_of(derivative));
      }
      const bool has_masses =
          with_derivatives &&
          std::ranges::any_of(response.plant.derivatives,
                              [](const PlantDerivative& change) { return change.mass.size() > 0; });
      response.held_images.emplace(response.plant, data.sample_time);
      for (Index k = 0; k <= data.last_line; ++k) {
        const double w = data.frequencies[at(k)];
        response.receptance.push_back(receptance(response.plant, w));
        std::vector<MatrixXcd> changes;
        response.images.push_back(
            k == 0 ? MatrixXcd()
                   : response.held_images->response(w, has_masses ? &changes : nullptr));
        if (has_masses) response.image_changes.push_back(std::move(changes));
        MatrixXcd seen = Complex(0.0, w) * response.plant.velocity_output.cast<Complex>();
        seen += response.plant.position_output;
        response.sight.emplace_back(seen * response.receptance.back());
      }
    } catch (...) {
      const std::scoped_lock lock(guard);
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  return state;
}

}  // namespace graybox
