#include "diagnosis/force_balance/balance_trends.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/balance_uncertainty.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kImitated = 1e-3;  // of a direction's square: the other columns take all of it

// Samples of each recording, whose pieces follow one another.
std::vector<Index> samples_of_recordings(const ForceBalanceRows& rows) {
  std::vector<Index> samples;
  for (std::size_t piece = 0; piece < rows.pieces.size(); ++piece) {
    const bool is_new = piece == 0 || rows.names[piece] != rows.names[piece - 1];
    if (is_new) samples.push_back(0);
    samples.back() += rows.pieces[piece].samples();
  }
  return samples;
}

std::vector<TrendCovariate> covariates_at(const PlacedLaw& law, const ForceBalanceData& data) {
  const ForceBalanceRows& rows = data.estimation;
  std::vector<TrendCovariate> covariates{
      {LawTrend::On::kTime, time_covariate(samples_of_recordings(rows))}};
  if (!data.position_is_recorded || law.place->location.is_flange) return covariates;
  Eigen::VectorXd position(rows.samples());
  Index at = 0;
  for (const Motion& piece : rows.pieces) {
    position.segment(at, piece.samples()) = motion_at(*law.place, piece).deflection;
    at += piece.samples();
  }
  append_position_covariates(position, covariates);
  return covariates;
}

class BalanceTrends {
 public:
  BalanceTrends(const ForceBalanceData& data, std::span<const PlacedLaw> laws,
                const Eigen::MatrixXd& residuals)
      : rows_(data.estimation), model_(rows_.model.count) {
    const Eigen::VectorXd noise = rms_of(rows_, residuals);
    rest_ = residuals * noise.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd about_mean = rows_.measured.rowwise() - rows_.measured.colwise().mean();
    noise_of_signal_ = noise.cwiseQuotient(rms_of(rows_, about_mean));
    columns_ = information_columns(data, laws, noise, of_laws_);
    basis_.resize(columns_.rows(), 0);
    is_seen_ = extend_basis(columns_, basis_);
  }

  [[nodiscard]] LawTrend most_of(std::size_t l, const PlacedLaw& law,
                                 const std::vector<TrendCovariate>& covariates) const {
    std::vector<std::size_t> asked = law.linear();
    if (const std::vector<std::size_t> scaled = law.scaled(); !scaled.empty()) {
      asked.push_back(scaled.front());
    }
    LawTrend most{l, 0, LawTrend::On::kTime, 0.0, 0.0, 0.0, {}, 0.0};
    for (std::size_t k = 0; k < of_laws_.size(); ++k) {
      const LawColumn& column = of_laws_[k];
      if (column.law != l || std::ranges::count(asked, column.parameter) == 0) continue;
      if (!is_seen_[static_cast<std::size_t>(model_) + k]) continue;
      for (const TrendCovariate& with : covariates) {
        const Eigen::VectorXd own = columns_.col(model_ + static_cast<Index>(k));
        const ToldRange range(with.values, told(own));
        if (!range.is_wide()) continue;
        const Trend found = trend(own, with.values);
        if (std::abs(found.z) <= std::abs(most.z)) continue;
        const ToldRange::Ends ends = range.ends(law.parameters[column.parameter], found.slope);
        most = {l, column.parameter, with.on, ends.from, ends.to, found.z, {}, found.of_signal};
      }
    }
    return most;
  }

 private:
  struct Trend {
    double slope = 0.0, z = 0.0, of_signal = 0.0;
  };

  // What each sample adds to the information on a parameter of this column.
  [[nodiscard]] Eigen::VectorXd told(const Eigen::VectorXd& column) const {
    const Eigen::Map<const Eigen::MatrixXd> own(column.data(), rows_.samples(),
                                                rows_.coordinates());
    return own.rowwise().squaredNorm();
  }

  [[nodiscard]] Trend trend(const Eigen::VectorXd& column, const Eigen::VectorXd& covariate) const {
    const Index samples = rows_.samples(), coordinates = rows_.coordinates();
    Eigen::VectorXd moved = column;
    const double mean = covariate.mean();
    for (Index j = 0; j < coordinates; ++j) {
      moved.segment(j * samples, samples).array() *= covariate.array() - mean;
    }
    const double all = moved.squaredNorm();
    moved -= basis_ * (basis_.transpose() * moved);
    const double square = moved.squaredNorm();
    if (!(square > kImitated * all)) return {};
    const Eigen::Map<const Eigen::MatrixXd> own(moved.data(), samples, coordinates);
    const double slope = own.cwiseProduct(rest_).sum() / square;
    const Eigen::VectorXd score =
        own.cwiseProduct(rest_ - slope * own).rowwise().sum();  // what the trend leaves
    const double variance = covariance_of_sums(rows_, score, 0)(0, 0);
    if (!(variance > 0.0)) return {};
    const Eigen::VectorXd moves = own.colwise().norm() / std::sqrt(static_cast<double>(samples));
    return {slope, slope * square / std::sqrt(variance),
            std::abs(slope) * moves.cwiseProduct(noise_of_signal_).maxCoeff()};
  }

  const ForceBalanceRows& rows_;
  Index model_;           // columns of the model's own parameters
  Eigen::MatrixXd rest_;  // residuals over the noise, samples x coordinates
  Eigen::VectorXd noise_of_signal_;
  Eigen::MatrixXd columns_;  // of all parameters, coordinate after coordinate
  Eigen::MatrixXd basis_;
  std::vector<bool> is_seen_;  // columns that those before leave something of
  std::vector<LawColumn> of_laws_;
};

}  // namespace

std::vector<LawTrend> balance_trends(const ForceBalanceData& data, std::span<const PlacedLaw> laws,
                                     const Eigen::MatrixXd& residuals) {
  const BalanceTrends trends(data, laws, residuals);
  std::vector<LawTrend> result;
  for (std::size_t l = 0; l < laws.size(); ++l) {
    result.push_back(trends.most_of(l, laws[l], covariates_at(laws[l], data)));
  }
  return result;
}

}  // namespace graybox
