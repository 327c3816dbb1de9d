// ExternalCommand: the command line of a user's program, and how its inputs are handed over.
//
// CMD is a line for /bin/sh. Placeholders in it stand for
//
//   {h5} {npy} {csv} {mat}   the file with the set, in the format named; one of them at most, or
//   {cbf}                    the problem itself, for conic solvers (cbf_file.hpp)
//   {design}                 the file to write
//   {gap} {seconds}          the duality gap asked for and the time there is ("inf": no limit)
//   {seed} {threads}         of the run
//
// Of set, design, gap and seconds, those that CMD names no place for are appended, in this order:
//
//   my_solver                    my_solver problem.h5 design.json GAP SECONDS
//   my_solver {npy} --fast       my_solver problem.npy --fast design.json GAP SECONDS
//   f --eval "run('{csv}', '{design}', {gap}, {seconds})"      nothing is appended
//
// A placeholder is replaced as text, so that it may stand between quotes of any language. Paths
// therefore must be free of what a shell reads as more than a letter. "${npy}" is left to the
// shell.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace graybox {

struct HandedOver {
  std::string set_file;
  std::string design_file;
  double duality_gap = 0.0;
  double seconds = 0.0;
  std::uint64_t seed = 1;
  int threads = 1;
};

class ExternalCommand {
 public:
  // Throws InputError if the command is blank or names two formats.
  explicit ExternalCommand(std::string text);

  [[nodiscard]] const std::string& text() const { return text_; }
  // The ending of the file that the set is to be written to: ".h5" unless CMD names another.
  [[nodiscard]] const std::string& set_ending() const { return set_ending_; }

  // Program and arguments to start. Throws InputError for a path that can't stand in a placeholder.
  [[nodiscard]] std::vector<std::string> words(const HandedOver& inputs) const;

 private:
  std::string text_;
  std::string set_ending_ = ".h5";
};

}  // namespace graybox
