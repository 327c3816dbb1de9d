#include "diagnosis/periodic/candidate_scores.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "diagnosis/harmonic_balance/place_observer.hpp"
#include "diagnosis/harmonic_balance/record_loop.hpp"
#include "diagnosis/hypotheses/score_test.hpp"
#include "diagnosis/periodic/candidate_products.hpp"
#include "diagnosis/periodic/periodic_assessment.hpp"
#include "diagnosis/periodic/periodic_shapes.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

std::map<const CandidatePlace*, MotionScale> motion_scales(const PlantFamily& family,
                                                           const PeriodicData& data,
                                                           const ModelState& model,
                                                           std::span<const HypotheticalLaw> asked,
                                                           bool follows_data, int threads) {
  constexpr Index kSamples = 48;  // of each recording
  std::map<const CandidatePlace*, MotionScale> scales;
  for (const HypotheticalLaw& law : asked) scales[law.place];
  std::vector<const CandidatePlace*> list;
  for (const auto& [place, scale] : scales) {
    if (!place->location.is_flange) list.push_back(place);
  }
  struct Values {
    VectorXd deflections, excursions, rates;
  };
  const std::size_t records = data.estimation.size();
  std::vector<std::vector<Values>> values(records);  // of each place
  std::vector<std::vector<double>> ranges(records);
  for_each_record(
      family, data, data.estimation, threads,
      [&](SteadyStateSolver& solver, const MeasuredRecord& record, std::size_t i, std::size_t) {
        solver.solve(model, record, nullptr);
        const PlaceObserver observer(solver, model, data, follows_data);
        MatrixXcd answer;
        PeriodicMotion motion;
        for (const CandidatePlace* place : list) {
          answer_at(solver, model, record, place->location, answer);
          VectorXcd deflection = observer.observe(record, place->location, answer).deflection;
          if (place->location.kind == LocationKind::kActuator) {
            deflection(0) +=
                solver.static_scale() *
                model.positions[record.position].plant.holding_input(place->location.channel);
          }
          solver.motion_of(deflection, motion);
          const Index step = std::max<Index>(1, motion.deflection.size() / kSamples);
          const auto samples = Eigen::seq(0, motion.deflection.size() - 1, step);
          const VectorXd excursion = motion.deflection.array() - motion.deflection.mean();
          values[i].push_back({motion.deflection(samples).cwiseAbs(), excursion(samples).cwiseAbs(),
                               motion.rate(samples).cwiseAbs()});
          ranges[i].push_back(motion.deflection.maxCoeff() - motion.deflection.minCoeff());
        }
      });
  for (std::size_t p = 0; p < list.size(); ++p) {
    MotionScale& scale = scales[list[p]];
    for (std::size_t i = 0; i < records; ++i) {
      const auto& [deflections, excursions, rates] = values[i][p];
      scale.deflections.insert(scale.deflections.end(), deflections.begin(), deflections.end());
      scale.excursions.insert(scale.excursions.end(), excursions.begin(), excursions.end());
      scale.rates.insert(scale.rates.end(), rates.begin(), rates.end());
      scale.range = std::max(scale.range, ranges[i][p]);
    }
    std::ranges::sort(scale.deflections);
    std::ranges::sort(scale.excursions);
    std::ranges::sort(scale.rates);
  }
  return scales;
}

std::vector<Candidate> list_candidates(const PeriodicData& data,
                                       std::span<const HypotheticalLaw> asked,
                                       const std::map<const CandidatePlace*, MotionScale>& scales) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const FrequencyBand band{data.frequencies[data.excited.front()] / kTurn,
                           data.frequencies[data.excited.back()] / kTurn};
  std::vector<Candidate> list;
  std::size_t column = 0;
  for (const HypotheticalLaw& law : asked) {
    Candidate candidate{law.hypothesis, law.place, law.entry, {}, column, 0};
    if (!list.empty()) {
      const Candidate& last = list.back();
      const bool is_same =
          last.place == candidate.place &&
          is_body(*last.place, *last.entry) == is_body(*candidate.place, *candidate.entry) &&
          may_follow_data(*last.entry) == may_follow_data(*candidate.entry);
      candidate.block = last.block + (is_same ? 0 : 1);
    }
    candidate.shapes =
        periodic_shapes(*candidate.entry, *candidate.place, scales.at(candidate.place), band);
    for (const LawShape& shape : candidate.shapes) column += shape.basis.size();
    list.push_back(std::move(candidate));
  }
  return list;
}

// [position][column of body laws, in the candidates' order]
std::vector<std::vector<PlantChange>> body_changes(const PlantFamily& family,
                                                   const PeriodicData& data,
                                                   const ModelState& model,
                                                   const std::vector<Candidate>& list,
                                                   int threads) {
  std::vector<std::vector<PlantChange>> changes(data.positions.size());
  std::exception_ptr failure;
  std::mutex guard;
  const auto change = [&](std::size_t i) {
    const LinearPlant& plain = model.positions[i].plant;
    for (const Candidate& candidate : list) {
      if (!is_body(*candidate.place, *candidate.entry)) continue;
      for (const LawShape& shape : candidate.shapes) {
        std::vector<Element> bodies = model.bodies;
        Element& body = bodies.emplace_back();
        body.location = candidate.place->location;
        body.law_name = candidate.entry->name;
        body.use = candidate.entry->use;
        body.parameters = shape.basis.front();
        // The change is linear in the amplitude.
        const double small = 10.0 * small_change(plain, body, 1.0);
        body.parameters.front() *= small;
        const LinearPlant changed = family.plant(data.positions[i], model.parameters, bodies);
        changes[i].push_back(entries_of({(changed.mass - plain.mass) / small,
                                         {},
                                         (changed.stiffness - plain.stiffness) / small,
                                         (changed.rest - plain.rest) / small}));
      }
    }
  };
#pragma omp parallel for num_threads(threads) schedule(dynamic)
  for (std::size_t i = 0; i < changes.size(); ++i) {
    try {
      stop_if_requested();
      change(i);
    } catch (...) {  // an arm that finds no rest with such a body; it must not leave a thread
      const std::scoped_lock lock(guard);
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  return changes;
}

// The plant's parameters that go with these amplitudes, kept positive where they must be.
std::vector<double> parameters_with(const PlantFamily& family, const ModelState& model,
                                    const BlockSums& own, const MatrixXd& nuisance,
                                    const VectorXd& amplitudes) {
  const VectorXd change =
      solve_information(own.information, own.scores - nuisance.transpose() * amplitudes);
  std::vector<double> values;
  for (std::size_t p = 0; p < family.parameters().size(); ++p) {
    const double now = model.parameters(static_cast<Index>(p));
    const double then = now + change(static_cast<Index>(p));
    values.push_back(family.parameters()[p].positive ? std::clamp(then, 0.5 * now, 2.0 * now)
                                                     : then);
  }
  return values;
}

struct ShapeStart {
  double statistic = 0.0;
  int valley = -1;
  std::vector<double> parameters;
};

// The best few besides, each of another valley.
std::vector<std::vector<double>> other_starts(std::vector<ShapeStart> starts,
                                              const std::vector<double>& best) {
  constexpr std::size_t kOthers = 7;
  std::ranges::stable_sort(starts, std::greater{}, &ShapeStart::statistic);
  std::set<int> valleys;
  for (const ShapeStart& start : starts) {
    if (start.parameters == best && start.valley >= 0) valleys.insert(start.valley);
  }
  std::vector<std::vector<double>> others;
  for (ShapeStart& start : starts) {
    const bool is_new =
        start.valley < 0 ? start.parameters != best : valleys.insert(start.valley).second;
    if (is_new && others.size() < kOthers) others.push_back(std::move(start.parameters));
  }
  return others;
}

// All that sums over recordings begin with.
CandidateSums empty_sums(const PlantFamily& family, const ModelState& model,
                         const std::vector<Candidate>& list, int null_draws) {
  CandidateSums empty;
  Index columns = 0;
  for (const Candidate& candidate : list) {
    for (const LawShape& shape : candidate.shapes) {
      const auto size = static_cast<Index>(shape.basis.size());
      empty.information.push_back(MatrixXd::Zero(size, size));
      columns += size;
    }
  }
  auto parameters = static_cast<Index>(family.parameters().size());
  for (const ActingLaw& law : model.laws) parameters += static_cast<Index>(law.parameters.size());
  empty.scores = MatrixXd::Zero(columns, 1 + null_draws);
  empty.nuisance = empty.moved_nuisance = MatrixXd::Zero(columns, parameters);
  const std::size_t blocks = list.empty() ? 0 : list.back().block + 1;
  empty.blocks.assign(blocks, {MatrixXd::Zero(parameters, parameters), VectorXd::Zero(parameters)});
  empty.own_information = MatrixXd::Zero(parameters, parameters);
  empty.own_scores = MatrixXd::Zero(parameters, 1 + null_draws);
  return empty;
}

CandidateSums sum_products(const PlantFamily& family, const PeriodicData& data,
                           const ModelState& model, const std::vector<Candidate>& list,
                           const CandidateScoreOptions& options) {
  const auto bodies = body_changes(family, data, model, list, options.threads);
  std::vector<CandidateSums> sums(kRecordChunks,
                                  empty_sums(family, model, list, options.null_draws));
  for_each_record(family, data, data.estimation, options.threads,
                  [&](SteadyStateSolver& solver, const MeasuredRecord& record, std::size_t i,
                      std::size_t chunk) {
                    solver.solve(model, record, nullptr);
                    NoiseDraws draws(data, record.group, options.null_draws, options.seed, i);
                    add_products(family, data, model, solver, record, options.follows_data, list,
                                 bodies[record.position], std::move(draws), sums[chunk]);
                  });
  for (std::size_t chunk = 1; chunk < kRecordChunks; ++chunk) sums.front().add(sums[chunk]);
  return std::move(sums.front());
}

// The tests under the motion of each block, and what the parameters explain there beyond the fit.
struct BlockTests {
  std::vector<ScoreTest> tests;
  std::vector<double> by_parameters;
};

BlockTests tests_of(const std::vector<BlockSums>& blocks) {
  BlockTests result;
  for (const BlockSums& block : blocks) {
    result.tests.emplace_back(NuisanceProducts{block.information, block.scores});
    result.by_parameters.push_back(
        block.scores.dot(solve_information(block.information, block.scores).col(0)));
  }
  return result;
}

// Of one law: the shape with the largest statistic, and where fits may start.
class ShapeChoice {
 public:
  ShapeChoice(const Candidate& candidate, const ScoreTest& test, double by_parameters)
      : candidate_(candidate), test_(test), by_parameters_(by_parameters) {
    best_.start.hypothesis = candidate.hypothesis;
    best_.shapes = candidate.shapes.size();
    best_.amplitude_unit =
        unit_at(candidate.entry->parameters.front().unit, candidate.place->location.units);
  }

  // Whether it is the best so far, and a fit may start there.
  bool try_shape(const LawShape& shape, const CandidateProducts& products) {
    const CandidateScore score = test_.score(products);
    if (score.degrees_of_freedom == 0.0) return false;
    const std::vector<double> start = shape.parameters(score.amplitudes);
    if (!start.empty()) starts_.push_back({score.statistic, shape.valley, start});
    const double statistic = score.statistic + by_parameters_;
    const bool is_better =
        best_.start.parameters.empty() ||
        (!start.empty() && statistic + shape.head_start > best_.score.statistic + head_start_);
    if (!is_better) return false;
    best_.amplitude = score.amplitudes(0);
    best_.amplitude_deviation = std::sqrt(score.amplitude_covariance(0, 0));
    if (start.empty()) return false;  // the sign that it found is impossible
    head_start_ = shape.head_start;
    best_.score = score;
    best_.score.statistic = statistic;
    best_.start.parameters = start;
    return true;
  }

  HypothesisScore& best() { return best_; }

  HypothesisScore finish(double deviance) {
    (has_many_valleys(*candidate_.entry) ? best_.start.others : best_.start.spares) =
        other_starts(std::move(starts_), best_.start.parameters);
    best_.explained_share = deviance > 0.0 ? std::min(1.0, best_.score.statistic / deviance) : 0.0;
    return std::move(best_);
  }

 private:
  const Candidate& candidate_;
  const ScoreTest& test_;
  double by_parameters_;
  HypothesisScore best_;
  double head_start_ = 0.0;  // of the best
  std::vector<ShapeStart> starts_;
};

}  // namespace

ScoreTable score_candidates(const PlantFamily& family, const PeriodicData& data,
                            const ModelState& model, std::span<const HypotheticalLaw> laws,
                            const CandidateScoreOptions& options) {
  const std::vector<Candidate> list = list_candidates(
      data, laws, motion_scales(family, data, model, laws, options.follows_data, options.threads));
  const CandidateSums total = sum_products(family, data, model, list, options);
  const ScoreTest null_test({total.own_information, total.own_scores});
  const BlockTests blocks = tests_of(total.blocks);
  ScoreTable table;
  table.null_minima.assign(static_cast<std::size_t>(options.null_draws), 1.0);
  std::size_t shape_index = 0;
  for (const Candidate& candidate : list) {
    ShapeChoice choice(candidate, blocks.tests[candidate.block],
                       blocks.by_parameters[candidate.block]);
    auto column = static_cast<Index>(candidate.first_column);
    for (const LawShape& shape : candidate.shapes) {
      const auto size = static_cast<Index>(shape.basis.size());
      CandidateProducts products{total.information[shape_index++],
                                 total.nuisance.middleRows(column, size),
                                 total.scores.middleRows(column, size)};
      const bool is_usable = products.information.allFinite() && products.nuisance.allFinite();
      if (is_usable && options.null_draws > 0) {
        null_test.lower_minimum_p_values(
            products, [&](const VectorXd& amplitudes) { return shape.allows(amplitudes); },
            table.null_minima);
      }
      products.nuisance = total.moved_nuisance.middleRows(column, size);
      products.scores = total.scores.col(0).segment(column, size);
      column += size;
      // A law that overflows, or leaves where it is defined, in some recording.
      if (!is_usable || !products.nuisance.allFinite() || !products.scores.allFinite()) continue;
      if (!choice.try_shape(shape, products)) continue;
      choice.best().start.model_parameters =
          parameters_with(family, model, total.blocks[candidate.block], products.nuisance,
                          choice.best().score.amplitudes);
    }
    table.scores.push_back(choice.finish(options.deviance));
  }
  return table;
}

}  // namespace graybox
