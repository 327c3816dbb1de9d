#include "graybox/solvers/distributed/distributed_column_generation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/solvers/kernels/dense_kernels.hpp"
#include "graybox/solvers/sensitivity_sample.hpp"
#include "graybox/solvers/working_set.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What the first process asks of all.
enum Command : int { kPriceSlice, kPriceList, kFinish };

// One process's candidates. The list is the part with the largest sensitivities at the last pass.
class Slice {
 public:
  Slice(const InformationSet& set, std::size_t first_index)
      : set_(set), first_index_(first_index), sensitivity_(set.candidate_count()) {}

  void price_all(const double* dual) {
    kernels().price(set_.data(), set_.candidate_count(), set_.packed_size(), dual,
                    sensitivity_.data());
    choose_list();
  }

  void price_list(const double* dual) {
    dense_kernels().price_indexed(set_.data(), list_.data(), list_.size(), set_.packed_size(), dual,
                                  list_sensitivity_.data());
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
      std::ranges::copy(set_.information(candidate), record + 2);
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
  std::vector<double> sensitivity_;
  std::vector<std::size_t> list_;
  std::vector<double> list_sensitivity_;
};

// Rows for the start: a strided sample of the slice, its share of `wanted`, gathered on the first
// process.
std::vector<double> gather_sample(MPI_Comm communicator, const InformationSet& set,
                                  std::size_t first_index, std::size_t total, std::size_t wanted) {
  const std::size_t p = set.packed_size();
  const std::size_t count =
      std::min(set.candidate_count(), (wanted * set.candidate_count() + total - 1) / total + 1);
  std::vector<double> rows(count * (p + 1));
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = set.candidate_count() * k / count;
    rows[k * (p + 1)] = static_cast<double>(first_index + i);
    std::ranges::copy(set.information(i), rows.data() + k * (p + 1) + 1);
  }
  int rank = 0, processes = 1;
  MPI_Comm_rank(communicator, &rank);
  MPI_Comm_size(communicator, &processes);
  const int size = static_cast<int>(rows.size());
  std::vector<int> sizes(static_cast<std::size_t>(processes)), offsets(sizes.size());
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, communicator);
  std::exclusive_scan(sizes.begin(), sizes.end(), offsets.begin(), 0);
  std::vector<double> gathered(rank == 0 ? static_cast<std::size_t>(offsets.back() + sizes.back())
                                         : std::size_t{0});
  MPI_Gatherv(rows.data(), size, MPI_DOUBLE, gathered.data(), sizes.data(), offsets.data(),
              MPI_DOUBLE, 0, communicator);
  return gathered;
}

// First working set: the sample, solved roughly. False if the sample sees too few directions.
bool start(WorkingSet& working, const std::vector<double>& sample, std::size_t p) {
  const std::size_t count = sample.size() / (p + 1);
  working.clear();
  for (std::size_t k = 0; k < count; ++k) {
    const double* record = sample.data() + k * (p + 1);
    working.add(static_cast<std::size_t>(record[0]), record + 1, 1.0);
  }
  if (!working.refresh()) return false;
  working.optimise(0.03, 8);
  working.drop_below(kInfinity);
  return true;
}

class Coordinator {
 public:
  Coordinator(MPI_Comm communicator, const InformationSet& set, std::size_t first_index,
              const SolveOptions& options)
      : communicator_(communicator),
        set_(set),
        options_(options),
        slice_(set, first_index),
        working_(set.dimension()),
        first_index_(first_index),
        wanted_(2 * set.dimension()) {
    MPI_Comm_rank(communicator, &rank_);
    MPI_Comm_size(communicator, &processes_);
    std::uint64_t local = set.candidate_count(), total = 0;
    MPI_Allreduce(&local, &total, 1, MPI_UINT64_T, MPI_SUM, communicator);
    total_ = total;
    dual_.resize(set.packed_size());
  }

  DistributedDesign run() {
    const double began = MPI_Wtime();
    if (!start_from_sample()) {
      design_.status = SolveStatus::kUnsupported;
    } else if (rank_ == 0) {
      steer(began);
      share(kFinish);
    } else {
      follow();
    }
    design_.counters.seconds = MPI_Wtime() - began;
    publish();
    return design_;
  }

 private:
  // Samples grow eightfold, to the whole set at last, while they are singular.
  bool start_from_sample() {
    for (std::size_t wanted = 512;; wanted *= 8) {
      const std::vector<double> sample =
          gather_sample(communicator_, set_, first_index_, total_, wanted);
      int started = rank_ == 0 ? start(working_, sample, set_.packed_size()) : 0;
      MPI_Bcast(&started, 1, MPI_INT, 0, communicator_);
      if (started != 0) return true;
      if (wanted >= total_) return false;
    }
  }

  // The other processes: price on command until told to finish.
  void follow() {
    for (;;) {
      int command = kFinish;
      MPI_Bcast(&command, 1, MPI_INT, 0, communicator_);
      if (command == kFinish) return;
      price(static_cast<Command>(command));
    }
  }

  void share(Command command) {
    int code = command;
    MPI_Bcast(&code, 1, MPI_INT, 0, communicator_);
  }

  // One pass over all slices (or all lists) with the first process's M^-1; records_ on the first
  // process then holds the candidates of all.
  void price(Command command) {
    if (rank_ == 0) std::ranges::copy(working_.inverse().trace_dual(), dual_.begin());
    MPI_Bcast(dual_.data(), static_cast<int>(dual_.size()), MPI_DOUBLE, 0, communicator_);
    if (command == kPriceSlice) {
      slice_.price_all(dual_.data());
    } else {
      slice_.price_list(dual_.data());
    }
    slice_.best(command, wanted_, mine_);
    records_.resize(rank_ == 0 ? mine_.size() * static_cast<std::size_t>(processes_) : 0);
    MPI_Gather(mine_.data(), static_cast<int>(mine_.size()), MPI_DOUBLE, records_.data(),
               static_cast<int>(mine_.size()), MPI_DOUBLE, 0, communicator_);
  }

  // First process only: price, and return the gap.
  double gap_of(Command command) {
    share(command);
    price(command);
    const std::size_t stride = set_.packed_size() + 2;
    double largest = 0.0;
    for (std::size_t k = 0; k < records_.size(); k += stride)
      largest = std::max(largest, records_[k]);
    return largest / static_cast<double>(set_.dimension()) - 1.0;
  }

  // First process only: the most violating of the gathered candidates enter, then Newton.
  bool improve(double gap, double tolerance) {
    const std::size_t stride = set_.packed_size() + 2;
    const auto d = static_cast<double>(set_.dimension());
    std::vector<std::size_t> order;
    for (std::size_t k = 0; k < records_.size(); k += stride) {
      if (records_[k] > d) order.push_back(k);
    }
    std::ranges::sort(order,
                      [&](std::size_t a, std::size_t b) { return records_[a] > records_[b]; });
    order.resize(std::min(order.size(), wanted_));
    std::size_t added = 0;
    for (const std::size_t k : order) {
      added +=
          working_.add(static_cast<std::size_t>(records_[k + 1]), &records_[k + 2], 0.0) ? 1U : 0U;
    }
    ++design_.counters.iterations;
    const WorkingSetStatus status = working_.improve(gap, tolerance);
    return added > 0 || status == WorkingSetStatus::kConverged;
  }

  // First process only: passes over the slices, with rounds on the lists between them.
  void steer(double began) {
    double best_gap = kInfinity;
    for (int without_progress = 0;;) {
      const double gap = gap_of(kPriceSlice);
      design_.counters.passes += 1.0;
      without_progress = gap < 0.9 * best_gap ? 0 : without_progress + 1;
      if (gap < best_gap) {
        best_gap = gap;
        remember(gap);
      }
      if (gap <= options_.duality_gap) return set_status(SolveStatus::kSolved);
      if (MPI_Wtime() - began > options_.time_limit) return set_status(SolveStatus::kTimeLimit);
      if (without_progress > 8) return set_status(SolveStatus::kNumericalFailure);
      improve(gap, options_.duality_gap);
      for (int round = 0; round < 30; ++round) {
        const double list_gap = gap_of(kPriceList);
        if (list_gap <= 0.5 * options_.duality_gap) break;
        if (!improve(list_gap, 0.5 * options_.duality_gap)) break;
      }
    }
  }

  void set_status(SolveStatus status) { design_.status = status; }

  void remember(double gap) {
    design_.duality_gap = gap;
    design_.log_det = working_.inverse().log_det();
    design_.support.clear();
    for (std::size_t k = 0; k < working_.size(); ++k) {
      if (working_.weights()[k] > 0.0) {
        design_.support.emplace_back(working_.indices()[k], working_.weights()[k]);
      }
    }
    std::ranges::sort(design_.support);
  }

  // The first process's result to all.
  void publish() {
    double header[6] = {static_cast<double>(static_cast<int>(design_.status)),
                        design_.duality_gap,
                        design_.log_det,
                        static_cast<double>(design_.counters.iterations),
                        design_.counters.passes,
                        static_cast<double>(design_.support.size())};
    MPI_Bcast(header, 6, MPI_DOUBLE, 0, communicator_);
    design_.status = static_cast<SolveStatus>(static_cast<int>(header[0]));
    design_.duality_gap = header[1];
    design_.log_det = header[2];
    design_.counters.iterations = static_cast<std::int64_t>(header[3]);
    design_.counters.passes = header[4];
    std::vector<double> flat;
    for (const auto& [index, weight] : design_.support) {
      flat.push_back(static_cast<double>(index));
      flat.push_back(weight);
    }
    flat.resize(2 * static_cast<std::size_t>(header[5]));
    MPI_Bcast(flat.data(), static_cast<int>(flat.size()), MPI_DOUBLE, 0, communicator_);
    design_.support.clear();
    for (std::size_t k = 0; k < flat.size(); k += 2) {
      design_.support.emplace_back(static_cast<std::size_t>(flat[k]), flat[k + 1]);
    }
  }

  MPI_Comm communicator_;
  const InformationSet& set_;
  const SolveOptions& options_;
  Slice slice_;
  WorkingSet working_;
  std::size_t first_index_;
  std::size_t wanted_;  // candidates each process offers a pass
  std::size_t total_ = 0;
  int rank_ = 0;
  int processes_ = 1;
  std::vector<double> dual_;
  std::vector<double> mine_;
  std::vector<double> records_;
  DistributedDesign design_;
};

}  // namespace

DistributedDesign solve_distributed(MPI_Comm communicator, const InformationSet& slice,
                                    std::size_t first_index, const SolveOptions& options) {
  return Coordinator(communicator, slice, first_index, options).run();
}

}  // namespace graybox
