// Periodic recordings with what the model says of their free motion (transients.hpp): the periodic
// motion of each, and the plant that answers a departure from it. Records whose plants are the same
// share one.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/free_motion/sampled_plant.hpp"
#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "problems/base/stop.hpp"

namespace graybox {

// A law that is a force and not linear, about the motion of a record.
struct MeanSlope {
  double stiffness = 0.0, damping = 0.0;

  friend bool operator==(const MeanSlope&, const MeanSlope&) = default;
};

// A law of the model that is a force.
struct FreeForceLaw {
  const Location* place = nullptr;
  PeriodicLaw law;
  std::optional<LinearForce> linear;

  // With the present motion alone, and not linearly.
  [[nodiscard]] bool is_curved() const { return !linear && !law.has_states(); }
};

// How the plant of some records moves freely, at their bins 1 ... B.
struct FreePlant {
  std::size_t position = 0, group = 0;
  Eigen::Index periods = 1, bins = 0;  // B
  LinearPlant plant;                   // with linear laws and the others' mean slopes,
  std::vector<MeanSlope> slopes;       // which are these, of each law
  SampledPlant sampled;
  std::vector<Eigen::MatrixXcd> motion;    // z C (z I - A)^-1, n_y x 2n each
  std::vector<Eigen::MatrixXcd> response;  // G
  Eigen::VectorXd departure_size;          // 2n, what |d| is expected to be at most
  // The last round of the fit left these two:
  Eigen::LLT<Eigen::MatrixXd> information;  // of d, scaled by its size
  Eigen::VectorXd leverage;                 // of each bin between lines, mean over the outputs

  [[nodiscard]] bool is_line(Eigen::Index bin) const { return bin % periods == 0; }
};

struct FreeRecord {
  MeasuredRecord* record = nullptr;
  std::size_t plant = 0;      // of all FreePlants
  Eigen::MatrixXcd periodic;  // q of the steady state, n x (K + 1), n with masses that swing
  // The force of own forces and laws under it, n x (B + 1); empty: not asked yet.
  Eigen::MatrixXcd periodic_force;
  Eigen::MatrixXcd excess;  // Y - G U, n_y x (B + 1)
  // The last round of the fit left what follows.
  Eigen::VectorXd departure;  // d
  // q by what own forces and laws add with the free motion, n x (B + 1); empty: nothing.
  Eigen::MatrixXcd own;
  Eigen::MatrixXcd own_seen;  // the same at the outputs, n_y x (B + 1)
  Eigen::MatrixXcd rest;      // excess without all that
  bool runs_away = false;     // substitution does
  bool without_laws = false;  // beyond their mean slopes
};

// What stays the same while free motion is taken out. Keeps references.
struct FreeMotionFrame {
  FreeMotionFrame(const PlantFamily& plants, const ModelState& state,
                  const PeriodicDataOptions& reading, PeriodicData& recordings);

  // The whitening of the line that is nearest to a bin.
  [[nodiscard]] const Eigen::MatrixXcd& weight(const FreePlant& plant, Eigen::Index bin) const;
  // On the unit circle of z.
  [[nodiscard]] double angle(const FreePlant& plant, Eigen::Index bin) const;
  [[nodiscard]] double frequency(const FreePlant& plant, Eigen::Index bin) const;

  const PlantFamily& family;
  const ModelState& model;
  const PeriodicDataOptions& options;
  PeriodicData& data;
  StopClock clock;
  std::vector<FreeForceLaw> laws;  // those of the model that are forces
  bool has_curved_laws = false;
};

// All recordings of several periods.
struct FreeRecords {
  std::vector<FreePlant> plants;
  std::vector<FreeRecord> records;
};

// Throws Stopped.
[[nodiscard]] FreeRecords collect_free_records(const FreeMotionFrame& frame);

}  // namespace graybox
