#include "diagnosis/signals/line_spectra.hpp"

#include <Eigen/QR>
#include <cmath>
#include <map>

namespace graybox {
namespace {

using Eigen::Index;

// What is done with the bins at these offsets from a line.
struct LeakageFilter {
  Eigen::VectorXd prediction;  // s: weights that predict the transient at offset 0
  Eigen::MatrixXd noise;       // Q (1 + |s|^2)^(1/2)
};

LeakageFilter leakage_filter(const std::vector<Index>& offsets, int order) {
  const auto count = static_cast<Index>(offsets.size());
  double farthest = 1.0;
  for (const Index offset : offsets) {
    farthest = std::max(farthest, std::abs(static_cast<double>(offset)));
  }
  Eigen::MatrixXd powers(count, order + 1);
  for (Index m = 0; m < count; ++m) {
    const double x = static_cast<double>(offsets[static_cast<std::size_t>(m)]) / farthest;
    for (Index p = 0; p <= order; ++p) powers(m, p) = std::pow(x, static_cast<double>(p));
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(powers);
  const Eigen::MatrixXd q = qr.householderQ();
  // The value at 0 is the first coefficient: s = Q_1 R^-T e_1.
  const Eigen::MatrixXd r = qr.matrixQR().topRows(order + 1).triangularView<Eigen::Upper>();
  const Eigen::VectorXd first =
      r.transpose().triangularView<Eigen::Lower>().solve(Eigen::VectorXd::Unit(order + 1, 0));
  LeakageFilter filter;
  filter.prediction = q.leftCols(order + 1) * first;
  filter.noise = q.rightCols(count - order - 1) * std::sqrt(1.0 + filter.prediction.squaredNorm());
  return filter;
}

// The nearest bins on both sides that the periodic part does not reach; more of the other side
// where zero frequency or the Nyquist frequency is near.
std::vector<Index> noise_offsets(std::size_t line, const PeriodicLayout& layout,
                                 std::size_t count) {
  const auto periods = static_cast<Index>(layout.periods);
  const Index centre = static_cast<Index>(line) * periods;
  const Index last = static_cast<Index>(layout.period * layout.periods - 1) / 2;
  std::vector<Index> offsets;
  for (Index o = 1; offsets.size() < count && (o < centre || centre + o <= last); ++o) {
    if (o % periods == 0) continue;
    if (centre - o >= 1) offsets.insert(offsets.begin(), -o);
    if (centre + o <= last) offsets.push_back(o);
  }
  return offsets;
}

// The filters of the sets of offsets that occur: one for most lines.
class LeakageFilters {
 public:
  explicit LeakageFilters(int order) : order_(order) {}
  const LeakageFilter& at(const std::vector<Index>& offsets) {
    auto found = filters_.find(offsets);
    if (found == filters_.end()) {
      found = filters_.emplace(offsets, leakage_filter(offsets, order_)).first;
    }
    return found->second;
  }

 private:
  int order_;
  std::map<std::vector<Index>, LeakageFilter> filters_;
};

}  // namespace

Eigen::MatrixXcd record_spectra(const Eigen::Ref<const Eigen::MatrixXd>& signals,
                                RealTransform& transform) {
  const auto samples = static_cast<Index>(transform.length());
  Eigen::MatrixXcd spectra(samples / 2 + 1, signals.cols());
  for (Index c = 0; c < signals.cols(); ++c) {
    spectra.col(c) = transform.run(signals.col(c).head(samples));
  }
  return spectra;
}

LineSpectra line_spectra(const Eigen::MatrixXcd& spectra, const PeriodicLayout& layout,
                         const LeakageOptions& options) {
  const double scale = 1.0 / std::sqrt(static_cast<double>(layout.periods));
  const auto columns = static_cast<std::size_t>(options.order + 1);
  const std::size_t wanted = (columns + static_cast<std::size_t>(options.samples) + 1) / 2 * 2;
  LeakageFilters filters(options.order);
  LineSpectra result;
  result.values.resize(spectra.cols(), static_cast<Index>(layout.lines.size()));
  result.samples.assign(layout.lines.size(), Eigen::MatrixXcd(spectra.cols(), 0));
  result.bins.resize(layout.lines.size());
  for (std::size_t k = 0; k < layout.lines.size(); ++k) {
    const auto centre = static_cast<Index>(layout.lines[k] * layout.periods);
    auto value = result.values.col(static_cast<Index>(k));
    value = scale * spectra.row(centre).transpose();
    if (layout.periods < 2) continue;
    const std::vector<Index> offsets = noise_offsets(layout.lines[k], layout, wanted);
    if (offsets.size() <= columns) continue;
    Eigen::MatrixXcd around(spectra.cols(), static_cast<Index>(offsets.size()));
    for (std::size_t m = 0; m < offsets.size(); ++m) {
      around.col(static_cast<Index>(m)) = scale * spectra.row(centre + offsets[m]).transpose();
      result.bins[k].push_back(static_cast<std::size_t>(centre + offsets[m]));
    }
    const LeakageFilter& filter = filters.at(offsets);
    value -= around * filter.prediction;
    result.samples[k] = around * filter.noise;
  }
  return result;
}

std::vector<std::size_t> detection_lines(const PeriodicLayout& layout) {
  std::vector<std::size_t> silent;
  for (std::size_t k = 0; k + 1 < layout.lines.size(); ++k) {
    for (std::size_t line = layout.lines[k] + 1; line < layout.lines[k + 1]; ++line) {
      silent.push_back(line);
    }
  }
  return silent;
}

}  // namespace graybox
