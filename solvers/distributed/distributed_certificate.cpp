#include "solvers/distributed/distributed_certificate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/information/held_numbers.hpp"
#include "solvers/distributed/mpi_transfer.hpp"

namespace graybox {
namespace {

using Support = std::vector<std::pair<std::size_t, double>>;

constexpr std::size_t kChunk = 16384;  // candidates of the slice that are certified together

// The support's matrices or factors, then a stretch of the slice. The design is the same on each.
InformationSet part_of(const InformationSet& support, const InformationSet& slice, std::size_t from,
                       std::size_t count) {
  const std::span<const double> members = held_numbers(support);
  const std::size_t each = numbers_each(slice);
  const std::span<const double> stretch = held_numbers(slice).subspan(from * each, count * each);
  AlignedArray rows(members.size() + stretch.size());
  std::ranges::copy(members, rows.begin());
  std::ranges::copy(stretch, rows.begin() + members.size());
  return of_same_form(slice, std::move(rows));
}

double reach(const Certificate& certificate) {
  return certificate.duality_gap + certificate.rounding_bound;
}

// Keeps in `worst` what holds on both: the figures of the part that reaches further, with a
// rounding bound that also covers the other's gap.
void take_worse(const Certificate& other, Certificate& worst) {
  const double gap = std::max(worst.duality_gap, other.duality_gap);
  const double furthest = std::max(reach(worst), reach(other));
  if (other.duality_gap > worst.duality_gap) worst.worst_candidate = other.worst_candidate;
  worst.duality_gap = gap;
  worst.rounding_bound = std::isfinite(furthest) ? furthest - gap : furthest;
  if (other.status != CertificateStatus::kCertified) worst.status = other.status;
}

Certificate certify_slice(const InformationSet& support, const InformationSet& slice,
                          std::size_t first_index, const Support& weights, double asked_gap,
                          int threads) {
  const std::size_t size = support.candidate_count(), count = slice.candidate_count();
  const std::size_t chunks = (count + kChunk - 1) / kChunk;
  std::vector<Certificate> found(chunks);
#pragma omp parallel for num_threads(threads) schedule(dynamic) if (threads > 1)
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const std::size_t from = chunk * kChunk;
    const InformationSet part = part_of(support, slice, from, std::min(kChunk, count - from));
    Design design{std::vector<double>(part.candidate_count(), 0.0)};
    for (std::size_t k = 0; k < size; ++k) design.weights[k] = weights[k].second;
    found[chunk] = certify(part, design, {}, asked_gap);
    const std::size_t worst = found[chunk].worst_candidate;
    found[chunk].worst_candidate =
        worst < size ? weights[worst].first : first_index + from + worst - size;
  }
  Certificate worst = found.front();
  for (const Certificate& other : found) take_worse(other, worst);
  return worst;
}

}  // namespace

InformationSet gather_support(MPI_Comm communicator, const InformationSet& slice,
                              std::size_t first_index, const Support& support) {
  const std::size_t each = numbers_each(slice);
  AlignedArray rows(support.size() * each, 0.0);
  for (std::size_t k = 0; k < support.size(); ++k) {
    const std::size_t index = support[k].first;
    if (index < first_index || index >= first_index + slice.candidate_count()) continue;
    std::ranges::copy(held_numbers(slice).subspan((index - first_index) * each, each),
                      rows.begin() + k * each);
  }
  mpi::sum(communicator, rows.span());  // all others have zeros there
  return of_same_form(slice, std::move(rows));
}

Certificate certify_distributed(MPI_Comm communicator, const InformationSet& slice,
                                std::size_t first_index, const Support& support, double asked_gap,
                                int threads) {
  if (support.empty()) {
    Certificate none;
    none.duality_gap = none.rounding_bound = none.log_det_gap =
        std::numeric_limits<double>::infinity();
    none.log_det = -std::numeric_limits<double>::infinity();
    none.message = "there is no design";
    return none;
  }
  const InformationSet members = gather_support(communicator, slice, first_index, support);
  Certificate mine = certify_slice(members, slice, first_index, support, asked_gap, threads);
  const double figures[] = {mine.duality_gap, mine.rounding_bound, static_cast<double>(mine.status),
                            static_cast<double>(mine.worst_candidate)};
  std::vector<double> all = mpi::gather(communicator, figures);
  all.resize(std::size(figures) * mpi::size_of(communicator));
  mpi::broadcast(communicator, all);
  for (std::size_t k = 0; k < all.size(); k += std::size(figures)) {
    Certificate other = mine;
    other.duality_gap = all[k];
    other.rounding_bound = all[k + 1];
    other.status = static_cast<CertificateStatus>(static_cast<int>(all[k + 2]));
    other.worst_candidate = static_cast<std::size_t>(all[k + 3]);
    take_worse(other, mine);
  }
  state_bounds(static_cast<double>(slice.dimension()), mine);
  return mine;
}

}  // namespace graybox
