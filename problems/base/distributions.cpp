#include "problems/base/distributions.hpp"

#include <fmt/format.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/non_central_chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

void require_degrees(double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0.0)) {
    throw InputError(
        fmt::format("{:g} degrees of freedom: there must be more", degrees_of_freedom));
  }
}

void require_probability(double probability) {
  if (!(probability > 0.0 && probability < 1.0)) {
    throw InputError(fmt::format("probability {:g}: must lie between 0 and 1", probability));
  }
}

}  // namespace

double normal_tail(double x) {
  return boost::math::cdf(boost::math::complement(boost::math::normal(), x));
}

double normal_quantile(double probability) {
  require_probability(probability);
  return boost::math::quantile(boost::math::normal(), probability);
}

double chi_square_tail(double x, double degrees_of_freedom) {
  require_degrees(degrees_of_freedom);
  if (x <= 0.0) return 1.0;
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees_of_freedom), x));
}

double chi_square_quantile(double probability, double degrees_of_freedom) {
  require_degrees(degrees_of_freedom);
  require_probability(probability);
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

double fisher_tail(double x, double numerator, double denominator) {
  require_degrees(numerator);
  require_degrees(denominator);
  if (x <= 0.0) return 1.0;
  return boost::math::cdf(
      boost::math::complement(boost::math::fisher_f(numerator, denominator), x));
}

double fisher_quantile(double probability, double numerator, double denominator) {
  require_degrees(numerator);
  require_degrees(denominator);
  require_probability(probability);
  return boost::math::quantile(boost::math::fisher_f(numerator, denominator), probability);
}

double noncentral_chi_square_tail(double x, double degrees_of_freedom, double noncentrality) {
  require_degrees(degrees_of_freedom);
  if (x <= 0.0) return 1.0;
  if (noncentrality <= 0.0) return chi_square_tail(x, degrees_of_freedom);
  return boost::math::cdf(boost::math::complement(
      boost::math::non_central_chi_squared(degrees_of_freedom, noncentrality), x));
}

}  // namespace graybox
