// Pages and tables of designs, as commands write them.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "cli/arguments/design_output_arguments.hpp"
#include "diagnosis/design_page/design_page.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox::cli {

class DesignOutput {
 public:
  // `typed`: the command, as main has it. The clock starts here.
  DesignOutput(const DesignOutputArguments& arguments, const char* const* typed);

  // The robot to draw, read before anything runs; checks the coordinates of the set.
  void read_robot(const InformationSet& set);
  void set_robot(RobotModel robot) { robot_ = std::move(robot); }

  [[nodiscard]] bool has_page() const { return !arguments_.page.empty(); }
  [[nodiscard]] bool has_table() const { return !arguments_.format.empty(); }

  // Writes the page; `files` are what the design was made from.
  void write_page(DesignStory story, const std::vector<PageFile>& files) const;
  void print_table(const InformationSet& set, const DesignSchedule& schedule) const;
  // "wrote page.html", where there is a page.
  void say_page() const;
  // "wrote design.json", where it was asked for, and the page.
  void say_written(const std::string& design) const;

 private:
  const DesignOutputArguments& arguments_;
  const char* const* typed_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::optional<RobotModel> robot_;
};

}  // namespace graybox::cli
