#include "solvers/nlopt/nlopt_handle.hpp"

#include <new>

namespace graybox::nlopt {

Handle make_handle(nlopt_algorithm algorithm, std::size_t variables) {
  Handle handle(nlopt_create(algorithm, static_cast<unsigned>(variables)));
  if (handle == nullptr) throw std::bad_alloc();
  return handle;
}

std::string_view reason(nlopt_result result) {
  switch (result) {
    case NLOPT_SUCCESS:
    case NLOPT_STOPVAL_REACHED:
    case NLOPT_FTOL_REACHED:
    case NLOPT_XTOL_REACHED:
      return "NLopt met its own tolerance";
    case NLOPT_MAXEVAL_REACHED:
      return "NLopt used up its evaluations";
    case NLOPT_FORCED_STOP:
      return "no progress";
    case NLOPT_ROUNDOFF_LIMITED:
      return "NLopt was stopped by rounding";
    case NLOPT_OUT_OF_MEMORY:
      return "out of memory";
    default:
      return "NLopt failed";
  }
}

}  // namespace graybox::nlopt
