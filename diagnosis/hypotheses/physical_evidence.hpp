// What only a problem knows of its parameters, laws and recordings, to judge whether a fit can be a
// machine's (fit_physics.hpp) and to say where it was checked. A MismatchProblem that knows it
// derives from this, too.
#pragma once

#include <limits>
#include <vector>

#include "diagnosis/hypotheses/checked_range.hpp"
#include "diagnosis/plausibility/fitted_physics.hpp"

namespace graybox {

struct ExtendedFit;

struct PhysicalContext {
  // Of a law of the fit; NaN: not known.
  struct OfLaw {
    // What the model has at the place already, and a law's parameter that is an error of it may
    // take away.
    double stiffness = std::numeric_limits<double>::quiet_NaN();
    double damping = std::numeric_limits<double>::quiet_NaN();
    double inertia = std::numeric_limits<double>::quiet_NaN();
    LawTrace trace;  // its names and its conservative part are filled in by fit_physics
  };
  std::vector<double> starts;           // of the model's parameters; empty: none
  std::vector<QuantityKind> kinds;      // likewise; empty: by their units
  std::vector<double> lowest, highest;  // likewise, where the search for them ended; NaN: nowhere
  std::vector<PhysicalBody> bodies;  // as the fit has them; empty: as stated, or not by themselves
  std::vector<OfLaw> laws;           // in the fit's order; empty: nothing is known
};

class PhysicalEvidence {
 public:
  virtual ~PhysicalEvidence() = default;
  [[nodiscard]] virtual PhysicalContext physical_context(const ExtendedFit& fit) const = 0;
  // Of the recordings kept out, or of the fit's own where there are none.
  [[nodiscard]] virtual CheckedRange checked_range() const = 0;
};

}  // namespace graybox
