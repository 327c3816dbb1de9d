// hostile_sets: the long version of hostile_sets_test.
//
//   hostile_sets [--verdicts N] [--seed S] [--rows FILE]
//
// Prints a table of all back-ends; exit code 1 where a design was called solved that is not, or a
// true gap lies outside the checker's bound. --rows writes every verdict as CSV.
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>

#include "tests/hostile_sets/hostile_run.hpp"
#include "tests/hostile_sets/hostile_sets.hpp"

namespace {

using namespace graybox::testing_sets;

struct Arguments {
  std::size_t verdicts = 20000;
  std::uint64_t seed = fresh_seed();
  std::string rows;
};

bool parse(int argc, char** argv, Arguments& arguments) {
  for (int i = 1; i < argc; i += 2) {
    const std::string_view name = argv[i];
    if (i + 1 == argc) return false;
    if (name == "--verdicts") {
      arguments.verdicts = std::strtoull(argv[i + 1], nullptr, 10);
    } else if (name == "--seed") {
      arguments.seed = std::strtoull(argv[i + 1], nullptr, 10);
    } else if (name == "--rows") {
      arguments.rows = argv[i + 1];
    } else {
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  if (!parse(argc, argv, arguments)) {
    fmt::print(stderr, "usage: hostile_sets [--verdicts N] [--seed S] [--rows FILE]\n");
    return 2;
  }
  fmt::print("seed {}\n", arguments.seed);
  std::fflush(stdout);
  std::ofstream rows;
  if (!arguments.rows.empty()) {
    rows.open(arguments.rows);
    rows << "set,kind,solver,asked,status,checked_gap,rounding_bound,true_gap\n";
  }
  const HostileDraw draw =
      run_hostile_sets(arguments.seed, arguments.verdicts, [&](const HostileVerdict& v) {
        if (!rows.is_open()) return;
        rows << fmt::format("{},{},{},{},{},{},{},{}\n", v.set, v.kind, v.solver, v.asked,
                            to_string(v.status), v.checked_gap, v.rounding_bound, v.true_gap);
      });
  fmt::print("{}", describe(draw));
  std::size_t wrong = 0;
  for (const auto& [key, tally] : draw.tally) wrong += tally.falsely_solved + tally.outside_bound;
  return wrong == 0 ? 0 : 1;
}
