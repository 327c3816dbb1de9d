// `graybox problem from-jacobians`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "problems/information/information_set.hpp"

namespace graybox::cli {

// `write` validates a set and writes it to a path.
void add_jacobian_problem(
    CLI::App& problem,
    std::function<void(const std::string& path, const InformationSet& set)> write);

}  // namespace graybox::cli
