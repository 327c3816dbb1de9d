#include "problems/formats/mat_sizes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

constexpr long double kExpansion = 1032.0L;  // the most that deflate can gain

}  // namespace

std::size_t element_count(const matvar_t& variable) {
  long double product = variable.rank > 0 ? 1.0L : 0.0L;
  for (int i = 0; i < variable.rank; ++i) product *= static_cast<long double>(variable.dims[i]);
  constexpr std::size_t kLargest = std::numeric_limits<std::size_t>::max();
  return product < static_cast<long double>(kLargest) ? static_cast<std::size_t>(product)
                                                      : kLargest;
}

bool holds_its_numbers(const matvar_t& variable) {
  const std::size_t width = Mat_SizeOfClass(variable.class_type);
  return variable.data != nullptr && width > 0 && variable.isComplex == 0 &&
         element_count(variable) <= variable.nbytes / width;
}

void require_plausible_size(const std::string& source, const std::string& path,
                            const matvar_t& variable) {
  const auto count = static_cast<long double>(element_count(variable));
  const auto present = static_cast<long double>(InputFile(path).size());
  // An element takes a byte at least: MATLAB stores small whole numbers in one.
  if (count > kExpansion * present) {
    throw InputError(fmt::format(
        "{}: truncated: {:.3g} elements can't lie in a file of {:.0f} bytes; copy it again", source,
        count, present));
  }
  require_memory_for_numbers(count, source);
}

}  // namespace graybox
