// Information sets as text: one packed lower triangle (packed_matrix.hpp) a line, p numbers
// separated by commas, semicolons, tabs or blanks (text_lines.hpp). A first line without any number
// is a header; empty lines and lines that begin with # are skipped.
//
//   H_1_1,H_2_1,H_2_2
//   1,0,0.5
//
// A header of names H_i_j (or Hij) tells the order: the upper triangle and any other order are read
// as what they are. Such names that contradict each other are refused. Other names say nothing.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"

namespace graybox {

// Throws InputError naming line and column. Two passes over the file, none over a copy in memory.
[[nodiscard]] InformationSet read_csv(const std::string& path);

// The same of factors of rank one: one vector f a line, H = f f^T. A header names the parameters.
[[nodiscard]] InformationSet read_csv_factors(const std::string& path);

// Writes a header and the shortest decimals that read back exactly. Coordinates and names of
// parameters are not kept.
void write_csv(const std::string& path, const InformationSet& set);

}  // namespace graybox
