#include "diagnosis/report/pose_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>

#include "diagnosis/report/comparison_plot.hpp"
#include "diagnosis/report/svg_chart.hpp"

namespace graybox {
namespace {

constexpr double kSceneWidth = 560, kSceneHeight = 460;
constexpr double kAzimuth = -55.0 * std::numbers::pi / 180.0;
constexpr double kElevation = 18.0 * std::numbers::pi / 180.0;
constexpr int kFloorLines = 4;  // on either side of the base

// What of the space is shown: a ball about its centre that holds all poses and the floor.
struct SceneView {
  ScenePoint centre{0.0, 0.0, 0.0};
  double scale = 1.0;  // pixels a metre
  double step = 0.5;   // of the floor's lines, m
};

SceneView view_of(const PosePicture& picture) {
  double reach = 0.1, low = 0.0, high = 0.0;
  for (const DrawnPose& pose : picture.poses) {
    for (const ScenePoint& point : pose.points) {
      reach = std::max(reach, std::hypot(point[0], point[1]));
      low = std::min(low, point[2]);
      high = std::max(high, point[2]);
    }
  }
  SceneView view;
  view.centre[2] = 0.5 * (low + high);
  const double power = std::pow(10.0, std::floor(std::log10(reach / kFloorLines)));
  view.step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power * kFloorLines < reach) continue;
    view.step = factor * power;
    break;
  }
  const double radius =
      std::hypot(std::numbers::sqrt2 * view.step * kFloorLines, 0.5 * (high - low));
  view.scale = 0.48 * std::min(kSceneWidth, kSceneHeight + 80.0) / radius;
  return view;
}

std::string screen_point(const SceneView& view, const ScenePoint& point) {
  const double x = point[0] - view.centre[0], y = point[1] - view.centre[1],
               z = point[2] - view.centre[2];
  const double right = -std::sin(kAzimuth) * x + std::cos(kAzimuth) * y;
  const double up = -std::sin(kElevation) * (std::cos(kAzimuth) * x + std::sin(kAzimuth) * y) +
                    std::cos(kElevation) * z;
  return fmt::format("{:.1f} {:.1f}", 0.5 * kSceneWidth + view.scale * right,
                     0.5 * kSceneHeight - view.scale * up);
}

std::vector<std::vector<ScenePoint>> floor_lines(const SceneView& view) {
  std::vector<std::vector<ScenePoint>> lines;
  const double edge = view.step * kFloorLines;
  for (int k = -kFloorLines; k <= kFloorLines; ++k) {
    const double at = view.step * k;
    lines.push_back({{at, -edge, 0.0}, {at, edge, 0.0}});
    lines.push_back({{-edge, at, 0.0}, {edge, at, 0.0}});
  }
  return lines;
}

struct SceneLabel {
  const char* text;
  ScenePoint at;
};

std::vector<SceneLabel> labels_of(const SceneView& view) {
  const double edge = view.step * (kFloorLines + 0.25);
  return {{"x", {edge, 0.0, 0.0}}, {"y", {0.0, edge, 0.0}}};
}

std::string points_attribute(const SceneView& view, const std::vector<ScenePoint>& points) {
  std::string text;
  for (const ScenePoint& point : points) {
    if (!text.empty()) text += ' ';
    text += screen_point(view, point);
  }
  return text;
}

std::string pose_group(const SceneView& view, const DrawnPose& pose, std::size_t number) {
  const double width = 1.2 + 5.0 * std::sqrt(std::clamp(pose.share, 0.0, 1.0));
  std::string svg = fmt::format(
      "<g data-series=\"{}\" data-pose=\"{}\" class=\"curve pose c{}\"><polyline class=\"line\" "
      "style=\"stroke-width:{:.1f}\" points=\"{}\"/>",
      html_escaped(pose.name), number, pose.style % 7, width, points_attribute(view, pose.points));
  for (const ScenePoint& point : pose.points) {
    svg += fmt::format(
        "<g class=\"joint\" transform=\"translate({})\"><circle r=\"{:.1f}\" "
        "class=\"hollow\"/></g>",
        screen_point(view, point), 0.4 * width + 1.6);
  }
  return svg + fmt::format("<g class=\"tip\" transform=\"translate({})\">{}</g></g>\n",
                           screen_point(view, pose.points.back()), series_mark(pose.style));
}

nlohmann::ordered_json points_json(const std::vector<ScenePoint>& points) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ScenePoint& point : points) {
    nlohmann::ordered_json& entry = list.emplace_back(nlohmann::ordered_json::array());
    for (const double value : point) {
      entry.push_back(std::strtod(fmt::format("{:.5f}", value).c_str(), nullptr));
    }
  }
  return list;
}

}  // namespace

std::string pose_svg(const PosePicture& picture) {
  const SceneView view = view_of(picture);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" "
      "height=\"{1:g}\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\" "
      "aria-label=\"Picture: {2}; {3} poses\" data-poses=\"{4}\">\n<g class=\"floor\">",
      kSceneWidth, kSceneHeight, html_escaped(picture.title), picture.poses.size(),
      html_escaped(picture.id));
  for (const auto& line : floor_lines(view)) {
    svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"#e0e0e0\"/>",
                       points_attribute(view, line));
  }
  for (const SceneLabel& label : labels_of(view)) {
    svg += fmt::format("<text transform=\"translate({})\" text-anchor=\"middle\">{}</text>",
                       screen_point(view, label.at), label.text);
  }
  svg += fmt::format(
      "</g>\n<text x=\"8\" y=\"18\" font-weight=\"bold\">{}</text>\n<text x=\"8\" y=\"36\">one "
      "square of the floor: {:g} m</text>\n",
      html_escaped(picture.title), view.step);
  for (std::size_t k = 0; k < picture.poses.size(); ++k) {
    svg += pose_group(view, picture.poses[k], k);
  }
  return svg + "</svg>\n";
}

nlohmann::ordered_json pose_json(const PosePicture& picture) {
  const SceneView view = view_of(picture);
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  for (const DrawnPose& pose : picture.poses) {
    poses.push_back({{"name", pose.name}, {"points", points_json(pose.points)}});
  }
  nlohmann::ordered_json floor = nlohmann::ordered_json::array();
  for (const auto& line : floor_lines(view)) floor.push_back(points_json(line));
  nlohmann::ordered_json labels = nlohmann::ordered_json::array();
  for (const SceneLabel& label : labels_of(view)) labels.push_back(points_json({label.at})[0]);
  return {{"id", picture.id},       {"azimuth", kAzimuth}, {"elevation", kElevation},
          {"centre", view.centre},  {"scale", view.scale}, {"width", kSceneWidth},
          {"height", kSceneHeight}, {"poses", poses},      {"floor", floor},
          {"labels", labels}};
}

}  // namespace graybox
