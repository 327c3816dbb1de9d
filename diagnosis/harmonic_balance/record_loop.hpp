// Work on one recording after the other, on several threads, with results that do not depend on how
// many.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "problems/base/stop.hpp"

namespace graybox {

// Sums over recordings are made for each chunk, and the chunks' are added in order.
inline constexpr std::size_t kRecordChunks = 8;

// work(solver, record, index, chunk): chunks at once, the recordings of each in order. Throws
// Stopped where time is up (stop.hpp).
template <typename Work>
void for_each_record(const PlantFamily& family, const PeriodicData& data,
                     const std::vector<MeasuredRecord>& records, int threads, const Work& work) {
  const StopClock clock;
#pragma omp parallel num_threads(threads)
  {
    SteadyStateSolver solver(family, data, {});
#pragma omp for schedule(dynamic)
    for (std::size_t chunk = 0; chunk < kRecordChunks; ++chunk) {
      const std::size_t first = records.size() * chunk / kRecordChunks;
      const std::size_t last = records.size() * (chunk + 1) / kRecordChunks;
      for (std::size_t i = first; i < last && !clock.stops(); ++i)
        work(solver, records[i], i, chunk);
    }
  }
  stop_if_requested();
}

}  // namespace graybox
