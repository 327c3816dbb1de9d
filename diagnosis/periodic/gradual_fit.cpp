#include "diagnosis/periodic/gradual_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/harmonic_balance/noise_whitening.hpp"
#include "diagnosis/periodic/place_force_fit.hpp"
#include "diagnosis/periodic/telling_recordings.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Chi-square over numbers of recordings whose model may be wrong by a few thousandths, at which the
// right minimum has been found.
constexpr double kNear = 1.5;

// And at which there is none to be found from where it began.
constexpr double kHopeless = 10.0;

// Above the first and below this a fit may have stopped in a valley beside the right one, some per
// cent away in parameters that change the same resonances: so many starts around it, so far (in the
// logarithm), are tried. Models of fewer parameters have no such valleys.
constexpr double kBeside = 3.0;
constexpr int kStartsAround = 4;
constexpr Index kManyParameters = 8;
constexpr double kAround = 0.1;

// Of the power of a force that was seen: a law that leaves more is not what acts there.
constexpr double kMostLeft = 0.25;

constexpr double kNever = std::numeric_limits<double>::infinity();

// Rough fits to few recordings, on the way to a fit to all.
class Approach {
 public:
  Approach(const PlantFamily& family, const PeriodicData& data,
           const std::vector<std::size_t>& telling, const PeriodicFitOptions& options,
           double hopeless)
      : family_(family),
        data_(data),
        few_(with_records(data, telling)),
        options_(options),
        hopeless_(hopeless) {
    options_.iteration_limit = std::min(15, options.iteration_limit);
    options_.tolerance = 1e-3;
    count_ = few_.numbers_in(few_.estimation);
    if (options.freed != nullptr) count_ *= share_beside_freed(data);
  }

  // The best of the starts on smooth data, or the first that comes near; a start whose chi-square
  // over numbers is above `hopeless` is not followed further.
  PeriodicFit from(const std::vector<VectorXd>& starts, const std::vector<ActingLaw>& laws,
                   const std::vector<double>& shares) {
    PeriodicFit best;
    best.chi_square = kNever;
    for (const VectorXd& start : starts) {
      PeriodicFit fit = down_from(start, laws, shares);
      if (fit.chi_square <= hopeless_ * count_ && is_better(fit, best)) {
        best = std::move(fit);
      }
      if (best.converged) break;
    }
    return best;
  }

 private:
  PeriodicFit down_from(const VectorXd& start, const std::vector<ActingLaw>& laws,
                        const std::vector<double>& shares) {
    PeriodicFit fit;
    fit.parameters = start;
    fit.laws = with_refinements_held(laws);
    const bool has_valleys =
        start.size() >= kManyParameters && hopeless_ < kNever && options_.freed == nullptr;
    for (const double share : shares) {
      few_.whitening = whitening_with_errors(data_, share);
      PeriodicFit next = fit_periodic(family_, few_, {fit.parameters}, fit.laws, options_);
      fit.chi_square = next.chi_square;
      if (next.parameters.size() > 0) fit = std::move(next);
      if (share == shares.front() && has_valleys) look_around(fit);
      if (!(fit.chi_square <= hopeless_ * count_)) break;
    }
    for (std::size_t l = 0; l < laws.size(); ++l) fit.laws[l].fixed = laws[l].fixed;
    fit.start = start;
    fit.converged = fit.has_steady_state && fit.chi_square < kNear * count_;
    return fit;
  }

  void look_around(PeriodicFit& fit) const {
    Random random(1);
    const VectorXd middle = fit.parameters;
    const std::vector<ActingLaw> laws = fit.laws;
    const auto is_beside = [this](double chi_square) {
      return chi_square > kNear * count_ && chi_square <= kBeside * count_;
    };
    for (int i = 0; i < kStartsAround && is_beside(fit.chi_square); ++i) {
      VectorXd start = middle;
      for (double& value : start) value *= std::exp(kAround * random.normal());
      PeriodicFit other = fit_periodic(family_, few_, {start}, laws, options_);
      if (other.parameters.size() > 0 && is_better(other, fit)) fit = std::move(other);
    }
  }

  // Nothing makes up for a steady state.
  static bool is_better(const PeriodicFit& fit, const PeriodicFit& than) {
    if (fit.has_steady_state != than.has_steady_state) return fit.has_steady_state;
    return fit.chi_square < than.chi_square;
  }

  const PlantFamily& family_;
  const PeriodicData& data_;
  PeriodicData few_;
  PeriodicFitOptions options_;
  double hopeless_;
  double count_ = 0.0;  // numbers in the few recordings
};

std::vector<std::size_t> telling_of(const PlantFamily& family, const PeriodicData& data,
                                    const VectorXd& start, const std::vector<ActingLaw>& laws,
                                    const PeriodicFitOptions& options) {
  if (!options.telling.empty()) return options.telling;
  return telling_recordings(family, data, start, laws, options.threads);
}

PeriodicFit come_near(const PlantFamily& family, const PeriodicData& data,
                      const std::vector<VectorXd>& starts, const std::vector<ActingLaw>& laws,
                      const std::vector<double>& shares, const PeriodicFitOptions& options,
                      double hopeless) {
  return Approach(family, data, telling_of(family, data, starts.front(), laws, options), options,
                  hopeless)
      .from(starts, laws, shares);
}

PeriodicFit not_near(PeriodicFit fit) {
  fit.converged = false;
  fit.trouble = "no start comes near the data";
  return fit;
}

const std::vector<double> kShares{0.3, 0.03, 0.003};
// Not to the last: what the transients were taken for was judged by a model that is far off.
const std::vector<double> kSharesFarOff{0.3, 0.03};

}  // namespace

bool has_refinements(const LawEntry& law) {
  return std::ranges::any_of(law.parameters, [](const LawParameter& parameter) {
    return parameter.if_absent.has_value();
  });
}

std::vector<ActingLaw> with_refinements_held(std::vector<ActingLaw> laws) {
  for (ActingLaw& law : laws) {
    law.fixed.resize(law.parameters.size(), false);
    for (std::size_t p = 0; p < law.parameters.size(); ++p) {
      if (law.entry->parameters[p].if_absent) law.fixed[p] = true;
    }
  }
  return laws;
}

PeriodicFit fit_periodic_gradually(const PlantFamily& family, const PeriodicData& data,
                                   const std::vector<VectorXd>& starts,
                                   const std::vector<ActingLaw>& laws,
                                   const PeriodicFitOptions& options) {
  const PeriodicFit near = come_near(family, data, starts, laws, kShares, options, kNever);
  if (near.parameters.size() == 0) return fit_periodic(family, data, starts, laws, options);
  PeriodicFit result = fit_periodic(family, data, {near.parameters}, near.laws, options);
  result.start = near.start;
  return result;
}

PeriodicFit fit_periodic_if_near(const PlantFamily& family, const PeriodicData& data,
                                 const std::vector<VectorXd>& starts,
                                 const std::vector<ActingLaw>& laws,
                                 const PeriodicFitOptions& options) {
  PeriodicFit near = come_near(family, data, starts, laws, kShares, options, kHopeless);
  if (!near.converged) return not_near(std::move(near));
  PeriodicFit result = fit_periodic(family, data, {near.parameters}, near.laws, options);
  result.start = near.start;
  return result;
}

bool can_free(const PeriodicData& data, const ActingLaw& law) {
  const Location& place = law.place->location;
  const bool couples = place.kind == LocationKind::kElement && place.input != place.output;
  return data.outputs.size() > 1 && !couples && !is_body(*law.place, *law.entry);
}

PeriodicFit freed_fit(const PlantFamily& family, const PeriodicData& data,
                      const std::vector<VectorXd>& starts, const std::vector<ActingLaw>& others,
                      const Location& place, const PeriodicFitOptions& options) {
  PeriodicFitOptions how = options;
  how.freed = &place;
  how.telling = first_of_each_kind(data, telling_of(family, data, starts.front(), others, options));
  PeriodicFit fit = come_near(family, data, starts, others, kSharesFarOff, how, kHopeless);
  return fit.converged ? fit : not_near(std::move(fit));
}

PeriodicFit fit_periodic_after_freed(const PlantFamily& family, const PeriodicData& data,
                                     const PeriodicFit& freed, const ActingLaw& law,
                                     const PeriodicFitOptions& options) {
  VectorXd start = freed.parameters;
  std::vector<ActingLaw> laws = freed.laws;
  laws.push_back(law);
  if (law.place->location.kind == LocationKind::kElement) {
    const PeriodicData few = with_records(
        data, first_of_each_kind(data, telling_of(family, data, freed.parameters, laws, options)));
    const PlaceForceFit force = fit_place_force(family, few, freed, law);
    if (!force.usable || force.left > kMostLeft) return not_near({});
    start = force.parameters;
    laws.back() = force.law;
  }
  PeriodicFit near = come_near(family, data, {start}, laws, kSharesFarOff, options, kHopeless);
  if (!near.converged) return not_near(std::move(near));
  PeriodicFit result = fit_periodic(family, data, {near.parameters}, near.laws, options);
  result.start = near.start;
  return result;
}

}  // namespace graybox
