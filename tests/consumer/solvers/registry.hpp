// A user's own header, named as one of graybox: theirs and ours do not get in each other's way.
#pragma once

inline constexpr int kExperiments = 3;
