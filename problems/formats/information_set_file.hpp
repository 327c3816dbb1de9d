// Reading and writing information sets in any format graybox knows:
//
//   .h5, .hdf5   graybox-information-set/1 (hdf5_file.hpp): the only one that keeps the candidates'
//                coordinates, the parameters' names and the hash
//   .npy         NumPy array [Q x d x d], or [Q x p] packed (npy_file.hpp)
//   .csv, .txt   one packed matrix a line (csv_file.hpp)
//   .mat         MATLAB cell array of square matrices (mat_file.hpp)
//
// Factors F_i with H_i = F_i^T F_i (information_set.hpp) are read from HDF5 files that have them,
// and from .npy and .csv files where the caller says that these hold them: [Q x d], [Q x k x d].
// Only HDF5 files are written with factors; the others have no place to say so.
//
//   const graybox::InformationSet set = graybox::read_information_set("covdata.mat");
//   graybox::write_information_set("covdata.h5", set);
//
// The content hash does not depend on the format as long as it keeps 64 bits.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"

namespace graybox {

struct ReadOptions {
  std::string variable;  // which variable of a .mat file; empty: the only one that fits
  bool factors = false;  // a .npy or .csv file holds factors
};

// A pipe or `<(command)` is read, too: CSV, or a format that its first bytes tell.
//
// Recognises the format by the first bytes, then by the extension. All entries of the result are
// finite and its matrices symmetric; that they are positive semidefinite is left to
// InformationSet::validate(). Throws InputError with the file, the field and the fix.
[[nodiscard]] InformationSet read_information_set(const std::string& path,
                                                  const ReadOptions& options = {});

// Chooses the format by the extension. The file appears complete or not at all.
void write_information_set(const std::string& path, const InformationSet& set);

}  // namespace graybox
