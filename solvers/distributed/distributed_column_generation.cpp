#include "solvers/distributed/distributed_column_generation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/column_generation/well_conditioned_start.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/distributed/mpi_transfer.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/candidate_pricer.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"
#include "solvers/report/solve_report.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNegativeGap = 1e-9;   // less is rounding, which the checker judges
constexpr double kForgivenShare = 0.1;  // of the gap asked for that rounding may hide

// As of column_generation: a run leaves the set's own coordinates where rounding hides too much.
enum class Coordinates : std::int8_t { kOwn, kWhitened };

std::string rounding_message(double error) {
  return fmt::format("rounding hides up to {:.1e} of the gap", error);
}

// The packed matrix of a candidate, in either form of the set.
void copy_packed(const InformationSet& set, std::size_t candidate, std::span<double> out) {
  const auto packed = set.packed(candidate, out);
  if (packed.data() != out.data()) std::ranges::copy(packed, out.begin());
}

// What the first process asks of all.
enum Command : std::uint64_t { kPriceSlice, kPriceList, kFinish };

// One process's candidates. The list is the part with the largest sensitivities at the last pass.
// Candidates are priced in the form that the set holds, and travel as packed matrices.
class Slice {
 public:
  Slice(const InformationSet& set, std::size_t first_index, int threads)
      : set_(set),
        first_index_(first_index),
        threads_(threads),
        sensitivity_(set.candidate_count()) {}

  // Both return how many candidates were read. `numbers`: pricing_numbers().
  std::size_t price_all(std::span<const double> numbers) {
    constexpr std::size_t kPricedTogether = 4096;
    const std::size_t count = set_.candidate_count();
    const std::size_t chunks = (count + kPricedTogether - 1) / kPricedTogether;
#pragma omp parallel num_threads(threads_) if (threads_ > 1)
    {
      CandidatePricer pricer(set_, numbers);
#pragma omp for schedule(static)
      for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
        const std::size_t from = chunk * kPricedTogether;
        pricer.price(from, std::min(kPricedTogether, count - from), sensitivity_.data() + from);
      }
    }
    choose_list();
    return count;
  }

  std::size_t price_list(std::span<const double> numbers) {
    CandidatePricer(set_, numbers).price(list_, list_sensitivity_.data());
    return list_.size();
  }

  // Packs `wanted` candidates as records of (sensitivity, global index, packed matrix): the largest
  // of each of as many stretches, so that neighbours do not crowd one another out. Records of
  // sensitivity zero fill up.
  void best(Command priced, std::size_t wanted, std::vector<double>& records) const {
    const bool all = priced == kPriceSlice;
    const std::size_t count = all ? set_.candidate_count() : list_.size();
    const double* values = all ? sensitivity_.data() : list_sensitivity_.data();
    const std::size_t p = set_.packed_size();
    records.assign(wanted * (p + 2), 0.0);
    for (std::size_t k = 0; k < wanted; ++k) {
      const double* from = values + count * k / wanted;
      const double* to = values + count * (k + 1) / wanted;
      if (from == to) continue;
      const double* largest = std::max_element(from, to);
      const auto position = static_cast<std::size_t>(largest - values);
      const std::size_t candidate = all ? position : list_[position];
      double* record = records.data() + k * (p + 2);
      record[0] = *largest;
      record[1] = static_cast<double>(first_index_ + candidate);  // exact below 2^53
      copy_packed(set_, candidate, {record + 2, p});
    }
  }

 private:
  void choose_list() {
    const std::size_t count = set_.candidate_count();
    const std::size_t wanted = std::clamp(count / 64, std::size_t{512}, std::size_t{16384});
    const double threshold =
        count > 2 * wanted ? SensitivitySample(sensitivity_).exceeded_by(wanted) : -kInfinity;
    list_.clear();
    for (std::size_t k = 0; k < count; ++k) {
      if (sensitivity_[k] >= threshold) list_.push_back(k);
    }
    list_sensitivity_.resize(list_.size());
  }

  const InformationSet& set_;
  std::size_t first_index_;
  int threads_;
  std::vector<double> sensitivity_;
  std::vector<std::size_t> list_;
  std::vector<double> list_sensitivity_;
};

// Rows for the start: one candidate of each of so many stretches of the slice, its share of
// `wanted`, gathered on the first process.
std::vector<double> gather_sample(MPI_Comm communicator, const InformationSet& set,
                                  std::size_t first_index, std::size_t total, std::size_t wanted,
                                  Random& random) {
  const std::size_t p = set.packed_size(), own = set.candidate_count();
  const std::size_t count = std::min(own, (wanted * own + total - 1) / total + 1);
  std::vector<double> rows(count * (p + 1));
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t from = own * k / count, to = own * (k + 1) / count;
    const std::size_t i = from + random.below(to - from);
    rows[k * (p + 1)] = static_cast<double>(first_index + i);  // exact below 2^53
    copy_packed(set, i, {rows.data() + k * (p + 1) + 1, p});
  }
  return mpi::gather(communicator, rows);
}

// The sample as a set of its own, and the global index of each of its candidates.
struct Sample {
  InformationSet set;
  std::vector<std::size_t> indices;
};

Sample sample_of(const std::vector<double>& records, std::size_t dimension) {
  const std::size_t p = packed_size(dimension), count = records.size() / (p + 1);
  AlignedArray rows(count * p);
  std::vector<std::size_t> indices(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double* record = records.data() + k * (p + 1);
    indices[k] = static_cast<std::size_t>(record[0]);
    std::copy_n(record + 1, p, rows.begin() + k * p);
  }
  return {InformationSet(dimension, std::move(rows)), std::move(indices)};
}

// First working set: well conditioned, and solved roughly. False if the sample sees too few
// directions.
bool start(WorkingSet& working, const Sample& sample, const SolveOptions& options, Random& random) {
  Tracer unheard(sample.set, options, nullptr);  // the run counts passes over all slices
  WorkingSet chosen(sample.set.dimension());
  CandidatePool pool = sample_pool(sample.indices.size(), sample.indices.size(), random);
  if (!well_conditioned_start(sample.set, pool, random, unheard, chosen)) return false;
  working.clear();
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const std::size_t i = chosen.indices()[k];
    working.add(sample.indices[i], sample.set.information(i).data(), chosen.weights()[k]);
  }
  if (!working.refresh()) return false;
  working.optimise(0.03, 4);
  return true;
}

class Coordinator {
 public:
  Coordinator(MPI_Comm communicator, const InformationSet& set, std::size_t first_index,
              Coordinates coordinates, const SolveOptions& options, Tracer& tracer)
      : communicator_(communicator),
        set_(set),
        coordinates_(coordinates),
        options_(options),
        tracer_(tracer),
        slice_(set, first_index, options.threads),
        working_(set.dimension()),
        random_(options.seed + first_index),
        first_index_(first_index),
        wanted_(2 * set.dimension()),
        rank_(mpi::rank_of(communicator)),
        total_(mpi::sum(communicator, set.candidate_count())),
        numbers_(set.packed_size()) {}

  // The first process has the design and the status; publish() gives them to the others.
  DistributedDesign run() {
    if (!start_from_sample()) {
      set_status(SolveStatus::kUnsupported, "the sum of all information matrices is singular");
    } else if (rank_ == 0) {
      steer();
      share(kFinish);
    } else {
      follow();
    }
    return std::move(design_);
  }

 private:
  // Samples grow eightfold, to the whole set at last, while they are singular.
  bool start_from_sample() {
    for (std::size_t wanted = 512;; wanted *= 8) {
      const std::vector<double> sample =
          gather_sample(communicator_, set_, first_index_, total_, wanted, random_);
      count(static_cast<double>(sample.size() / (set_.packed_size() + 1)));
      std::uint64_t started = 0;
      if (rank_ == 0 && start(working_, sample_of(sample, set_.dimension()), options_, random_)) {
        started = 1;
      }
      mpi::broadcast(communicator_, started);
      if (started != 0) return true;
      if (wanted >= total_) return false;
    }
  }

  void count(double candidates) { tracer_.count_passes(candidates / static_cast<double>(total_)); }

  // The other processes: price on command until told to finish.
  void follow() {
    for (;;) {
      std::uint64_t command = kFinish;
      mpi::broadcast(communicator_, command);
      if (command == kFinish) return;
      price(static_cast<Command>(command));
    }
  }

  void share(Command command) {
    std::uint64_t code = command;
    mpi::broadcast(communicator_, code);
  }

  // One pass over all slices (or all lists) with what the first process prices with; records_ on
  // the first process then holds the candidates of all.
  void price(Command command) {
    if (rank_ == 0) std::ranges::copy(pricing_numbers(set_, working_.inverse()), numbers_.begin());
    mpi::broadcast(communicator_, std::span<double>(numbers_));
    const std::size_t read =
        command == kPriceSlice ? slice_.price_all(numbers_) : slice_.price_list(numbers_);
    slice_.best(command, wanted_, mine_);
    mine_.push_back(static_cast<double>(read));
    records_ = mpi::gather(communicator_, mine_);
  }

  [[nodiscard]] std::size_t stride() const { return set_.packed_size() + 2; }
  // Calls visit(record) for each candidate that the processes have sent.
  template <class Visit>
  void for_each_record(const Visit& visit) const {
    const std::size_t of_process = wanted_ * stride() + 1;
    for (std::size_t begin = 0; begin < records_.size(); begin += of_process) {
      for (std::size_t k = 0; k < wanted_; ++k) visit(records_.data() + begin + k * stride());
    }
  }

  // First process only: price, and return the gap.
  double gap_of(Command command) {
    share(command);
    price(command);
    const std::size_t of_process = wanted_ * stride() + 1;
    for (std::size_t end = of_process; end <= records_.size(); end += of_process) {
      count(records_[end - 1]);
    }
    double largest = 0.0;
    for_each_record([&](const double* record) { largest = std::max(largest, record[0]); });
    return largest / static_cast<double>(set_.dimension()) - 1.0;
  }

  // First process only: the most violating of the gathered candidates enter, then Newton.
  bool improve(double gap, double tolerance) {
    const auto d = static_cast<double>(set_.dimension());
    std::vector<const double*> order;
    for_each_record([&](const double* record) {
      if (record[0] > d) order.push_back(record);
    });
    std::ranges::stable_sort(order, std::greater<>(),
                             [](const double* record) { return record[0]; });
    order.resize(std::min(order.size(), wanted_));
    std::size_t added = 0;
    for (const double* record : order) {
      added += working_.add(static_cast<std::size_t>(record[1]), record + 2, 0.0) ? 1U : 0U;
    }
    ++iterations_;
    const WorkingSetStatus status = working_.improve(gap, tolerance);
    return added > 0 || status == WorkingSetStatus::kConverged;
  }

  // First process only: passes over the slices, with rounds on the lists between them. The rules
  // are those of column_generation.
  void steer() {
    for (int without_progress = 0;;) {
      const double asked = options_.duality_gap, error = working_.sensitivity_error();
      if (coordinates_ == Coordinates::kOwn && error > kForgivenShare * asked) {
        if (design_.support.empty()) remember();
        return set_status(SolveStatus::kNumericalFailure, rounding_message(error));
      }
      const double gap = gap_of(kPriceSlice);
      tracer_.record(gap, iterations_);
      without_progress = gap < 0.9 * best_gap_ ? 0 : without_progress + 1;
      if (gap < best_gap_) {
        best_gap_ = gap;
        remember();
      }
      if (ends(gap, error, without_progress)) return;
      improve(gap, asked);
      for (int round = 0; round < 30 && !tracer_.out_of_time(); ++round) {
        const double list_gap = gap_of(kPriceList);
        if (list_gap <= 0.5 * asked) break;
        if (!improve(list_gap, 0.5 * asked)) break;
      }
    }
  }

  // Sets the status after a pass over all slices if the run ends there.
  bool ends(double gap, double error, int without_progress) {
    const double asked = options_.duality_gap;
    SolveStatus status = SolveStatus::kNumericalFailure;
    std::string message;
    if (gap < -error - kNegativeGap) {  // the largest sensitivity is at least d for every design
      message = "a negative gap: the arithmetic broke down";
    } else if (gap + error <= asked) {
      status = SolveStatus::kSolved;
    } else if (gap <= asked && error >= 0.5 * asked) {
      message = rounding_message(error);
    } else if (tracer_.out_of_time()) {
      status = SolveStatus::kTimeLimit;
    } else if (without_progress > 8) {
      message = fmt::format("rounding keeps the gap at {:.1e}", best_gap_);
    } else {
      return false;
    }
    set_status(status, std::move(message));
    return true;
  }

  void set_status(SolveStatus status, std::string message = {}) {
    design_.status = status;
    design_.message = std::move(message);
  }

  void remember() {
    design_.support.clear();
    for (std::size_t k = 0; k < working_.size(); ++k) {
      if (working_.weights()[k] > 0.0) {
        design_.support.emplace_back(working_.indices()[k], working_.weights()[k]);
      }
    }
    std::ranges::sort(design_.support);
    design_.counters.iterations = iterations_;
  }

  MPI_Comm communicator_;
  const InformationSet& set_;
  Coordinates coordinates_;
  const SolveOptions& options_;
  Tracer& tracer_;
  Slice slice_;
  WorkingSet working_;
  Random random_;
  std::size_t first_index_;
  std::size_t wanted_;  // candidates each process offers a pass
  std::size_t rank_;
  std::size_t total_;
  std::int64_t iterations_ = 0;
  double best_gap_ = kInfinity;
  std::vector<double> numbers_;  // pricing_numbers()
  std::vector<double> mine_;
  std::vector<double> records_;
  DistributedDesign design_;
};

// The first process's status, message and support to all.
void publish(MPI_Comm communicator, DistributedDesign& design) {
  std::uint64_t size = design.support.size();
  mpi::broadcast(communicator, size);
  std::vector<double> flat{static_cast<double>(design.status)};
  for (const auto& [index, weight] : design.support) {
    flat.push_back(static_cast<double>(index));
    flat.push_back(weight);
  }
  flat.resize(2 * size + 1);
  mpi::broadcast(communicator, std::span<double>(flat));
  mpi::broadcast(communicator, design.message);
  design.status = static_cast<SolveStatus>(static_cast<int>(flat[0]));
  design.support.clear();
  for (std::size_t k = 1; k < flat.size(); k += 2) {
    design.support.emplace_back(static_cast<std::size_t>(flat[k]), flat[k + 1]);
  }
}

// The mean of all candidates, rounded to double precision at last.
InformationSet mean_of_all(MPI_Comm communicator, const InformationSet& slice) {
  const std::size_t p = slice.packed_size();
  std::vector<long double> sum = extended_sum(slice);
  mpi::sum(communicator, std::span<long double>(sum));
  const auto total = static_cast<long double>(mpi::sum(communicator, slice.candidate_count()));
  AlignedArray mean(p);
  for (std::size_t k = 0; k < p; ++k) mean[k] = static_cast<double>(sum[k] / total);
  return InformationSet(slice.dimension(), std::move(mean));
}

// The slice in coordinates where that mean is the identity. Nothing where it is singular even in
// extended precision, or where a process has no time for it.
std::optional<InformationSet> whitened(MPI_Comm communicator, const InformationSet& slice,
                                       int threads) {
  const InformationSet mean = mean_of_all(communicator, slice);
  const Extended all = 1;
  const ExtendedInformation information(mean, {&all, 1});
  if (!information.regular()) return std::nullopt;
  const std::vector<double> coordinates(information.inverse_factor().begin(),
                                        information.inverse_factor().end());
  std::optional<InformationSet> better = in_coordinates(slice, coordinates, threads);
  if (mpi::sum(communicator, better ? 0U : 1U) > 0) return std::nullopt;
  return better;
}

// What the checker does not confirm is not claimed.
void withdraw_unproven_claim(double asked_gap, DistributedDesign& design) {
  if (design.status != SolveStatus::kSolved || proves(design.certificate, asked_gap)) return;
  design.status = SolveStatus::kNumericalFailure;
  design.message = fmt::format("rounding keeps the gap at {:.1e}", largest_gap(design.certificate));
}

}  // namespace

DistributedDesign solve_distributed(MPI_Comm communicator, const InformationSet& slice,
                                    std::size_t first_index, const SolveOptions& options,
                                    SolveObserver* observer) {
  Tracer tracer(slice, options, observer);
  const auto attempt = [&](const InformationSet& set, Coordinates coordinates) {
    DistributedDesign design =
        Coordinator(communicator, set, first_index, coordinates, options, tracer).run();
    publish(communicator, design);
    design.certificate = certify_distributed(communicator, slice, first_index, design.support,
                                             options.duality_gap, options.threads);
    return design;
  };
  DistributedDesign design = attempt(slice, Coordinates::kOwn);
  const bool falls_short =
      judge(design.status, options.duality_gap, design.certificate) != ReportStatus::kSolved;
  std::uint64_t goes_on = falls_short && !tracer.out_of_time() ? 1U : 0U;
  mpi::broadcast(communicator, goes_on);  // one clock decides
  if (goes_on != 0) {
    const auto better = whitened(communicator, slice, options.threads);
    tracer.count_passes(2.0);
    if (better) {
      DistributedDesign again = attempt(*better, Coordinates::kWhitened);
      if (again.certificate.duality_gap + again.certificate.rounding_bound <=
          design.certificate.duality_gap + design.certificate.rounding_bound) {
        design = std::move(again);
      }
    }
  }
  withdraw_unproven_claim(options.duality_gap, design);
  Solution timing = tracer.finish({}, design.status, design.counters.iterations, {});
  design.counters = timing.counters;
  design.trace = std::move(timing.trace);
  return design;
}

}  // namespace graybox
