// Poses of a mechanism in three dimensions: lines through its joints over a floor, which poses.js
// turns. Each pose has a mark, a colour and a name, so that it is told apart in print as well.
//
// Seen from azimuth a and elevation e, without perspective. A point at (x, y, z) from the centre
// stands -sin a x + cos a y to the right, and -sin e (cos a x + sin a y) + cos e z up.
#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace graybox {

using ScenePoint = std::array<double, 3>;  // m; the third points up

struct DrawnPose {
  std::string name, words;
  double share = 1.0;              // its weight among all: how thick it is drawn
  std::vector<ScenePoint> points;  // base first
  std::size_t style = 0;           // as of PlotSeries
};

struct PosePicture {
  std::string id;  // of letters, digits and -, unique in the page
  std::string title, caption;
  std::vector<DrawnPose> poses;
};

[[nodiscard]] std::string pose_svg(const PosePicture& picture);

// What poses.js turns: points, the first view, centre and scale.
[[nodiscard]] nlohmann::ordered_json pose_json(const PosePicture& picture);

}  // namespace graybox
