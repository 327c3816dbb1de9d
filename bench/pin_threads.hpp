// BLAS and OpenMP read their thread counts from the environment while the program is loaded. A
// threaded BLAS slows small factorisations several times, and its sums depend on its threads: it
// gets one, and large arrays are shared out in tiles (tiled_cholesky.hpp). So a command that solves
// starts itself again, once, with those counts set; counts that the user has set stay.
#pragma once

namespace graybox::bench {

// Does not return where the program has to be started again. `arguments` is argv of main.
void pin_threads(int threads, char** arguments);

}  // namespace graybox::bench
