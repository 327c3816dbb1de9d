// The number of threads on a benchmark's command line.
#pragma once

namespace graybox::bench {

// Takes --threads=N out of the arguments; 0 if N is no number from 1 on, all processors without it.
[[nodiscard]] int take_thread_count(int& argc, char** argv);

}  // namespace graybox::bench
