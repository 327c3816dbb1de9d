#include <gtest/gtest.h>
#include <hdf5.h>
#include <matio.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/families/families.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/formats/information_set_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::read_text;
using testing::TemporaryFolder;
using testing::write_text;

// A small set with every field filled in and coordinates that text would not keep exactly.
InformationSet sample_set(std::size_t dimension = 4, std::size_t candidates = 25) {
  const InformationSet drawn = make_family("rob", candidates, dimension, 3);
  AlignedArray information(drawn.candidate_count() * drawn.packed_size());
  std::copy(drawn.data(), drawn.data() + information.size(), information.begin());
  CandidateTable table{{"q1", "omega"}, {"deg", "rad/s"}, {}};
  for (std::size_t i = 0; i < candidates; ++i) {
    table.values.push_back(static_cast<double>(i) / 3.0);
    table.values.push_back(-1e-300 * static_cast<double>(i));
  }
  std::vector<std::string> parameters;
  for (std::size_t j = 0; j < dimension; ++j) parameters.push_back("k_" + std::to_string(j));
  return InformationSet(dimension, std::move(information), std::move(table), std::move(parameters),
                        "sample");
}

std::string error_of_reading(const std::string& path, const std::string& variable = {}) {
  try {
    static_cast<void>(read_information_set(path, {.variable = variable}));
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

// One line that names the file and contains each of the parts.
void expect_error(const std::string& path, const std::vector<std::string>& parts,
                  const std::string& variable = {}) {
  const std::string line = error_of_reading(path, variable);
  EXPECT_EQ(line.find(path), 0U) << line;
  EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  for (const std::string& part : parts) EXPECT_NE(line.find(part), std::string::npos) << line;
}

void append_number(std::string& bytes, double value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// A NumPy file made by hand.
std::string npy(const std::string& descr, const std::string& order, const std::string& shape,
                const std::vector<double>& values) {
  std::string header =
      "{'descr': '" + descr + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }";
  header.append(117 - header.size(), ' ');
  header += '\n';
  std::string bytes =
      std::string("\x93NUMPY\x01", 7) + '\0' + static_cast<char>(header.size()) + '\0' + header;
  for (const double value : values) append_number(bytes, value);
  return bytes;
}

// Writes a cell array (or another variable) with matio, version 5 or 7.3.
class MatWriter {
 public:
  MatWriter(const std::string& path, mat_ft version)
      : file_(Mat_CreateVer(path.c_str(), nullptr, version)) {}
  ~MatWriter() { Mat_Close(file_); }
  MatWriter(const MatWriter&) = delete;
  MatWriter& operator=(const MatWriter&) = delete;

  struct Matrix {
    std::vector<std::size_t> size;
    std::vector<double> values;
  };

  void cell(const char* name, const std::vector<Matrix>& matrices) {
    std::vector<std::size_t> size{matrices.size(), 1};
    matvar_t* cell = Mat_VarCreate(name, MAT_C_CELL, MAT_T_CELL, 2, size.data(), nullptr, 0);
    for (std::size_t i = 0; i < matrices.size(); ++i) {
      Mat_VarSetCell(cell, static_cast<int>(i), create(nullptr, matrices[i]));
    }
    Mat_VarWrite(file_, cell, MAT_COMPRESSION_ZLIB);
    Mat_VarFree(cell);
  }

  void numeric(const char* name, const Matrix& matrix) {
    matvar_t* variable = create(name, matrix);
    Mat_VarWrite(file_, variable, MAT_COMPRESSION_NONE);
    Mat_VarFree(variable);
  }

 private:
  static matvar_t* create(const char* name, Matrix matrix) {
    return Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, static_cast<int>(matrix.size.size()),
                         matrix.size.data(), matrix.values.data(), 0);
  }

  mat_t* file_;
};

std::vector<MatWriter::Matrix> full_matrices(const InformationSet& set) {
  const std::size_t d = set.dimension();
  std::vector<MatWriter::Matrix> matrices;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    matrices.push_back({{d, d}, std::vector<double>(d * d)});
    unpack(set.information(i).data(), d, matrices.back().values.data());
  }
  return matrices;
}

// ---- round trips -------------------------------------------------------------------------------

class RoundTrip : public ::testing::TestWithParam<const char*> {};

TEST_P(RoundTrip, KeepsEveryBit) {
  const TemporaryFolder folder;
  const std::string path = folder.file(std::string("set") + GetParam());
  for (const std::size_t dimension : {1U, 2U, 5U, 12U}) {
    const InformationSet set = sample_set(dimension, 7 + dimension);
    write_information_set(path, set);
    const InformationSet read = read_information_set(path);
    EXPECT_EQ(read.dimension(), dimension);
    EXPECT_EQ(read.content_hash(), set.content_hash());
    EXPECT_EQ(read.name(), path);
  }
  EXPECT_EQ(folder.file_count(), 1U) << "a temporary file was left";
}

TEST_P(RoundTrip, ReplacesAnOlderFileOnlyWhenComplete) {
  const TemporaryFolder folder;
  const std::string path = folder.file(std::string("set") + GetParam());
  write_text(path, "older");
  write_information_set(path, sample_set());
  EXPECT_EQ(read_information_set(path).content_hash(), sample_set().content_hash());
  EXPECT_EQ(folder.file_count(), 1U);
}

TEST_P(RoundTrip, SaysWhenTheFolderIsMissing) {
  const TemporaryFolder folder;
  const std::string path = folder.file(std::string("nowhere/set") + GetParam());
  EXPECT_THROW(write_information_set(path, sample_set()), InputError);
  EXPECT_EQ(folder.file_count(), 0U);
}

TEST_P(RoundTrip, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file(std::string("set") + GetParam());
  write_information_set(path, sample_set());
  const std::string bytes = read_text(path);
  // Cut at the end by less than a number, in the middle, and down to nothing. (A text file cut
  // inside its last number is still a text file of numbers, so CSV loses whole fields here.)
  const std::size_t last = std::string(GetParam()) == ".csv" ? 200 : 3;
  for (const std::size_t size : {bytes.size() - last, bytes.size() / 2, std::size_t{130},
                                 std::size_t{20}, std::size_t{6}, std::size_t{0}}) {
    const std::size_t line_end = bytes.find('\n');
    if (std::string(GetParam()) == ".csv" && bytes[size] == '\n' && size > line_end) continue;
    write_text(path, bytes.substr(0, size));
    expect_error(path, {});
  }
}

INSTANTIATE_TEST_SUITE_P(AllFormats, RoundTrip, ::testing::Values(".h5", ".npy", ".csv", ".mat"),
                         [](const auto& tested) { return std::string(tested.param).substr(1); });

TEST(Formats, Hdf5KeepsCoordinatesUnitsAndNames) {
  const TemporaryFolder folder;
  const InformationSet set = sample_set();
  write_information_set(folder.file("set.h5"), set);
  const InformationSet read = read_information_set(folder.file("set.h5"));
  EXPECT_EQ(read.candidates().names, set.candidates().names);
  EXPECT_EQ(read.candidates().units, set.candidates().units);
  EXPECT_EQ(read.candidates().values, set.candidates().values);
  EXPECT_EQ(read.parameters(), set.parameters());
}

TEST(Formats, ContentDecidesBeforeTheExtension) {
  const TemporaryFolder folder;
  write_information_set(folder.file("set.npy"), sample_set());
  std::filesystem::rename(folder.file("set.npy"), folder.file("set.data"));
  EXPECT_EQ(read_information_set(folder.file("set.data")).content_hash(),
            sample_set().content_hash());
}

// ---- errors common to all ----------------------------------------------------------------------

TEST(Formats, MissingFoldersAndUnknownFilesAreNamed) {
  const TemporaryFolder folder;
  expect_error(folder.file("none.h5"), {"can't be opened", "No such file"});
  std::filesystem::create_directory(folder.file("folder.h5"));
  expect_error(folder.file("folder.h5"), {"no regular file"});
  write_text(folder.file("empty.csv"), "");
  expect_error(folder.file("empty.csv"), {"empty"});
  write_text(folder.file("set.xyz"), "hello");
  expect_error(folder.file("set.xyz"), {"unknown format", ".h5, .npy, .csv or .mat"});
  EXPECT_THROW(write_information_set(folder.file("set.xyz"), sample_set()), InputError);
  for (const char* name : {"text.h5", "text.npy", "text.mat"}) {
    write_text(folder.file(name), std::string(500, 'x'));
    expect_error(folder.file(name), {"no "});
  }
}

TEST(Formats, AVariableMakesSenseForMatFilesOnly) {
  const TemporaryFolder folder;
  write_information_set(folder.file("set.npy"), sample_set());
  expect_error(folder.file("set.npy"), {".mat files only"}, "Hi");
}

// ---- CSV ---------------------------------------------------------------------------------------

TEST(Csv, ReadsWhatPeopleWrite) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.csv");
  const std::string expected = [&] {
    write_text(path, "1,0.5,2\n3,-0.25,4e0\n");
    return read_information_set(path).content_hash();
  }();
  for (const char* text :
       {"a,b,c\n1,0.5,2\n3,-0.25,4\n",                        // header
        "\xEF\xBB\xBFH11;H21;H22\r\n1;.5;2\r\n3;-.25;4\r\n",  // BOM, semicolons, CRLF
        "# numpy header\n1 0.5  2\n\n 3\t-0.25 +4",           // blanks, no newline at the end
        "1 , 0.5 , 2 \n 3 , -0.25 , 4"}) {
    write_text(path, text);
    EXPECT_EQ(read_information_set(path).content_hash(), expected) << text;
  }
}

TEST(Csv, ErrorsNameLineAndField) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.csv");
  const auto expect = [&](const char* text, const std::vector<std::string>& parts) {
    write_text(path, text);
    expect_error(path, parts);
  };
  expect("1,0,1\n1,zero,1\n", {"line 2, column 2", "'zero' is no number"});
  expect("h\n1,0,1\n1,nan,1\n", {"line 3, column 2", "not finite"});
  expect("1,0,1\n1,0,1e999\n", {"line 2, column 3", "not finite"});
  expect("1,0,1\n1,0\n", {"line 2", "2 numbers", "3 in the first"});
  expect("1,0,1\n1,0,1,\n", {"line 2, column 4", "'' is no number"});
  expect("1,0\n", {"2 numbers a line", "no packed size"});
  expect("a,b,c\n", {"no candidates"});
  expect("# only a comment\n\n", {"no candidates"});
}

// ---- NPY ---------------------------------------------------------------------------------------

TEST(Npy, ReadsFullAndPackedInBothOrders) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.npy");
  // Two candidates: [1 2; 2 5] and [3 -1; -1 4].
  const std::vector<std::vector<double>> contents{{1, 2, 2, 5, 3, -1, -1, 4},
                                                  {1, 3, 2, -1, 2, -1, 5, 4},
                                                  {1, 2, 5, 3, -1, 4},
                                                  {1, 3, 2, -1, 5, 4}};
  const std::vector<std::vector<std::string>> headers{
      {"False", "(2, 2, 2)"}, {"True", "(2, 2, 2)"}, {"False", "(2, 3)"}, {"True", "(2, 3)"}};
  for (std::size_t k = 0; k < contents.size(); ++k) {
    write_text(path, npy("<f8", headers[k][0], headers[k][1], contents[k]));
    const InformationSet set = read_information_set(path);
    ASSERT_EQ(set.dimension(), 2U);
    const std::vector<double> packed(set.data(), set.data() + 6);
    EXPECT_EQ(packed, (std::vector<double>{1, 2, 5, 3, -1, 4})) << headers[k][0] << headers[k][1];
  }
}

TEST(Npy, ErrorsNameWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.npy");
  const auto expect = [&](const std::string& bytes, const std::vector<std::string>& parts) {
    write_text(path, bytes);
    expect_error(path, parts);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> eight{1, 0, 0, 1, 1, 0, 0, 1};
  expect(npy(">f8", "False", "(2, 2, 2)", eight), {"dtype '>f8'", "astype"});
  expect(npy("<i8", "False", "(2, 2, 2)", eight), {"dtype '<i8'"});
  expect(npy("|O", "False", "(2, 2, 2)", eight), {"dtype '|O'"});
  expect(npy("<f8", "False", "(2, 2, 3)", eight), {"(2, 2, 3)", "not square"});
  expect(npy("<f8", "False", "(2, 4)", eight), {"4 is no packed size"});
  expect(npy("<f8", "False", "(8,)", eight), {"(8)", "wrong number of axes"});
  expect(npy("<f8", "False", "(0, 2, 2)", {}), {"no candidates"});
  expect(npy("<f8", "False", "(3, 2, 2)", eight), {"truncated", "96 bytes, 64 are there"});
  expect(npy("<f8", "False", "(4611686018427387904, 2, 2)", eight), {"truncated"});
  expect(npy("<f8", "False", "(2, 2, 2)", {1, 0, 0, 1, 1, 0.5, 0.25, 1}),
         {"candidate 1", "not symmetric", "2.5e-01"});
  expect(npy("<f8", "False", "(2, 2, 2)", {1, 0, 0, 1, 1, nan, nan, 1}),
         {"candidate 1", "entry (1, 0) is nan"});
  expect(npy("<f8", "False", "(2, 3)", {1, 0, 1, nan, 0, 1}), {"candidate 1", "entry (0, 0)"});
}

TEST(Npy, RoundingAsymmetryIsAveraged) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.npy");
  const double above = 1.0 + 1e-15;
  write_text(path, npy("<f8", "False", "(1, 2, 2)", {1e6, above, 1.0, 1e-6}));
  const double kept = read_information_set(path).information(0)[1];
  EXPECT_GE(kept, 1.0);
  EXPECT_LE(kept, above);
  // The tolerance follows the diagonal, so parameters may have any units.
  write_text(path, npy("<f8", "False", "(1, 2, 2)", {1e6, 1e-9, 0.0, 1e-24}));
  expect_error(path, {"not symmetric"});
}

// ---- HDF5 --------------------------------------------------------------------------------------

// Changes one thing of a good file.
class Hdf5Damage : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = folder_.file("set.h5");
    write_information_set(path_, sample_set());
    file_ = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file_, 0);
  }

  void replace_information(const std::vector<hsize_t>& shape, hid_t type) {
    H5Ldelete(file_, "information", H5P_DEFAULT);
    const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);  // zeros that are there
    H5Dclose(H5Dcreate2(file_, "information", type, space, H5P_DEFAULT, creation, H5P_DEFAULT));
    H5Pclose(creation);
    H5Sclose(space);
  }

  void write_number(hsize_t row, hsize_t column, double value) {
    const hid_t dataset = H5Dopen2(file_, "information", H5P_DEFAULT);
    const hid_t space = H5Dget_space(dataset);
    const hsize_t at[2] = {row, column};
    H5Sselect_elements(space, H5S_SELECT_SET, 1, at);
    const hid_t one = H5Screate(H5S_SCALAR);
    H5Dwrite(dataset, H5T_NATIVE_DOUBLE, one, space, H5P_DEFAULT, &value);
    H5Sclose(one);
    H5Sclose(space);
    H5Dclose(dataset);
  }

  void expect(const std::vector<std::string>& parts) {
    H5Fclose(file_);
    expect_error(path_, parts);
  }

  TemporaryFolder folder_;
  std::string path_;
  hid_t file_ = -1;
};

TEST_F(Hdf5Damage, HashOfChangedDataDoesNotMatch) {
  write_number(3, 0, 17.0);
  expect({"sha256", "changed after writing"});
}

TEST_F(Hdf5Damage, NanIsNamedBeforeTheHash) {
  write_number(3, 4, std::numeric_limits<double>::quiet_NaN());
  expect({"information", "candidate 3", "entry (2, 1) is nan"});
}

TEST_F(Hdf5Damage, FormatIsMissing) {
  H5Adelete(file_, "format");
  expect({"attribute format is missing", "graybox-information-set/1"});
}

TEST_F(Hdf5Damage, InformationIsMissing) {
  H5Ldelete(file_, "information", H5P_DEFAULT);
  expect({"dataset information is missing"});
}

TEST_F(Hdf5Damage, IntegersAreRefused) {
  replace_information({25, 10}, H5T_STD_I32LE);
  expect({"information", "float64"});
}

TEST_F(Hdf5Damage, WrongPackedSize) {
  replace_information({25, 11}, H5T_IEEE_F64LE);
  expect({"[25 x 11]", "11 is no packed size"});
}

TEST_F(Hdf5Damage, NotSquare) {
  replace_information({25, 4, 5}, H5T_IEEE_F64LE);
  expect({"[25 x 4 x 5]", "not square"});
}

TEST_F(Hdf5Damage, NoCandidates) {
  replace_information({0, 10}, H5T_IEEE_F64LE);
  expect({"no candidates"});
}

TEST_F(Hdf5Damage, CandidatesOfAnotherCount) {
  replace_information({24, 10}, H5T_IEEE_F64LE);
  expect({"candidates", "[25 x 2]", "24 candidates"});
}

TEST_F(Hdf5Damage, ParametersOfAnotherDimension) {
  replace_information({25, 15}, H5T_IEEE_F64LE);
  expect({"parameters", "4 names for d = 5"});
}

TEST_F(Hdf5Damage, TheHashMayBeMissing) {
  H5Adelete(file_, "sha256");
  H5Fclose(file_);
  EXPECT_EQ(read_information_set(path_).content_hash(), sample_set().content_hash());
}

// ---- MAT ---------------------------------------------------------------------------------------

class MatVersions : public ::testing::TestWithParam<mat_ft> {
 protected:
  [[nodiscard]] std::string path() const { return folder_.file("set.mat"); }
  void expect(const std::vector<MatWriter::Matrix>& cell, const std::vector<std::string>& parts) {
    MatWriter(path(), GetParam()).cell("Hi", cell);
    expect_error(path(), parts);
  }

  TemporaryFolder folder_;
};

TEST_P(MatVersions, ReadsTheOnlyCellArray) {
  {
    MatWriter writer(path(), GetParam());
    writer.numeric("lambda", {{2, 1}, {0.5, 0.5}});
    writer.cell("Hi", full_matrices(sample_set()));
  }
  EXPECT_EQ(read_information_set(path()).content_hash(), sample_set().content_hash());
}

TEST_P(MatVersions, ReadsANumericStack) {
  const InformationSet set = sample_set();
  MatWriter::Matrix stack{{4, 4, set.candidate_count()}, {}};
  for (const auto& matrix : full_matrices(set)) {
    stack.values.insert(stack.values.end(), matrix.values.begin(), matrix.values.end());
  }
  MatWriter(path(), GetParam()).numeric("H", stack);
  EXPECT_EQ(read_information_set(path()).content_hash(), set.content_hash());
}

TEST_P(MatVersions, AsksWhichOfSeveral) {
  const InformationSet second = sample_set(3, 9);
  {
    MatWriter writer(path(), GetParam());
    writer.cell("first", full_matrices(sample_set()));
    writer.cell("second", full_matrices(second));
    writer.numeric("other", {{2, 2}, {1, 0, 0, 1}});
  }
  expect_error(path(), {"first, second", "--variable"});
  expect_error(path(), {"variable third", "choose first, second"}, "third");
  expect_error(path(), {"variable other"}, "other");
  EXPECT_EQ(read_information_set(path(), {.variable = "second"}).content_hash(),
            second.content_hash());
}

TEST_P(MatVersions, NothingFits) {
  MatWriter(path(), GetParam()).numeric("lambda", {{2, 1}, {0.5, 0.5}});
  expect_error(path(), {"no variable is a cell array"});
}

TEST_P(MatVersions, ErrorsNameTheCandidate) {
  const MatWriter::Matrix good{{2, 2}, {1, 0, 0, 1}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect({good, {{2, 1}, {1, 0}}}, {"variable Hi", "candidate 1", "not square"});
  expect({good, {{1, 1}, {1}}}, {"candidate 1", "all must be of one size"});
  expect({good, {{2, 2}, {1, 0.5, 0, 1}}}, {"candidate 1", "not symmetric", "5.0e-01"});
  expect({good, good, {{2, 2}, {1, 0, 0, nan}}}, {"candidate 2", "entry (1, 1) is nan"});
}

INSTANTIATE_TEST_SUITE_P(Versions, MatVersions, ::testing::Values(MAT_FT_MAT5, MAT_FT_MAT73),
                         [](const auto& tested) {
                           return tested.param == MAT_FT_MAT5 ? "level_5" : "level_7_3";
                         });

// ---- files of other programs -------------------------------------------------------------------

// Runs a script with the system's Python.
bool run_python(const std::string& script, const std::string& folder) {
  const std::string command = "/usr/bin/python3 '" + script + "' '" + folder + "' 2>/dev/null";
  return std::system(command.c_str()) == 0;
}

bool python_has(const std::string& modules) {
  return std::system(("/usr/bin/python3 -c 'import " + modules + "' 2>/dev/null").c_str()) == 0;
}

TEST(OtherPrograms, ReadsWhatNumpyAndH5pyWrite) {
  if (!python_has("numpy, h5py")) GTEST_SKIP() << "/usr/bin/python3 lacks numpy or h5py";
  const TemporaryFolder folder;
  write_text(folder.file("make.py"), R"(
import sys, numpy as np, h5py
out = sys.argv[1]
rng = np.random.default_rng(1)
g = rng.normal(size=(40, 5, 5))
h = g @ g.transpose(0, 2, 1)
h = (h + h.transpose(0, 2, 1)) / 2
lower = np.tril_indices(5)
packed = h[:, lower[0], lower[1]]
np.save(out + '/full.npy', h)
np.save(out + '/full_fortran.npy', np.asfortranarray(h))
np.save(out + '/packed.npy', packed)
np.save(out + '/packed_fortran.npy', np.asfortranarray(packed))
np.save(out + '/single.npy', h.astype('<f4'))
np.savetxt(out + '/packed.csv', packed, delimiter=',', fmt='%.17g', header='numbers')
with h5py.File(out + '/set.h5', 'w') as f:
    f.attrs['format'] = 'graybox-information-set/1'
    f['information'] = packed
    f['candidates'] = np.arange(80.0).reshape(40, 2)
    f['candidates'].attrs['names'] = ['a', 'b']
    f['candidates'].attrs['units'] = np.array([b'rad', b'm'])
    f['parameters'] = ['p1', 'p2', 'p3', 'p4', 'p5']
with h5py.File(out + '/chunked.h5', 'w') as f:
    f.attrs['format'] = np.bytes_('graybox-information-set/1')
    f.create_dataset('information', data=h, chunks=(7, 5, 5), compression='gzip')
with h5py.File(out + '/matlab.mat', 'w', userblock_size=512) as f:
    group = f.create_group('#refs#')
    refs = np.empty((40, 1), dtype=h5py.ref_dtype)
    for i in range(40):
        d = group.create_dataset('m%03d' % i, data=h[i])
        d.attrs['MATLAB_class'] = np.bytes_('double')
        refs[i, 0] = d.ref
    c = f.create_dataset('Hi', data=refs, dtype=h5py.ref_dtype)
    c.attrs['MATLAB_class'] = np.bytes_('cell')
with open(out + '/matlab.mat', 'r+b') as b:
    b.write(b'MATLAB 7.3 MAT-file'.ljust(124, b' ') + b'\x00\x02IM')
)");
  ASSERT_TRUE(run_python(folder.file("make.py"), folder.file("")));
  const std::string expected = read_information_set(folder.file("full.npy")).content_hash();
  for (const char* name : {"full_fortran.npy", "packed.npy", "packed_fortran.npy", "packed.csv",
                           "set.h5", "chunked.h5", "matlab.mat"}) {
    EXPECT_EQ(read_information_set(folder.file(name)).content_hash(), expected) << name;
  }
  const InformationSet set = read_information_set(folder.file("set.h5"));
  EXPECT_EQ(set.candidates().units, (std::vector<std::string>{"rad", "m"}));
  EXPECT_EQ(set.coordinates(39)[1], 79.0);
  EXPECT_EQ(set.parameters().back(), "p5");
  const InformationSet single = read_information_set(folder.file("single.npy"));
  for (std::size_t k = 0; k < single.candidate_count() * single.packed_size(); ++k) {
    EXPECT_EQ(single.data()[k], static_cast<double>(static_cast<float>(set.data()[k])));
  }
}

TEST(OtherPrograms, ReadsWhatScipyWrites) {
  if (!python_has("scipy.io")) GTEST_SKIP() << "/usr/bin/python3 lacks scipy";
  const TemporaryFolder folder;
  write_information_set(folder.file("set.mat"), sample_set());
  write_text(folder.file("make.py"), R"(
import sys, numpy as np, scipy.io
out = sys.argv[1]
cell = scipy.io.loadmat(out + '/set.mat')['Hi']
assert cell.shape == (1, 25) and all(np.array_equal(h, h.T) for h in cell[0])
scipy.io.savemat(out + '/cell.mat', {'Hi': cell, 'lambda': np.ones(25)}, do_compression=True)
scipy.io.savemat(out + '/stack.mat', {'H': np.stack(cell[0], axis=2)})
)");
  ASSERT_TRUE(run_python(folder.file("make.py"), folder.file("")));
  for (const char* name : {"cell.mat", "stack.mat"}) {
    EXPECT_EQ(read_information_set(folder.file(name)).content_hash(), sample_set().content_hash())
        << name;
  }
}

TEST(OtherPrograms, ReadOurFiles) {
  if (!python_has("numpy, h5py")) GTEST_SKIP() << "/usr/bin/python3 lacks numpy or h5py";
  const TemporaryFolder folder;
  const InformationSet set = sample_set();
  for (const char* name : {"set.h5", "set.npy", "set.csv"}) {
    write_information_set(folder.file(name), set);
  }
  // The hash is computed independently, as design and header state it.
  write_text(folder.file("check.py"), R"(
import sys, struct, hashlib, numpy as np, h5py
out = sys.argv[1]
f = h5py.File(out + '/set.h5', 'r')
packed = f['information'][:]
text = lambda value: value.decode() if isinstance(value, bytes) else value
d = 4
digest = hashlib.sha256(struct.pack('<QQ', packed.shape[0], d) + packed.astype('<f8').tobytes())
assert digest.hexdigest() == text(f.attrs['sha256'])
assert [text(u) for u in f['candidates'].attrs['units']] == ['deg', 'rad/s']
assert [n.decode() for n in f['parameters']] == ['k_0', 'k_1', 'k_2', 'k_3']
assert np.array_equal(np.load(out + '/set.npy'), packed)
assert np.array_equal(np.loadtxt(out + '/set.csv', delimiter=',', skiprows=1), packed)
)");
  EXPECT_TRUE(run_python(folder.file("check.py"), folder.file("")));
}

TEST(AtomicFile, LeavesTheOldFileUnlessCommitted) {
  const TemporaryFolder folder;
  write_text(folder.file("kept"), "old");
  {
    const AtomicFile file(folder.file("kept"));
    write_text(file.temporary(), "half");
  }
  EXPECT_EQ(read_text(folder.file("kept")), "old");
  EXPECT_EQ(folder.file_count(), 1U);
  write_text_file(folder.file("kept"), "new");
  EXPECT_EQ(read_text(folder.file("kept")), "new");
}

}  // namespace
}  // namespace graybox
