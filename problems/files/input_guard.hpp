// Inputs that no output of the same command may replace: `graybox solve a.h5 -o a.h5` would lose
// a.h5. Readers note the files that they open; AtomicFile asks before it replaces one. Files are
// told apart by device and inode, so that another spelling or a link makes no difference.
//
// Off until protect_inputs() is called: a program that uses the library may rewrite what it has
// read.
#pragma once

#include <sys/stat.h>

#include <string>

namespace graybox {

// Called once by the commands.
void protect_inputs();

// A reader has opened this file as an input. Files that aren't there or aren't regular don't count.
void note_input(const std::string& path);
void note_input(const struct stat& file);

[[nodiscard]] bool is_protected_input(const struct stat& file);

}  // namespace graybox
