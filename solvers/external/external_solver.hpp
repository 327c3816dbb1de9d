// external:CMD: any program in any language as a back-end, run as
//
//   CMD problem.h5 design.json GAP SECONDS
//
// with the problem as HDF5 (problems/formats/hdf5_file.hpp) in a fresh temporary folder, the
// duality gap asked for and the seconds it has ("inf" without limit). Placeholders in CMD ask for
// another format or another place of the arguments: "external:python3 my.py {npy}" (hand_over.hpp).
// It writes design.json (design_file.hpp: "format" and "support" with "index" and "weight" are
// enough) and exits with 0. The files scripts/examples/external_solver.* are complete ones.
//
// CMD is a line for /bin/sh: words, quotes and variables mean what they mean there. Its outputs are
// kept out of ours; the last line of them ends the message if it fails. The program and all it
// starts are killed when this process ends and when the observer asks to stop. They are also killed
// when it has not finished half a second and 2 % after its time. What it has left in design.json
// then still counts. So a program may rewrite the file as it goes (write another one and rename
// it).
//
// The clock runs from start to end of the program; writing and reading the files are off it. The
// trace has the gap at the end alone. What the program says of its own seconds and trace is kept
// beside it (OwnAccount). Weights that miss the simplex by up to 1e-6 are repaired, which the
// message says (weight_repair.hpp).
//
// Status: what the field "status" of the design claims (a false claim stays one: the checker is
// there to find it); without it, solved if the checked gap is met, else numerical_failure. An exit
// code other than 0, a signal, a missing or malformed design, or weights that are no design of the
// problem: numerical_failure with a message, and uniform weights. Killed for its time: time_limit.
#pragma once

#include <string>

#include "solvers/core/solver.hpp"
#include "solvers/external/hand_over.hpp"

namespace graybox {

class ExternalSolver final : public Solver {
 public:
  static constexpr std::string_view kPrefix = "external:";

  // `name` is "external:CMD". Both throw InputError if CMD is blank.
  explicit ExternalSolver(std::string name);
  // The same program under a name of the user's choice.
  ExternalSolver(std::string name, std::string command);

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] std::string_view description() const override { return "an external program"; }
  [[nodiscard]] SolverTraits traits() const override { return {.reachable_gap = 1e-3}; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override;

 private:
  std::string name_;
  ExternalCommand command_;
};

}  // namespace graybox
