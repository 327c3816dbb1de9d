// The list of back-ends. Each is handed out behind a check of the criterion: one that its traits do
// not list is answered with status unsupported. Adding one is a file pair and one line in
// registry.cpp; the property tests and the study then run it with no further work. Programs may
// also add their own at run time:
//
//   graybox::SolverRegistry registry = graybox::make_registry();
//   registry.add(std::make_unique<MySolver>());
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "solvers/core/solver.hpp"

namespace graybox {

class SolverRegistry {
 public:
  struct Entry {
    std::string name;
    std::string description;
    std::unique_ptr<Solver> solver;  // null where the back-end was not built
    std::string unavailable_because;
  };

  // Throws InputError if the name is taken.
  void add(std::unique_ptr<Solver> solver);
  void add_unavailable(std::string name, std::string description, std::string reason);

  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }

  // The back-end of that name; "external:CMD" makes one that runs CMD. Throws InputError for an
  // unknown name (suggesting the nearest) and for one that was not built (with the reason).
  [[nodiscard]] const Solver& at(std::string_view name) const;

 private:
  std::vector<Entry> entries_;
  mutable std::vector<std::unique_ptr<Solver>> external_;  // made on demand by at()
};

// All back-ends of this build.
[[nodiscard]] SolverRegistry make_registry();

}  // namespace graybox
