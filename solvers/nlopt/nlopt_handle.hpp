// What the NLopt back-ends share: an owned nlopt_opt and NLopt's results in words.
#pragma once

#include <nlopt.h>

#include <memory>
#include <string_view>
#include <type_traits>

namespace graybox::nlopt {

struct Destroy {
  void operator()(nlopt_opt handle) const { nlopt_destroy(handle); }
};
using Handle = std::unique_ptr<std::remove_pointer_t<nlopt_opt>, Destroy>;

// Throws std::bad_alloc.
[[nodiscard]] Handle make_handle(nlopt_algorithm algorithm, std::size_t variables);

// "NLopt met its own tolerance", ...
[[nodiscard]] std::string_view reason(nlopt_result result);

}  // namespace graybox::nlopt
