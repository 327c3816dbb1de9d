#include "bench/study_page/page_facts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "diagnosis/report/comparison_plot.hpp"

namespace graybox::bench {
namespace {

using Question = std::tuple<std::string, std::string, std::size_t, double>;

Question question_of(const PointSummary& point) {
  return {point.experiment, point.family, point.candidates, point.gap_asked};
}

// Shares of points not solved, then the mean logarithm of the time charged.
std::vector<std::string> in_order(const std::vector<PointSummary>& points) {
  struct Score {
    double points = 0.0, unsolved = 0.0, logarithms = 0.0;
  };
  std::map<std::string, Score> scores;
  for (const PointSummary& point : points) {
    Score& score = scores[point.solver];
    score.points += 1.0;
    score.unsolved += point.status == ReportStatus::kSolved ? 0.0 : 1.0;
    score.logarithms += std::log(std::max(point.charged_seconds, 1e-9));
  }
  std::vector<std::string> solvers;
  for (const auto& [name, score] : scores) solvers.push_back(name);
  std::ranges::stable_sort(solvers, {}, [&](const std::string& name) {
    const Score& score = scores.at(name);
    return std::pair(score.unsolved / score.points, score.logarithms / score.points);
  });
  return solvers;
}

}  // namespace

std::size_t PageFacts::place_of(const std::string& solver) const {
  return static_cast<std::size_t>(std::ranges::find(solvers, solver) - solvers.begin());
}

std::vector<const ComparedPoint*> PageFacts::of_solver(const std::string& solver) const {
  std::vector<const ComparedPoint*> own;
  for (const ComparedPoint& each : points) {
    if (each.point.solver == solver) own.push_back(&each);
  }
  return own;
}

PageFacts page_facts(std::vector<PointSummary> points) {
  std::map<Question, std::pair<double, std::string>> fastest;
  for (const PointSummary& point : points) {
    if (point.status != ReportStatus::kSolved) continue;
    const auto [at, is_new] =
        fastest.try_emplace(question_of(point), point.seconds.median, point.solver);
    if (!is_new && point.seconds.median < at->second.first) {
      at->second = {point.seconds.median, point.solver};
    }
  }
  PageFacts facts;
  facts.solvers = in_order(points);
  for (PointSummary& point : points) {
    ComparedPoint compared;
    if (const auto at = fastest.find(question_of(point)); at != fastest.end()) {
      compared.fastest_seconds = at->second.first;
      compared.fastest = at->second.second;
      if (point.status == ReportStatus::kSolved) {
        compared.ratio = point.seconds.median / at->second.first;
      }
    }
    compared.point = std::move(point);
    facts.points.push_back(std::move(compared));
  }
  return facts;
}

const ComparedPoint* worst_of(const std::vector<const ComparedPoint*>& points) {
  const auto rank = [](const ComparedPoint* each) {
    const double gap = std::isnan(each->point.checked_gap) ? std::numeric_limits<double>::infinity()
                                                           : each->point.checked_gap;
    return each->is_solved() ? std::pair(0, each->ratio) : std::pair(1, gap);
  };
  const auto worst = std::ranges::max_element(points, {}, rank);
  return worst == points.end() ? nullptr : *worst;
}

std::string instance_name(const PointSummary& point) {
  return fmt::format("{}, Q = {}", point.family, point.candidates);
}

std::string gap_words(double gap) {
  std::string words = fmt::format("{:.2g}", gap);
  const std::size_t zero = words.find("e-0");
  if (zero != std::string::npos) words.erase(zero + 2, 1);
  return words;
}

PageCell seconds_cell(double seconds) {
  if (!std::isfinite(seconds)) return {"–"};
  return {.text = plot_number(PlotNumber::kSeconds, seconds), .order = seconds};
}

PageCell number_cell(double value, int digits) {
  if (!std::isfinite(value)) return {"–"};
  const bool is_large = value >= 1e3 && value < 1e6;
  return {.text = is_large ? fmt::format("{:.0f}", value) : fmt::format("{:.{}g}", value, digits),
          .order = value};
}

PageCell count_cell(std::size_t count) {
  return {.text = std::to_string(count), .order = static_cast<double>(count)};
}

PageCell status_cell(ReportStatus status) {
  const bool is_solved = status == ReportStatus::kSolved;
  return {.text = std::string(to_string(status)),
          .mark = is_solved ? PageMark::kPassed : PageMark::kFailed};
}

}  // namespace graybox::bench
