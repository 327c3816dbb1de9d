// The hot loop of the information matrices of a robot at one position (the mathematics is in
// robot_information.hpp), compiled for several vector widths and chosen once at run time. A vector
// holds several frequencies. The sum over frequencies has an order that is fixed for a given vector
// width, so a result is repeatable on a machine, whatever the thread count.
//
// Rotations are ordered bearings first, gearboxes (= motors) last: n = bearings + motors.
#pragma once

#include <cstddef>

namespace graybox {

// What does not depend on the position. Arrays of complex numbers hold for element e and frequency
// f the real part at [(2 e) F + f] and the imaginary part at [(2 e + 1) F + f]. Here F =
// frequencies, which is padded to a multiple of kFrequencyPadding by entries of weight zero.
// Matrices: `packed` ones are lower triangles (packed_matrix.hpp), the others full and row-major;
// if `diagonal`, all of the m x m matrices hold their diagonals alone.
struct InformationTables {
  static constexpr std::size_t kFrequencyPadding = 8;

  std::size_t bearings = 0;
  std::size_t motors = 0;
  std::size_t frequencies = 0;
  bool diagonal = false;
  const double* squared_frequency = nullptr;  // w^2
  const double* weight = nullptr;             // 2 Phi_r / (n_y Phi_v)
  const double* bearing = nullptr;            // k + j w c of each bearing
  const double* gearbox = nullptr;            // P, m x m, packed: K_g D_m^-1 (D_m - K_g)
  const double* velocity = nullptr;           // U = N D_m^-1 K_g, m x m
  const double* direct = nullptr;             // -N D_m^-1, m x m
  const double* reaction = nullptr;           // R = (I - D_m^-1 K_g)^T, m x m
  const double* closed_loop = nullptr;        // N D_m^-1 N^T + F^-1 / (j w h), m x m, packed
};

struct InformationKernel {
  const char* name;  // "generic", "avx2", "avx512"

  // The result out (n x n, packed) = sum over f of weight Re[(l_p^H l_q) (m_p^H m_q)], springs p, q
  // in the order of the rotations. The inputs mass and gravity are M_a and dg/dq, n x n, packed.
  // The workspace has information_workspace_size() doubles, aligned to 64 bytes.
  void (*information)(const InformationTables& tables, const double* mass, const double* gravity,
                      double* workspace, double* out);

  // The summands of information() before the sum over the motors i = 1 .. m in m_p^H m_q. For each
  // frequency f (padding included) and motor a it is a packed n x n matrix at out[(f m + a) n (n +
  // 1)/2]. Its entries are weight Re[(l_p^H l_q) conj(m_pa) m_qa].
  void (*lines)(const InformationTables& tables, const double* mass, const double* gravity,
                double* workspace, double* out);
};

// Doubles of workspace that any of the kernels needs.
[[nodiscard]] std::size_t information_workspace_size(std::size_t bearings, std::size_t motors);

// The kernel for vector_width().
[[nodiscard]] const InformationKernel& information_kernel();

}  // namespace graybox
