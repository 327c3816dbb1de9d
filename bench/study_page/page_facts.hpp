// What the page of a study says in several places: its points beside the fastest on the same set,
// and its solvers in one order.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "bench/study/tables.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox::bench {

// A point and the fastest answer to the same question: same experiment, set, Q and gap.
struct ComparedPoint {
  PointSummary point;
  double ratio = std::numeric_limits<double>::quiet_NaN();  // to the fastest; NaN if not solved
  std::string fastest;                                      // its solver; empty if none solved it
  double fastest_seconds = std::numeric_limits<double>::quiet_NaN();

  [[nodiscard]] bool is_solved() const { return point.status == ReportStatus::kSolved; }
};

struct PageFacts {
  std::vector<ComparedPoint> points;
  std::vector<std::string> solvers;  // first those that solved the largest share, then the fastest

  // Its place in `solvers`: the style of its curves.
  [[nodiscard]] std::size_t place_of(const std::string& solver) const;
  [[nodiscard]] std::vector<const ComparedPoint*> of_solver(const std::string& solver) const;
};

[[nodiscard]] PageFacts page_facts(std::vector<PointSummary> points);

// The point of a solver that a reader should know of: what was not solved first, there the largest
// gap; else the largest ratio to the fastest. Null without points.
[[nodiscard]] const ComparedPoint* worst_of(const std::vector<const ComparedPoint*>& points);

// "robot, Q = 7920".
[[nodiscard]] std::string instance_name(const PointSummary& point);

// "1e-6".
[[nodiscard]] std::string gap_words(double gap);

// Cells that sort by the number behind their text; a dash where it is not finite.
[[nodiscard]] PageCell seconds_cell(double seconds);
[[nodiscard]] PageCell number_cell(double value, int digits = 3);
[[nodiscard]] PageCell count_cell(std::size_t count);
[[nodiscard]] PageCell status_cell(ReportStatus status);

}  // namespace graybox::bench
