#include "problems/base/program_version.hpp"

namespace graybox {
namespace {

std::string& stated_commit() {
  static std::string commit = "unknown";
  return commit;
}

}  // namespace

const char* program_version() { return GRAYBOX_VERSION; }

const std::string& program_commit() { return stated_commit(); }

void set_program_commit(const std::string& commit) {
  stated_commit() = commit.substr(0, commit.find_last_not_of(' ') + 1);
}

std::string written_by() {
  return "graybox " + std::string(program_version()) + " (commit " + program_commit() + ")";
}

}  // namespace graybox
