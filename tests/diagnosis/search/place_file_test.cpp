// Places that users name in a file, for each kind of model.
#include "diagnosis/hypotheses/place_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/harmonic_balance/plant_family.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::TemporaryFolder;
using testing::write_text;

std::string with_places(const TemporaryFolder& folder, const std::string& places) {
  write_text(folder.file("places.yaml"), "format: graybox-places/1\nplaces:\n" + places);
  return folder.file("places.yaml");
}

TEST(PlaceFile, AddsCouplingsOfAFlexibleRobot) {
  const TemporaryFolder folder;
  const std::filesystem::path model = default_robot_file();
  const std::size_t own = plant_family(model)->places().size();
  const std::vector<std::filesystem::path> files{with_places(
      folder,
      "  - {kind: element, joint: joint_5, axis: motor, driven_by: {joint: joint_2, axis: motor}}\n"
      "  - kind: element\n    joint: joint_3\n    axis: arm\n    driven_by: {joint: joint_1, axis: "
      "arm}\n")};
  const auto family = plant_family(model, files);
  ASSERT_EQ(family->places().size(), own + 2);
  const CandidatePlace& wrist = family->places()[own];
  EXPECT_EQ(wrist.location.name, "joint_5.motor driven by joint_2.motor");
  EXPECT_TRUE(wrist.is_coupling && wrist.turns);
  EXPECT_FALSE(wrist.shifts_rest || wrist.location.takes_inertia);
  // As physics.yaml takes it: on one line, however it was written.
  const CandidatePlace& arm = family->places()[own + 1];
  EXPECT_EQ(arm.yaml.find('\n'), std::string::npos) << arm.yaml;
  EXPECT_NE(arm.yaml.find("driven_by: {joint: joint_1, axis: arm}"), std::string::npos) << arm.yaml;

  const std::vector<std::filesystem::path> twice{
      with_places(folder,
                  "  - {kind: element, joint: joint_2, axis: motor, driven_by: {joint: joint_1, "
                  "axis: motor}}\n")};
  EXPECT_THROW(static_cast<void>(plant_family(model, twice)), InputError);
}

TEST(PlaceFile, AddsCombinationsOfARigidRobotsJoints) {
  const TemporaryFolder folder;
  const RigidRobotModel robot =
      load_rigid_robot(GRAYBOX_SOURCE_DIR "/docs/examples/rigid/tx40.yaml");
  std::vector<CandidatePlace> places;
  const std::string& first = robot.joints[0].name;
  const std::string& third = robot.joints[2].name;
  add_places(
      with_places(folder, "  - {kind: element, deflection: {" + first + ": 1, " + third +
                              ": -2}}\n  - {kind: element, joint: " + third +
                              ", axis: arm, driven_by: {joint: " + first + ", axis: arm}}\n"),
      *rigid_robot_places(robot), places);
  ASSERT_EQ(places.size(), 2U);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(robot.size());
  b(0) = 1.0;
  b(2) = -2.0;
  EXPECT_EQ(places[0].location.input, b);
  EXPECT_FALSE(places[0].turns || places[0].is_coupling || places[0].location.takes_inertia);
  EXPECT_TRUE(places[1].turns && places[1].is_coupling);
}

}  // namespace
}  // namespace graybox
