// The compiled part of the package: what Python code in graybox/ calls. It has no names for users.
#include <pybind11/pybind11.h>

#include "cli/process/build_commit.hpp"
#include "diagnosis/estimation/quiet_ceres.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/base/shortened.hpp"
#include "problems/base/stop.hpp"
#include "problems/formats/quiet_hdf5.hpp"
#include "python/bindings/candidates.hpp"
#include "python/bindings/design.hpp"
#include "python/bindings/design_files.hpp"
#include "python/bindings/diagnosis.hpp"
#include "python/bindings/exact.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/machines.hpp"
#include "python/bindings/planning.hpp"
#include "python/bindings/robot_designs.hpp"
#include "python/bindings/robust.hpp"

namespace {

namespace py = pybind11;

constexpr std::size_t kLongestMessage = 1000;  // as the command has it

// The same line that the command prints.
std::string one_line(const std::string& text) {
  return graybox::shortened(text.substr(0, text.find('\n')), kLongestMessage);
}

void translate_errors(py::module_& module) {
  static py::exception<graybox::InputError> input_error(module, "InputError", PyExc_ValueError);
  input_error.doc() = "Bad input: one line that names what is wrong, and what mends it.";
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const graybox::InputError& error) {
      input_error(one_line(error.what()).c_str());
    } catch (const graybox::Stopped&) {
      const bool asked = graybox::stop_was_asked_for();
      graybox::forget_stops();
      if (PyErr_CheckSignals() != 0) return;  // KeyboardInterrupt is set
      PyErr_SetString(asked ? PyExc_KeyboardInterrupt : PyExc_TimeoutError,
                      "stopped before there was anything to hand over");
    }
  });
}

}  // namespace

PYBIND11_MODULE(_graybox, module) {
  graybox::set_program_commit(graybox::cli::kBuildCommit);
  graybox::silence_hdf5();
  graybox::silence_ceres();
  translate_errors(module);
  module.attr("version") = graybox::program_version();
  graybox::python::add_information(module);
  graybox::python::add_design(module);
  graybox::python::add_exact(module);
  graybox::python::add_design_files(module);
  graybox::python::add_candidates(module);
  graybox::python::add_planning(module);
  graybox::python::add_robust(module);
  graybox::python::add_robot_designs(module);
  graybox::python::add_diagnosis(module);
  graybox::python::add_machines(module);
}
