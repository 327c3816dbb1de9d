// The memory that a control group (of a container, a batch system or `systemd-run`) leaves. Who
// takes more is killed, without an error to catch.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace graybox {

// The least, over the process's own group and all above it, of limit less use. Pages of files that
// the system can drop don't count as used. The largest number where no group has a limit. Both
// versions of control groups are read; `root` is where they are mounted, `membership` lists the
// process's groups.
[[nodiscard]] std::size_t control_group_room(const std::string& root = "/sys/fs/cgroup",
                                             const std::string& membership = "/proc/self/cgroup");

// The first number after the word `name` of a file in which the system tells of itself; the first
// word of all for an empty name. Nothing where there is no such file, no such word, or "max".
[[nodiscard]] std::optional<std::size_t> number_in_file(const std::string& file,
                                                        const std::string& name = {});

}  // namespace graybox
