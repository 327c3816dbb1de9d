// `graybox problem from-jacobians`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "problems/information/information_set.hpp"

namespace graybox::cli {

// Throws InputError where factors are to be written to a file that can't say so: other than .h5.
void require_place_for_factors(bool factors, const std::string& output);

// `write` validates a set and writes it to a path.
void add_jacobian_problem(
    CLI::App& problem,
    std::function<void(const std::string& path, const InformationSet& set)> write);

}  // namespace graybox::cli
