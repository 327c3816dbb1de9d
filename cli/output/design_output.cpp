#include "cli/output/design_output.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "cli/output/command_line.hpp"
#include "diagnosis/design_page/robot_poses.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::cli {

DesignOutput::DesignOutput(const DesignOutputArguments& arguments, const char* const* typed)
    : arguments_(arguments), typed_(typed) {}

void DesignOutput::read_robot(const InformationSet& set) {
  if (arguments_.model.empty()) return;
  const std::filesystem::path file = arguments_.model == "default"
                                         ? default_robot_file()
                                         : std::filesystem::path(arguments_.model);
  robot_ = load_robot_without_elements(file);
  require_joint_angles(set, *robot_);
}

void DesignOutput::write_page(DesignStory story, const std::vector<PageFile>& files) const {
  if (!has_page()) return;
  if (robot_) story.robot = &*robot_;
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start_;
  write_text_file(arguments_.page, design_page(story, {.command = command_line(typed_),
                                                       .files = files,
                                                       .seconds = seconds.count()}));
}

void DesignOutput::print_table(const InformationSet& set, const DesignSchedule& schedule) const {
  fmt::print("{}", design_table(set, schedule, table_format(arguments_.format)));
}

void DesignOutput::say_page() const {
  if (has_page()) fmt::print("wrote {}\n", arguments_.page);
}

void DesignOutput::say_written(const std::string& design) const {
  if (!design.empty()) fmt::print("wrote {}\n", design);
  say_page();
}

}  // namespace graybox::cli
