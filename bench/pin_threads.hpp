// BLAS and OpenMP read their thread counts from the environment while the program is loaded, and a
// threaded BLAS slows small factorisations several times. So a command that solves starts itself
// again, once, with those counts set; counts that the user has set stay.
#pragma once

namespace graybox::bench {

// Does not return where the program has to be started again. `arguments` is argv of main.
void pin_threads(int threads, char** arguments);

}  // namespace graybox::bench
