// Which vector instructions this processor has, decided once at run time. Every family of kernels
// that is compiled several times chooses by this one answer.
#pragma once

namespace graybox {

enum class VectorWidth { kGeneric, kAvx2, kAvx512 };

// The widest this processor runs; the environment variable GRAYBOX_KERNELS=generic|avx2|avx512
// chooses a narrower one (for tests; ignored if the processor lacks it).
[[nodiscard]] VectorWidth vector_width();

}  // namespace graybox
