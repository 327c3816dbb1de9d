// Times in two columns, as ROS writes them: "header.stamp.sec" has whole seconds, and
// "header.stamp.nanosec" the rest. ROS 1 says "secs" and "nsecs".
//
// Seconds of the Unix epoch are counted from the midnight before the first, as those of stamps
// (time_stamp.hpp), since a double has no room for the nanoseconds beside them.
#pragma once

#include "diagnosis/recording_files/recording_file.hpp"

namespace graybox::formats {

// "X.sec" and "X.nanosec" become "X"; both must hold whole numbers, and the second less than one
// second. Where there is an X already, and for other columns, nothing changes.
void join_time_parts(RecordingFile& file);

}  // namespace graybox::formats
