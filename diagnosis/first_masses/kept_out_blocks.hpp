// How one log is split into what is fitted and what is kept out: halves, or alternating blocks
// where halves are not alike.
//
// Halves are not alike where one of them has less than a fiftieth of the drive's squares: the
// machine coasts there. The same holds for the motion's squares: it stands. So it does where a
// position goes less than a tenth of its way, however it trembles. Where nothing drives at all,
// the motion alone decides. And they are not where the axis goes one way in the first half and the
// other way in the second, or where the drive's frequency rises or falls along all quarters of the
// log, by 2.5 in all: a chirp. The frequency is counted by crossings of the mean. A slow sweep has
// few of them: there drive or motion turns round ever sooner, or ever later, by 1.5 in all, and
// goes as far each time. Nor are they where the axis turns round only once or twice in the whole
// log, which has both ways. Nor are they where one half hardly tells a mass, viscous and dry
// friction and a constant apart (steady motion): it has less than a fiftieth of what the log tells
// of one of them, or of a combination. Where the drive shows no mass beside friction in the whole
// log, a half is asked instead for a fifth of the samples of either way.
//
// A log of one transient is not split: its drive goes once from one level to another, or there and
// back, or stays at one, and the motion turns round twice at most. Turns that go less than a
// fifth of the whole way back are noise there.
//
// Else the log is cut into 4, 6, ... blocks, and every second one is kept out. Both roles must have
// a fifth of both squares and of the way, crossings alike within a half, and a fiftieth of what the
// log tells. The fewest blocks are taken that tell a quarter of what the best do. Blocks of a chirp
// hold a period of it on the average. Blocks have 40 samples at least, and 250 where the axis turns
// round only once or twice, and not between halves. A sweep through zero that is too short for six
// of them is cut into four, if both roles have a twentieth of the squares of either way.
// Cost: O(n) for each number of blocks.
//
// Several axes in one log, as a robot's, are split together: into as few blocks as give most axes
// their share, where that is more of them than halves do. Else halves stay. A chirp of one axis is
// no reason there: a rigid robot has no modes that one half alone would show. Nor is how often an
// axis turns round: several tell of the robot together.
//
//   const KeptOutBlocks split = kept_out_blocks(drive, position, false);
//   if (!split.reason.empty()) use(split.count);
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

namespace graybox {

struct KeptOutBlocks {
  Eigen::Index count = 2;  // of equal length, the first in the fit
  std::string reason;      // why no halves; empty: halves
  bool is_fair = true;     // false: no number of blocks gives both their share; count is 2
  std::size_t axis = 0;    // of several: the first whose halves are not alike
};

struct DrivenAxis {
  Eigen::VectorXd drive, position;  // without gaps
};

// Drive and motion of what is to be split, without gaps.
[[nodiscard]] KeptOutBlocks kept_out_blocks(const Eigen::VectorXd& drive,
                                            const Eigen::VectorXd& motion, bool is_velocity);

// `lost`: samples that a filter takes from each block.
[[nodiscard]] KeptOutBlocks kept_out_blocks(const std::vector<DrivenAxis>& axes, Eigen::Index lost);

}  // namespace graybox
