// ChildProcess: a program run beside this one, in its own process group, that never outlives it.
//
//   ChildProcess child({"sh", "-c", "exit 3"}, "log.txt");
//   while (child.running()) child.wait(0.02);  // or child.kill()
//   child.exit_code();   // 3
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace graybox {

class ChildProcess {
 public:
  // Starts arguments[0], found on PATH, with standard input empty and both outputs in the file
  // `log`. Throws InputError if no process can be made; a program that can't be run is one that
  // ends with exit code 127.
  ChildProcess(const std::vector<std::string>& arguments, const std::string& log);
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess();  // kills what is left of the group

  [[nodiscard]] bool running();
  // Returns as soon as the program ends, but after so many seconds at the latest. Where the system
  // can't tell of the end, it always takes that long.
  void wait(double seconds) const;
  void kill();  // the whole group, and waits for its leader

  // Once it has ended: the exit code, or minus the number of the signal that ended it.
  [[nodiscard]] int exit_code() const { return exit_code_; }

 private:
  void take_status(int status);

  pid_t process_ = -1;
  int end_ = -1;  // readable once the program has ended; -1 where there is no such thing
  bool ended_ = false;
  int exit_code_ = 0;
};

}  // namespace graybox
