// The few recordings of a large campaign that tell most of what all of them tell. They serve where
// only a rough answer is wanted (to come near, to see that a law is far behind another). There the
// rest would cost time and say the same.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {

// Positions among the telling recordings, at most, and how many recordings of those there are, or
// about.
constexpr std::size_t kTellingPositions = 3;
constexpr std::size_t kTellingRecordings = 30;

// Indices of estimation records, ascending: at all positions, if they are that few, the first of
// each level and set of moving inputs; else at some positions of each such kind as many. Positions
// are added one by one, each the one that raises
//     log det(ridge + sum_i H_i)
// most, H_i the information of position i on the model's parameters at the given ones, scaled to
// the unit diagonal of all together (greedy D-optimal design: Fedorov 1972). Cost: one steady state
// and its derivatives for each record, if there are more positions than that.
[[nodiscard]] std::vector<std::size_t> telling_recordings(const PlantFamily& family,
                                                          const PeriodicData& data,
                                                          const Eigen::VectorXd& parameters,
                                                          const std::vector<ActingLaw>& laws,
                                                          int threads);

// Of those recordings the first of each position, level and set of moving inputs.
[[nodiscard]] std::vector<std::size_t> first_of_each_kind(const PeriodicData& data,
                                                          const std::vector<std::size_t>& records);

// The data with no other records, none of them kept out.
[[nodiscard]] PeriodicData with_records(const PeriodicData& data,
                                        const std::vector<std::size_t>& records);

}  // namespace graybox
