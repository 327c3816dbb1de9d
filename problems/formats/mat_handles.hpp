// matio's files and variables, closed and freed when they go out of scope. Internal: matio's
// headers are included by what reads MAT files alone.
#pragma once

#include <matio.h>

#include <memory>

namespace graybox {

struct CloseMat {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, CloseMat>;
using MatVariable = std::unique_ptr<matvar_t, FreeVariable>;

}  // namespace graybox
