#include "solvers/external/cbf_file.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <fstream>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox {
namespace {

// Where the variables stand: weights, t, Z.
struct Variables {
  std::size_t candidates;
  std::size_t dimension;

  [[nodiscard]] std::size_t t(std::size_t j) const { return candidates + j; }
  [[nodiscard]] std::size_t z(std::size_t i, std::size_t j) const {
    return candidates + dimension + packed_index(i, j);
  }
  [[nodiscard]] std::size_t count() const {
    return candidates + dimension + packed_size(dimension);
  }
};

void write_cones(std::ostream& out, const Variables& variables) {
  const std::size_t q = variables.candidates, d = variables.dimension;
  out << "VER\n4\n\nOBJSENSE\nMAX\n\n";
  out << fmt::format("VAR\n{} 2\nL+ {}\nF {}\n\n", variables.count(), q, variables.count() - q);
  out << fmt::format("PSDCON\n1\n{}\n\n", 2 * d);
  out << fmt::format("CON\n{} {}\nL= 1\n", 1 + 3 * d, 1 + d);
  for (std::size_t j = 0; j < d; ++j) out << "EXP 3\n";
}

// Constraint 0 is the sum of the weights less one; 1 + 3 j and the next two are (Z_jj, 1, t_j).
void write_rows(std::ostream& out, const Variables& variables) {
  const std::size_t q = variables.candidates, d = variables.dimension;
  out << fmt::format("\nOBJACOORD\n{}\n", d);
  for (std::size_t j = 0; j < d; ++j) out << fmt::format("{} 1\n", variables.t(j));
  out << fmt::format("\nACOORD\n{}\n", q + 2 * d);
  for (std::size_t k = 0; k < q; ++k) out << fmt::format("0 {} 1\n", k);
  for (std::size_t j = 0; j < d; ++j) {
    out << fmt::format("{} {} 1\n{} {} 1\n", 1 + 3 * j, variables.z(j, j), 3 + 3 * j,
                       variables.t(j));
  }
  out << fmt::format("\nBCOORD\n{}\n0 -1\n", 1 + d);
  for (std::size_t j = 0; j < d; ++j) out << fmt::format("{} 1\n", 2 + 3 * j);
}

std::size_t count_of_entries(const InformationSet& set) {
  std::size_t count = packed_size(set.dimension()) + set.dimension();
  for (std::size_t k = 0; k < set.candidate_count() * set.packed_size(); ++k) {
    count += set.data()[k] != 0.0 ? 1U : 0U;
  }
  return count;
}

// Lower triangle of the 2 d x 2 d block.
void write_block(std::ostream& out, const InformationSet& set, const Variables& variables) {
  const std::size_t d = set.dimension();
  out << fmt::format("\nHCOORD\n{}\n", count_of_entries(set));
  for (std::size_t k = 0; k < set.candidate_count(); ++k) {
    for (std::size_t i = 0; i < d; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        const double value = set.information(k)[packed_index(i, j)];
        if (value != 0.0) out << fmt::format("0 {} {} {} {}\n", k, i, j, value);
      }
    }
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      out << fmt::format("0 {} {} {} 1\n", variables.z(i, j), d + j, i);
    }
  }
  for (std::size_t j = 0; j < d; ++j) {
    out << fmt::format("0 {} {} {} 1\n", variables.z(j, j), d + j, d + j);
  }
}

}  // namespace

void write_cbf(const std::string& path, const InformationSet& set) {
  const Variables variables{set.candidate_count(), set.dimension()};
  AtomicFile file(path);
  {
    std::ofstream out(file.temporary(), std::ios::binary);
    write_cones(out, variables);
    write_rows(out, variables);
    write_block(out, set, variables);
    out.close();
    if (!out) throw InputError(fmt::format("{}: can't be written: disk full?", path));
  }
  file.commit();
}

}  // namespace graybox
