// Runs the real binary with a terminal for its standard error, for tests of progress.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <thread>

#include "tests/support/command_runner.hpp"

namespace graybox::testing {

// A pseudo-terminal, read by a thread of its own so that no writer waits.
class Terminal {
 public:
  Terminal() : master_(posix_openpt(O_RDWR | O_NOCTTY)) {
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) return;
    char name[256];
    if (ptsname_r(master_, name, sizeof name) != 0) return;
    name_ = name;
    slave_ = open(name, O_RDWR | O_NOCTTY);  // or reading ends before the command has begun
    if (slave_ < 0) return;
    reader_ = std::thread([this] {
      char text[4096];
      for (ssize_t n = 0; (n = read(master_, text, sizeof text)) > 0;) {
        shown_.append(text, static_cast<std::size_t>(n));
      }
    });
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal() {
    static_cast<void>(shown());
    if (master_ >= 0) close(master_);
  }

  [[nodiscard]] bool works() const { return reader_.joinable(); }
  [[nodiscard]] const std::string& name() const { return name_; }
  // All that was written to it; nothing may be written afterwards.
  const std::string& shown() {
    if (reader_.joinable()) {
      close(slave_);
      reader_.join();
    }
    return shown_;
  }

 private:
  int master_ = -1, slave_ = -1;
  std::string name_, shown_;
  std::thread reader_;
};

class TerminalRunner : public CommandRunner {
 protected:
  // As graybox(), but `err` is what a user at a terminal sees there.
  Outcome at_terminal(const std::string& arguments, const std::string& before = {}) {
    Terminal terminal;
    if (!terminal.works()) {
      ADD_FAILURE() << "no pseudo-terminal";
      return {};
    }
    const std::string command = "cd '" + folder_.file("") + "' && " + before + " '" +
                                built_executable("bin/graybox") + "' " + arguments + " >'" +
                                logs_.file("out") + "' 2>'" + terminal.name() + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(logs_.file("out")),
            terminal.shown()};
  }
};

}  // namespace graybox::testing
