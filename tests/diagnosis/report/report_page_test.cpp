// Pages of reports and what they show: data, texts, pictures. tests/report_page_test.py looks at
// them in a browser.
#include "diagnosis/report/html_page.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "diagnosis/report/trace.hpp"
#include "diagnosis/verdict/curve_traces.hpp"
#include "diagnosis/verdict/residual_maps.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

Trace long_trace(std::size_t samples) {
  Random random(3);
  Trace trace{"run.csv", "speed", "rad/s", true, "", {}, {{"measured", {}}, {"predicted", {}}}};
  for (std::size_t i = 0; i < samples; ++i) {
    trace.time.push_back(0.001 * static_cast<double>(i));
    trace.series[0].values.push_back(random.normal());
    trace.series[1].values.push_back(random.normal());
  }
  return trace;
}

// The data of a page, as page.js reads them.
Json data_of(const std::string& page) {
  const std::string opening = "<script type=\"application/json\" id=\"data\">";
  const std::size_t from = page.find(opening) + opening.size();
  return Json::parse(page.substr(from, page.find("</script>", from) - from));
}

TEST(TraceThinning, KeepsPeaksAndEverySampleThatItKeepsWasMeasured) {
  Trace trace = long_trace(100'000);
  trace.series[0].values[41'234] = 50.0;
  trace.series[1].values[77'777] = -60.0;
  const std::vector<std::size_t> kept = thinned_samples(trace, 2000);
  EXPECT_LE(kept.size(), 2000U);
  EXPECT_GT(kept.size(), 1000U);
  EXPECT_TRUE(std::ranges::is_sorted(kept));
  EXPECT_EQ(std::set<std::size_t>(kept.begin(), kept.end()).size(), kept.size());
  EXPECT_TRUE(std::ranges::binary_search(kept, 41'234U));
  EXPECT_TRUE(std::ranges::binary_search(kept, 77'777U));
  // In every hundredth of the trace both extremes of both series.
  for (std::size_t part = 0; part < 100; ++part) {
    for (const TraceSeries& series : trace.series) {
      const auto first = series.values.begin() + static_cast<std::ptrdiff_t>(1000 * part);
      const auto largest =
          static_cast<std::size_t>(std::max_element(first, first + 1000) - series.values.begin());
      EXPECT_TRUE(std::ranges::binary_search(kept, largest)) << part;
    }
  }
}

TEST(TraceThinning, LeavesShortTracesAndGapsAlone) {
  Trace trace = long_trace(50);
  EXPECT_EQ(thinned_samples(trace, 50).size(), 50U);
  trace = long_trace(10'000);
  for (double& value : trace.series[1].values) value = std::nan("");
  const Json rows = traces_json({trace}, 1000).at("traces").at(0).at("rows");
  ASSERT_FALSE(rows.empty());
  for (const Json& row : rows) EXPECT_TRUE(row.at(2).is_null());
}

TEST(ReportPage, HoldsTheMeasuredSamplesAsData) {
  const Trace trace = long_trace(500);
  ReportPage page;
  page.title = "</title><script>";
  page.sections.push_back({.id = "traces", .title = "Traces", .has_traces = true});
  page.traces = {trace};
  page.traces[0].recording = "</script><b>.csv";
  const std::string html = html_page(page);
  EXPECT_EQ(html.find("</title><script>"), std::string::npos);
  EXPECT_EQ(html.find("<b>.csv"), std::string::npos);
  const Json data = data_of(html).at("traces").at(0);
  EXPECT_EQ(data.at("recording"), "</script><b>.csv");
  ASSERT_EQ(data.at("rows").size(), 500U);
  for (std::size_t i = 0; i < 500; ++i) {
    const Json& row = data.at("rows").at(i);
    EXPECT_NEAR(row.at(1).get<double>(), trace.series[0].values[i],
                1e-5 * std::abs(trace.series[0].values[i]));
  }
}

// A page of the longest campaign that is shown stays below what a mail takes.
TEST(ReportPage, StaysBelowThreeMegabytes) {
  ReportPage page;
  page.sections.push_back({.id = "traces", .title = "Traces", .has_traces = true});
  for (int t = 0; t < 48; ++t) {
    Trace trace = long_trace(20'000);
    trace.series.push_back({"predicted after", trace.series[1].values});
    page.traces.push_back(std::move(trace));
  }
  EXPECT_LT(html_page(page).size(), 3'000'000U);
}

TEST(ReportPage, IsReadWithoutColoursAndWithoutAScript) {
  ReportPage page;
  page.title = "Test";
  PageSection section{.id = "tests", .title = "Tests"};
  section.tables.push_back({"Tests",
                            {{"test"}, {"result"}},
                            {{{"first"}, {"passed", {}, PageMark::kPassed}},
                             {{"second"}, {"failed", "look", PageMark::kFailed}}}});
  page.sections = {section};
  const std::string html = html_page(page);
  EXPECT_NE(html.find("✓</span> passed</span>"), std::string::npos);
  EXPECT_NE(html.find("✗</span> failed</span><br><small>look"), std::string::npos);
  EXPECT_EQ(html.find("<script"), std::string::npos);  // nothing to draw
  EXPECT_EQ(html.find("src="), std::string::npos);
}

ResidualCurve made_curve(bool held_out) {
  Random random(5);
  ResidualCurve curve;
  curve.channel = "speed";
  curve.unit = "rad/s";
  curve.experiment = "run_2.csv";
  curve.over_time = true;
  curve.held_out = held_out;
  for (int t = 0; t < 2000; ++t) {
    curve.axis.push_back(0.01 * t);
    curve.measured.push_back(3.0 + std::sin(0.05 * t));
    curve.residual.push_back(t < 200 ? std::nan("") : 0.1 * random.normal());
  }
  return curve;
}

TEST(DiagnosisTraces, ArePredictionsWhoseErrorIsTheOneThatIsSaid) {
  Diagnosis diagnosis;
  diagnosis.curves_before = {made_curve(true)};
  diagnosis.curves_after = diagnosis.curves_before;
  for (double& left : diagnosis.curves_after[0].residual) left *= 0.5;
  diagnosis.effects.resize(1);
  const std::vector<Trace> traces = diagnosis_traces(diagnosis);
  ASSERT_EQ(traces.size(), 1U);
  ASSERT_EQ(traces[0].series.size(), 3U);
  EXPECT_EQ(traces[0].series[0].values, diagnosis.curves_before[0].measured);
  const double before = curve_nrmse(diagnosis.curves_before[0]);
  // 0.1 over the deviation of a sine.
  EXPECT_NEAR(before, 100.0 * 0.1 * std::sqrt(2.0), 1.0);
  EXPECT_NEAR(curve_nrmse(diagnosis.curves_after[0]), 0.5 * before, 1e-9 * before);
  double square = 0.0, count = 0.0;
  for (std::size_t i = 0; i < traces[0].time.size(); ++i) {
    const double left = traces[0].series[0].values[i] - traces[0].series[2].values[i];
    if (std::isfinite(left)) square += left * left, count += 1.0;
  }
  EXPECT_NEAR(std::sqrt(square / count) / std::sqrt(0.5), 0.005 * before, 1e-3 * before);
  EXPECT_TRUE(traces[0].is_kept_out);
}

TEST(TimeMaps, HaveOneScaleBeforeAndAfterAndNumbersInTheCells) {
  Diagnosis diagnosis;
  diagnosis.curves_before = {made_curve(true)};
  diagnosis.curves_after = diagnosis.curves_before;
  for (double& left : diagnosis.curves_after[0].residual) left *= 0.01;
  diagnosis.effects.resize(1);
  const std::vector<ReportFigure> maps = time_maps(diagnosis);
  ASSERT_EQ(maps.size(), 2U);
  for (const ReportFigure& map : maps) {
    EXPECT_NE(map.svg.find("data-recording=\"krun_2.csv\""), std::string::npos);
    EXPECT_NE(map.svg.find("role=\"img\""), std::string::npos);
  }
  EXPECT_NE(maps[1].svg.find(">0.1</text>"), std::string::npos) << maps[1].svg;
}

}  // namespace
}  // namespace graybox
