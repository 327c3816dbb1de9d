// Ctrl-C (or SIGTERM) once asks the running solver to stop and hand over its best design; a second
// time ends the program.
#pragma once

namespace graybox::cli {

void catch_interrupts();
[[nodiscard]] bool interrupted();

}  // namespace graybox::cli
