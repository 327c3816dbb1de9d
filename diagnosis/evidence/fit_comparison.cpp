#include "diagnosis/evidence/fit_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/hypotheses/fit_physics.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

// On recordings kept out, of chi-square per degree of freedom over that of the fit (or one): a law
// that fits and predicts so badly only describes the recordings that it saw.
constexpr double kContradicted = 100.0;
// And how much larger than another's it must be there, for that one to take its place.
constexpr double kSpeaksForAnother = 10.0;

// Times the margin of exclusion: laws so far apart on the recordings of the fit are not asked what
// they make of others.
constexpr double kDecided = 10.0;

constexpr int kNoRank = -1;  // below those of Hypothesis

}  // namespace

double evidence(const ExtendedFit& fit) { return fit.deviance + fit.laws_information; }

double excess(const ExtendedFit& fit) {
  return fit.estimation.chi_square - fit.estimation.degrees_of_freedom;
}

HeldOutGain held_out_gain(const ExtendedFit& without, const ExtendedFit& with) {
  // Blocks whose parameters the others do not determine can't be predicted.
  if (!with.held_out.allFinite()) return {-std::numeric_limits<double>::infinity(), 0.0};
  if (!without.held_out.allFinite()) return {std::numeric_limits<double>::infinity(), 0.0};
  // Equal errors, zeros among them, gain nothing.
  const Eigen::ArrayXXd ratios = (without.held_out.array() == with.held_out.array())
                                     .select(1.0, without.held_out.array() / with.held_out.array());
  const Eigen::VectorXd gains = ratios.log().rowwise().sum();
  const auto blocks = static_cast<double>(gains.size());
  HeldOutGain result;
  result.mean = gains.mean();
  const double square = (gains.array() - result.mean).square().sum();
  result.standard_error = std::sqrt(square / (blocks - 1.0) / blocks);
  return result;
}

double practical_size_p_value(const Assessment& assessment, double tolerance) {
  if (!std::isfinite(assessment.chi_square)) return 0.0;
  return noncentral_chi_square_tail(assessment.chi_square, assessment.degrees_of_freedom,
                                    tolerance * assessment.degrees_of_freedom);
}

double FitComparison::bic(const ExtendedFit& fit) const {
  return fit.deviance +
         static_cast<double>(fit.parameter_count) * std::log(problem_->sample_count());
}

double FitComparison::criterion(const ExtendedFit& fit, const ExtendedFit& common) const {
  return problem_->noise_is_known() ? bic(fit) : -held_out_gain(common, fit).mean;
}

bool FitComparison::rest_is_noise(const ExtendedFit& fit) const {
  return problem_->noise_is_known() &&
         chi_square_tail(fit.estimation.chi_square, fit.estimation.degrees_of_freedom) >=
             options_->verification_level;
}

bool FitComparison::looks_like_noise(const std::optional<double>& structure,
                                     const std::optional<double>& autocorrelated_error) const {
  return structure.value_or(0.0) <= options_->structure_tolerance &&
         autocorrelated_error.value_or(0.0) <= options_->autocorrelation_tolerance;
}

bool FitComparison::significant(const ExtendedFit& without, const ExtendedFit& with) const {
  if (with.parameter_count <= without.parameter_count) return with.deviance < without.deviance;
  const double added = static_cast<double>(with.parameter_count - without.parameter_count);
  const double count = static_cast<double>(problem_->hypotheses().size());
  if (problem_->noise_is_known()) {
    return chi_square_tail(without.deviance - with.deviance, added) < options_->level / count;
  }
  return is_borne_out(without, with, with.laws.size() - 1);
}

bool FitComparison::is_borne_out(const ExtendedFit& without, const ExtendedFit& with,
                                 std::size_t law) const {
  return stands_by_itself(without, with, law) &&
         predicts_better(without, with, options_->held_out_errors);
}

bool FitComparison::is_missed(const ExtendedFit& without, const ExtendedFit& with) const {
  const double margin = without.laws.empty() ? 0.0 : options_->exclusion_margin;
  return bic(without) - bic(with) > margin;
}

bool FitComparison::stands_by_itself(const ExtendedFit& without, const ExtendedFit& with,
                                     std::size_t law) const {
  if (with.parameter_count <= without.parameter_count) return false;
  const double added = static_cast<double>(with.parameter_count - without.parameter_count);
  const double count = static_cast<double>(problem_->hypotheses().size());
  return chi_square_tail(with.laws[law].wald_statistic, added) < options_->level / count &&
         every_law_stands(with);
}

bool FitComparison::every_law_stands(const ExtendedFit& fit) const {
  return std::all_of(fit.laws.begin(), fit.laws.end(), [this](const FittedLaw& law) {
    return chi_square_tail(law.wald_statistic, static_cast<double>(law.parameters.size())) <
           options_->level;
  });
}

bool FitComparison::predicts_better(const ExtendedFit& without, const ExtendedFit& with,
                                    double errors) const {
  const HeldOutGain gain = held_out_gain(without, with);
  if (highest_rank_added(without, with) == kExpectedRank) {
    errors = std::min(errors, kExpectedErrors);
  }
  return gain.mean >= least_gain(without, with) && gain.mean > errors * gain.standard_error;
}

double FitComparison::least_gain(const ExtendedFit& without, const ExtendedFit& with) const {
  const bool is_rare = highest_rank_added(without, with) >= kRareRank;
  return is_rare ? options_->rare_gain : options_->held_out_gain;
}

int FitComparison::highest_rank_added(const ExtendedFit& without, const ExtendedFit& with) const {
  int highest = kNoRank;
  for (const FittedLaw& law : with.laws) {
    const auto count = [&law](const ExtendedFit& fit) {
      return std::ranges::count(fit.laws, law.hypothesis, &FittedLaw::hypothesis);
    };
    if (count(with) <= count(without)) continue;
    const int rank = problem_->hypotheses()[law.hypothesis].rank;
    const bool is_further_wave = count(without) > 0;  // of a law that is there: no longer rare
    highest = std::max(highest, is_further_wave ? std::min(rank, kRareRank - 1) : rank);
  }
  return highest;
}

double FitComparison::disadvantage(const ExtendedFit& fit, const ExtendedFit& reference) const {
  if (problem_->noise_is_known()) return bic(fit) - bic(reference);
  const HeldOutGain gain = held_out_gain(fit, reference);
  const double errors = gain.mean / std::max(gain.standard_error, 1e-300);
  return errors * std::abs(errors);
}

std::optional<double> FitComparison::held_out_difference(const ExtendedFit& fit,
                                                         const ExtendedFit& reference) const {
  if (!problem_->noise_is_known()) return {};
  if (std::abs(disadvantage(fit, reference)) > kDecided * options_->exclusion_margin) return {};
  const auto of_fit = problem_->predict_held_out(fit);
  const auto of_reference = problem_->predict_held_out(reference);
  if (!of_fit || !of_reference || !of_fit->cost || !of_reference->cost) return {};
  if (*of_fit->cost == *of_reference->cost) return 0.0;  // infinite, both
  return kHeldOutShare * (*of_fit->cost - *of_reference->cost);
}

double FitComparison::evidence_of_all(const ExtendedFit& fit, const ExtendedFit& reference) const {
  return evidence(fit) + held_out_difference(fit, reference).value_or(0.0);
}

bool FitComparison::excludes(const ExtendedFit& reference, const ExtendedFit& fit) const {
  if (!problem_->noise_is_known()) return predicts_better(fit, reference, kExclusionErrors);
  const double held_out = held_out_difference(fit, reference).value_or(0.0);
  return (disadvantage(fit, reference) + held_out > options_->exclusion_margin &&
          evidence(fit) - evidence(reference) + held_out > options_->exclusion_margin) ||
         contradicts(fit, reference);
}

bool FitComparison::keeps_its_place(const ExtendedFit& reference, std::size_t law,
                                    const ExtendedFit& fit) const {
  if (problem_->noise_is_known() ||
      std::ranges::all_of(reference.laws[law].parameters, is_determined)) {
    return excludes(reference, fit);
  }
  return predicts_better(fit, reference, options_->held_out_errors);
}

bool FitComparison::is_contradicted(const ExtendedFit& fit) const {
  const double limit = kContradicted * std::max(1.0, fit.estimation.chi_square_per_dof());
  const std::optional<Assessment> held_out = problem_->validate(fit);
  return held_out && held_out->chi_square_per_dof() > limit &&
         problem_->predict_held_out(fit)->within_errors.chi_square_per_dof() > limit;
}

bool FitComparison::contradicts(const ExtendedFit& fit, const ExtendedFit& other) const {
  if (!is_contradicted(fit) || is_contradicted(other)) return false;
  return problem_->validate(fit)->chi_square_per_dof() >
         kSpeaksForAnother * problem_->validate(other)->chi_square_per_dof();
}

}  // namespace graybox
