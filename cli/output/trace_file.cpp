#include "cli/output/trace_file.hpp"

#include <nlohmann/json.hpp>

#include "problems/files/atomic_file.hpp"

namespace graybox::cli {

void write_trace(const std::string& path, const std::vector<TracePoint>& trace) {
  std::string lines;
  for (const TracePoint& point : trace) {
    const nlohmann::ordered_json line{{"seconds", point.seconds},
                                      {"passes", point.passes},
                                      {"duality_gap", point.duality_gap},
                                      {"iteration", point.iteration}};
    lines += line.dump() + "\n";
  }
  write_text_file(path, lines);
}

}  // namespace graybox::cli
