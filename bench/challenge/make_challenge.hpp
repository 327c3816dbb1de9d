// Makes a challenge: draws and seals the truth, then simulates every case's recordings.
//
//   cases/challenge.json        number of cases and the seal of the truth, written first
//   cases/case_017/model.yaml   the model as the user believes it to be (and its URDF)
//   cases/case_017/campaign/    graybox-campaign/1: recordings for estimation and held-out ones, of
//                               other realisations, levels and positions
//   truth/index.json, case_017.json ...     seed and truth, for `score` alone
//
// What is in a case folder depends on its family, apart from numbers: same names, same sizes, all
// files of one age. Resumes: truths and case folders appear whole or not at all. The result depends
// on seed and number of cases alone.
//
// Cost: on the full robot 36 recordings of 20 s of a case and about as much again for the search of
// the smallest detectable size.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "bench/challenge/challenge_set.hpp"
#include "bench/challenge/seal.hpp"

namespace graybox::bench {

struct MakeOptions {
  ChallengeOrigin origin;  // its `set` is the name of the next
  const ChallengeSet* set = &periodic_set();
  std::filesystem::path cases, truth;
  int threads = 1;
  std::function<bool()> keep_going;                      // asked often, from any thread
  std::function<void(std::size_t, std::size_t)> report;  // steps done, of all (two for each case)
};

struct MakeOutcome {
  std::size_t cases = 0;
  bool complete = false;  // false: asked to stop
  std::string truth_sha256;
};

// Makes folder/campaign anew beside where `folder` will be, lets `fill` write into that folder, and
// gives it its name. False, and nothing left, where `fill` says so. Throws InputError.
bool write_whole_folder(const std::filesystem::path& folder,
                        const std::function<bool(const std::filesystem::path&)>& fill);

// Throws InputError where a folder can't be made, holds something else, or lies in the other.
MakeOutcome make_challenge(const MakeOptions& options);

// One case's folder of the periodic set, complete; also for tests. False where asked to stop.
bool write_case(const CaseTruth& truth, const std::filesystem::path& folder,
                const std::function<bool()>& keep_going = {});

}  // namespace graybox::bench
