// The worker of study_test: the real one, with the solvers of study_solvers.hpp.
#include <cstdio>
#include <string>
#include <vector>

#include "bench/study/worker.hpp"
#include "problems/base/error.hpp"
#include "tests/support/study_solvers.hpp"

int main(int argc, char** argv) {
  try {
    const auto request =
        graybox::bench::parse_worker_arguments(std::vector<std::string>(argv + 1, argv + argc));
    return graybox::bench::run_worker(request, graybox::testing::study_registry());
  } catch (const graybox::InputError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
