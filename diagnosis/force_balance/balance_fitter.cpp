#include "diagnosis/force_balance/balance_fitter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "diagnosis/force_balance/balance_uncertainty.hpp"
#include "diagnosis/force_balance/remaining_structure.hpp"
#include "diagnosis/force_balance_data/payload_tangent.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr int kGainRounds = 16;  // of fits that take the drives' gains from one another
constexpr double kGainTolerance = 1e-4;
constexpr int kNoiseRounds = 4;  // of refinements of shapes
// Largest ratio of a coordinate's noise to that before: of shapes in general, and of a payload's
// place, which hangs on it.
constexpr double kSettledNoise = 1.5;
constexpr double kSettledPlace = 1.1;

// Whether `nearby` has this law with these parameters.
bool is_fitted(const LawStart& start, const ExtendedFit* nearby) {
  if (nearby == nullptr) return false;
  return std::ranges::any_of(nearby->laws, [&start](const FittedLaw& law) {
    return law.hypothesis == start.hypothesis &&
           std::ranges::equal(law.parameters, start.parameters, {}, &LawParameterEstimate::value);
  });
}

bool are_same_payload(const PlacedLaw& one, const PlacedLaw& other) {
  const Eigen::VectorXd gains = one.inverse_gains - other.inverse_gains;
  const Eigen::Map<const Eigen::Vector4d> body(one.parameters.data());
  const Eigen::Map<const Eigen::Vector4d> other_body(other.parameters.data());
  return gains.lpNorm<Eigen::Infinity>() <=
             kGainTolerance * one.inverse_gains.lpNorm<Eigen::Infinity>() &&
         (body - other_body).norm() <= kGainTolerance * body.norm();
}

void set_amplitudes(std::vector<PlacedLaw>& laws, const Eigen::VectorXd& amplitudes) {
  Index at = 0;
  for (PlacedLaw& law : laws) {
    law.set_amplitudes(amplitudes.segment(at, law.amplitudes()));
    at += law.amplitudes();
  }
}

// The noise with these columns beside those of the fit, where the data tell them apart.
Eigen::VectorXd noise_beside(const BalanceRegression& regression, const BalanceFit& fitted,
                             std::vector<BalanceColumns> columns,
                             const std::vector<BalanceColumns>& more) {
  columns.insert(columns.end(), more.begin(), more.end());
  const BalanceFit beside = regression.fit(columns);
  return beside.full_rank ? beside.noise : fitted.noise;
}

}  // namespace

// Laws of given shapes, their amplitudes fitted where the data tell these apart.
struct BalanceFitter::AmplitudeFit {
  std::vector<PlacedLaw> laws;
  std::vector<BalanceColumns> columns;
  BalanceFit fitted;
  std::vector<double> inverse_gains;  // as ExtendedFit's
};

// The regression of one fit: that of the recordings, or about the payload that it begins with,
// where its force is over unknown gains.
class BalanceFitter::FitBalance {
 public:
  explicit FitBalance(const BalanceRegression& recorded) : regression_(&recorded) {}
  FitBalance(PayloadTangent tangent, const Eigen::VectorXd& noise)
      : tangent_(std::make_unique<PayloadTangent>(std::move(tangent))),
        own_(std::make_unique<BalanceRegression>(tangent_->rows, noise)),
        regression_(own_.get()) {}
  [[nodiscard]] const BalanceRegression& regression() const { return *regression_; }
  // Takes the gains that only the payload tells from the model's parameters.
  void part_gains(AmplitudeFit& fit) const {
    if (!tangent_ || tangent_->loaded.empty() || !fit.fitted.full_rank) return;
    const auto count = static_cast<Index>(tangent_->loaded.size());
    const Index model = fit.fitted.model.size() - count;
    fit.inverse_gains.assign(static_cast<std::size_t>(tangent_->rows.coordinates()), 0.0);
    for (Index k = 0; k < count; ++k) {
      const auto joint = static_cast<std::size_t>(tangent_->loaded[static_cast<std::size_t>(k)]);
      fit.inverse_gains[joint] = fit.fitted.model(model + k);
    }
    fit.fitted.model.conservativeResize(model);
  }

 private:
  std::unique_ptr<PayloadTangent> tangent_;
  std::unique_ptr<BalanceRegression> own_;
  const BalanceRegression* regression_;
};

BalanceFitter::BalanceFitter(const ForceBalanceData& data, const BalanceHypotheses& hypotheses,
                             std::function<bool()> keep_going)
    : data_(data),
      hypotheses_(hypotheses),
      keep_going_(std::move(keep_going)),
      regression_(data.estimation) {
  const BalanceFit first = regression_.fit({});
  first_inverse_gains_ = Eigen::VectorXd::Zero(static_cast<Index>(data_.gain_parameters.size()));
  for (Index j = 0; j < first_inverse_gains_.size(); ++j) {
    const Index parameter = data_.gain_parameters[static_cast<std::size_t>(j)];
    if (parameter >= 0) first_inverse_gains_(j) = first.model(parameter);
  }
  const Eigen::MatrixXd rest = unpredicted(data_.estimation, first.residuals);
  for (Index j = 0; j < coordinates(); ++j) {
    noises_.emplace_back(rest.col(j));
    const double moving =
        data_.estimation.counted(j) / static_cast<double>(data_.estimation.samples());
    effective_.push_back(is_idle(j) ? 0.0 : moving * noises_.back().effective_samples());
  }
}

double BalanceFitter::sample_count() const {
  double count = 0.0;
  for (const double each : effective_) count += each;
  return count;
}

ExtendedFit BalanceFitter::fit(std::span<const LawStart> starts, const ExtendedFit* nearby) const {
  std::vector<RefinedLaw> refined;
  const Eigen::VectorXd gains =
      nearby != nullptr && nearby->usable ? inverse_gains(*nearby) : first_inverse_gains_;
  for (const LawStart& start : starts) {
    refined.push_back({hypotheses_.placed(start.hypothesis, start.parameters, gains),
                       !is_fitted(start, nearby), &hypotheses_.scale(start.hypothesis), false});
  }
  hold_untouched(starts, nearby, refined);
  const std::vector<RefinedLaw> given = refined;
  ExtendedFit result = fit_refined(starts, refined, noise_of(nearby));
  settle_gains(starts, refined, result);
  // Without one of their number, laws that are known may leave their ranges; as they are they
  // remain.
  const bool is_stopped = keep_going_ && !keep_going_();
  if (!result.usable && !is_stopped && std::ranges::none_of(given, &RefinedLaw::is_new)) {
    const FitBalance balance = balance_of(given);
    ExtendedFit held = described(starts, with_amplitudes(balance, given));
    if (held.usable) return held;
  }
  return result;
}

bool BalanceFitter::acts_on(std::size_t hypothesis, const std::vector<bool>& coordinates) const {
  const std::vector<std::size_t>& own = hypotheses_[hypothesis].acts_on;
  return std::ranges::any_of(own, [&](std::size_t j) { return coordinates[j]; });
}

// A law that is added, left out or exchanged leaves the shapes of laws on other coordinates as
// they are: these share no more than the bodies' parameters, and nothing where every drive has a
// gain of its own. There the place of a payload is held, too, for which the gains would have to
// settle every time.
void BalanceFitter::hold_untouched(std::span<const LawStart> starts, const ExtendedFit* nearby,
                                   std::vector<RefinedLaw>& laws) const {
  if (nearby == nullptr) return;
  std::vector<bool> touched(static_cast<std::size_t>(coordinates()), false);
  bool is_any = false;
  const auto touch = [&](std::size_t hypothesis) {
    for (std::size_t j = 0; j < touched.size(); ++j) {
      const std::vector<std::size_t>& own = hypotheses_[hypothesis].acts_on;
      touched[j] = touched[j] || own.empty() || std::ranges::find(own, j) != own.end();
    }
    is_any = true;
  };
  for (std::size_t l = 0; l < laws.size(); ++l) {
    if (laws[l].is_new) touch(starts[l].hypothesis);
  }
  for (const FittedLaw& law : nearby->laws) {
    if (std::ranges::find(starts, law.hypothesis, &LawStart::hypothesis) == starts.end()) {
      touch(law.hypothesis);
    }
  }
  for (std::size_t l = 0; is_any && l < laws.size(); ++l) {
    const bool is_free_payload = hypotheses_[starts[l].hypothesis].acts_on.empty() &&
                                 !data_.robot.channels.unknown_drive_gains;
    laws[l].is_held =
        !laws[l].is_new && !is_free_payload && !acts_on(starts[l].hypothesis, touched);
  }
}

// What a fit leaves of each coordinate, root mean square.
Eigen::VectorXd BalanceFitter::noise_of(const ExtendedFit* fit) const {
  if (fit == nullptr || !fit->usable) return regression_.noise();
  return rms_of(data_.estimation, residuals(*fit, data_.estimation));
}

// Shapes and the noise that weighs the coordinates, in turn: a law that explains most of what one
// coordinate measures gives it a weight under which laws of several coordinates are others.
ExtendedFit BalanceFitter::fit_refined(std::span<const LawStart> starts,
                                       std::vector<RefinedLaw>& refined,
                                       Eigen::VectorXd noise) const {
  const FitBalance balance = balance_of(refined);
  const BalanceRegression& regression = balance.regression();
  for (int round = 1;; ++round) {
    const BalanceProjection projection(regression, noise);
    if (!refine_shapes(data_, projection, refined, keep_going_)) {
      ExtendedFit result;
      result.trouble = "the laws' shapes could not be refined";
      return result;
    }
    const AmplitudeFit fit = with_amplitudes(balance, refined);
    const bool has_shapes = std::ranges::any_of(
        refined, [](const RefinedLaw& law) { return !law.is_held && !law.law.refined().empty(); });
    if (!fit.fitted.full_rank || !has_shapes || coordinates() == 1 || round == kNoiseRounds) {
      return described(starts, fit);
    }
    const std::vector<BalanceColumns> places = payload_slopes(refined, fit);
    const Eigen::VectorXd next = places.empty()
                                     ? fit.fitted.noise
                                     : noise_beside(regression, fit.fitted, fit.columns, places);
    if (is_settled(noise, next, places.empty() ? kSettledNoise : kSettledPlace)) {
      return described(starts, fit);
    }
    noise = next;
    for (std::size_t l = 0; l < refined.size(); ++l) {
      refined[l].law = fit.laws[l];
      refined[l].is_new = false;
    }
  }
}

// A payload's place decides which coordinates it suits. With its slopes beside its mass the noise
// is that of the best place, as far as this is near.
std::vector<BalanceColumns> BalanceFitter::payload_slopes(const std::vector<RefinedLaw>& refined,
                                                          const AmplitudeFit& fit) const {
  std::vector<BalanceColumns> slopes;
  for (std::size_t l = 0; l < refined.size(); ++l) {
    const PlacedLaw& law = fit.laws[l];
    if (refined[l].is_held || law.entry->use != LawUse::kPayload) continue;
    slopes.push_back(law_slopes(law, law.refined(), data_, data_.estimation));
  }
  return slopes;
}

bool BalanceFitter::is_settled(const Eigen::VectorXd& noise, const Eigen::VectorXd& next,
                               double largest_ratio) const {
  for (Index j = 0; j < coordinates(); ++j) {
    const double change = std::abs(std::log(next(j) / noise(j)));
    if (!is_idle(j) && change > std::log(largest_ratio)) return false;
  }
  return true;
}

Eigen::VectorXd BalanceFitter::inverse_gains(const ExtendedFit& fit) const {
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(static_cast<Index>(data_.gain_parameters.size()));
  for (Index j = 0; j < gains.size(); ++j) {
    const Index parameter = data_.gain_parameters[static_cast<std::size_t>(j)];
    if (parameter >= 0) {
      gains(j) = fit.model_parameters[static_cast<std::size_t>(parameter)].value;
    } else if (!fit.inverse_gains.empty()) {
      gains(j) = fit.inverse_gains[static_cast<std::size_t>(j)];
    }
  }
  return gains;
}

// Where gains are unknown a payload's force is over them: fits about the payload and the gains
// that were found, until these stay. `result`: of the first of these fits.
void BalanceFitter::settle_gains(std::span<const LawStart> starts, std::vector<RefinedLaw>& laws,
                                 ExtendedFit& result) const {
  const bool is_asked = std::ranges::any_of(
      laws, [](const RefinedLaw& law) { return !law.is_held && law.law.inverse_gains.size() > 0; });
  for (int round = 1; is_asked && result.usable && round < kGainRounds; ++round) {
    bool is_settled = true;
    for (std::size_t l = 0; l < laws.size(); ++l) {
      const PlacedLaw used = std::exchange(laws[l].law, placed_of(result, result.laws[l]));
      is_settled = is_settled && (used.inverse_gains.size() == 0 ||
                                  (!laws[l].is_new && are_same_payload(used, laws[l].law)));
      laws[l].is_new = false;
    }
    if (is_settled) return;
    result = fit_refined(starts, laws, noise_of(&result));
  }
}

BalanceFitter::FitBalance BalanceFitter::balance_of(std::span<const RefinedLaw> laws) const {
  std::vector<PlacedLaw> payloads;
  for (const RefinedLaw& law : laws) {
    if (!law.is_new && law.law.inverse_gains.size() > 0) payloads.push_back(law.law);
  }
  if (payloads.empty()) return FitBalance(regression_);
  return {about_payloads(data_, payloads), regression_.noise()};
}

BalanceFitter::AmplitudeFit BalanceFitter::with_amplitudes(
    const FitBalance& balance, std::span<const RefinedLaw> refined) const {
  AmplitudeFit result;
  for (const RefinedLaw& law : refined) {
    result.laws.push_back(law.law);
    result.columns.push_back(law_columns(law.law, data_, data_.estimation));
  }
  result.fitted = balance.regression().fit(result.columns);
  if (result.fitted.full_rank) set_amplitudes(result.laws, result.fitted.amplitudes);
  balance.part_gains(result);
  return result;
}

ExtendedFit BalanceFitter::described(std::span<const LawStart> starts,
                                     const AmplitudeFit& fit) const {
  ExtendedFit result;
  if (!fit.fitted.full_rank) {
    result.trouble = "the data can't tell its parameters apart";
    return result;
  }
  for (std::size_t l = 0; l < fit.laws.size(); ++l) {
    const std::string trouble = hypotheses_.trouble_with(fit.laws[l]);
    if (trouble.empty()) continue;
    result.trouble = trouble;
    result.impossible.push_back(l);
  }
  if (!result.impossible.empty()) return result;
  result.usable = true;
  result.inverse_gains = fit.inverse_gains;
  describe(starts, fit, result);
  const std::vector<double> wald = wald_statistics(data_, fit.columns, fit.fitted);
  for (std::size_t l = 0; l < wald.size(); ++l) result.laws[l].wald_statistic = wald[l];
  return result;
}

void BalanceFitter::describe(std::span<const LawStart> starts, const AmplitudeFit& fit,
                             ExtendedFit& result) const {
  const std::vector<PlacedLaw>& laws = fit.laws;
  const BalanceFit& fitted = fit.fitted;
  const BalanceDeviations deviation = balance_deviations(data_, laws, fitted);
  for (Index k = 0; k < fitted.model.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    result.model_parameters.push_back({data_.parameter_names[at], data_.parameter_units[at],
                                       fitted.model(k), deviation.model(k)});
  }
  for (std::size_t l = 0; l < laws.size(); ++l) {
    const PlacedLaw& law = laws[l];
    std::vector<double> errors(law.parameters.size(), kUnknown);
    for (std::size_t k = 0; k < deviation.parameters.size(); ++k) {
      const LawColumn& column = deviation.parameters[k];
      if (column.law == l) errors[column.parameter] = deviation.of_parameters[k];
    }
    FittedLaw& described = result.laws.emplace_back();
    described.hypothesis = starts[l].hypothesis;
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      described.parameters.push_back(estimate_of(
          law.entry->parameters[i], law.place->location.units, law.parameters[i], errors[i]));
    }
  }
  result.parameter_count =
      static_cast<std::size_t>(fitted.model.size()) + deviation.parameters.size();
  for (Index j = 0; j < coordinates(); ++j) {
    result.deviance += effective_[static_cast<std::size_t>(j)] * 2.0 * std::log(fitted.noise(j));
  }
  result.estimation = assess(data_.estimation, fitted.residuals);
  result.held_out = fitted.held_out;
  for (Index j = 0; j < coordinates(); ++j) {
    if (is_idle(j)) result.held_out.col(j).setOnes();  // nothing to predict
  }
}

Eigen::MatrixXd BalanceFitter::residuals(const ExtendedFit& fit,
                                         const ForceBalanceRows& rows) const {
  Eigen::MatrixXd result = rows.force;
  const auto subtract = [&result](const BalanceColumns& columns, const Eigen::VectorXd& values) {
    for (Index j = 0; j < result.cols(); ++j) {
      const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
      if (own.size() > 0) result.col(j) -= own * values;
    }
  };
  Eigen::VectorXd model(static_cast<Index>(fit.model_parameters.size()));
  for (Index k = 0; k < model.size(); ++k) {
    model(k) = fit.model_parameters[static_cast<std::size_t>(k)].value;
  }
  subtract(rows.model, model);
  for (const FittedLaw& law : fit.laws) {
    subtract(law_force_column(placed_of(fit, law), data_, rows), Eigen::VectorXd::Ones(1));
  }
  return result;
}

PlacedLaw BalanceFitter::placed_of(const ExtendedFit& fit, const FittedLaw& law) const {
  return hypotheses_.placed(law.hypothesis, law.values(), inverse_gains(fit));
}

Assessment BalanceFitter::assess(const ForceBalanceRows& rows, const Eigen::MatrixXd& error) const {
  const double variance = centred_square(rows.measured);
  Assessment result;
  result.chi_square = (error * regression_.noise().cwiseInverse().asDiagonal()).squaredNorm();
  result.degrees_of_freedom = 0.0;
  for (Index j = 0; j < rows.coordinates(); ++j) result.degrees_of_freedom += rows.counted(j);
  result.nrmse = 100.0 * std::sqrt(error.squaredNorm() / variance);
  result.variance_accounted_for = 100.0 * (1.0 - centred_square(error) / variance);
  return result;
}

}  // namespace graybox
