// The hypotheses of a balance of forces: each law of the catalogue at each place, and which values
// of its parameters can be.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Whether the only joint stood still under forces that differ by much.
[[nodiscard]] bool tells_standing(const ForceBalanceData& data);

class BalanceHypotheses {
 public:
  explicit BalanceHypotheses(const ForceBalanceData& data);  // which must outlive it

  [[nodiscard]] std::span<const Hypothesis> all() const { return hypotheses_; }
  [[nodiscard]] const Hypothesis& operator[](std::size_t hypothesis) const {
    return hypotheses_[hypothesis];
  }
  [[nodiscard]] const LawEntry& entry(std::size_t hypothesis) const {
    return *entries_[hypothesis];
  }
  [[nodiscard]] const CandidatePlace& place(std::size_t hypothesis) const {
    return data_.places[place_of_[hypothesis]];
  }
  // How the place moves.
  [[nodiscard]] const MotionScale& scale(std::size_t hypothesis) const {
    return scales_[place_of_[hypothesis]];
  }

  // The law with these parameters. `inverse_gains`: 1/gain of each joint's drive where these are
  // unknown.
  [[nodiscard]] PlacedLaw placed(std::size_t hypothesis, std::vector<double> parameters,
                                 const Eigen::VectorXd& inverse_gains) const;

  // Why a law with these parameters can't be there; empty if it can.
  [[nodiscard]] std::string trouble_with(const PlacedLaw& law) const;

 private:
  [[nodiscard]] const MotionScale& scale_of(const PlacedLaw& law) const;
  [[nodiscard]] bool slides(const PlacedLaw& law) const;
  [[nodiscard]] bool comes_back(const PlacedLaw& law) const;
  [[nodiscard]] bool is_shown(const PlacedLaw& law) const;
  [[nodiscard]] bool is_within_reach(const PlacedLaw& law) const;

  const ForceBalanceData& data_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const LawEntry*> entries_;
  std::vector<std::size_t> place_of_;
  std::vector<MotionScale> scales_;  // of each place
};

}  // namespace graybox
