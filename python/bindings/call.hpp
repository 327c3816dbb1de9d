// A call from Python into the library: without the interpreter's lock, with Ctrl-C and progress.
//
//   const Call call(progress);
//   Solution answer = call.run([&] { return solver.solve(set, options, &watch); });
//   return finished(call, ...);
//
// Ctrl-C asks the work to stop (problems/base/stop.hpp) and is handed on to Python's own handler.
// The work then hands over what it has; `interrupted()` says so, once Python has been asked.
// Progress is a callable of one line, called a few times a second from the second half second on.
// BLAS runs on one thread meanwhile, as in the command, so that both find the same digits.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <csignal>
#include <exception>
#include <functional>
#include <string>

#include "problems/base/stop.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/exact/exact_method.hpp"

namespace graybox::python {

// While it lives SIGINT asks the work to stop. Only in the thread in which Python takes signals.
class InterruptWatch {
 public:
  InterruptWatch();
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;

 private:
  bool installed_ = false;
};

// One thread for BLAS while it lives, where that is OpenBLAS.
class OneBlasThread {
 public:
  OneBlasThread();
  ~OneBlasThread();
  OneBlasThread(const OneBlasThread&) = delete;
  OneBlasThread& operator=(const OneBlasThread&) = delete;

 private:
  int threads_ = 0;
};

class Call {
 public:
  // `progress`: None or a callable of a line.
  explicit Call(pybind11::object progress);

  template <typename Work>
  auto run(Work&& work) {
    const InterruptWatch watch;
    const OneBlasThread blas;
    const pybind11::gil_scoped_release unlocked;
    return work();
  }

  // From the work: shows a line where it is time for one. False: stop.
  [[nodiscard]] bool proceed(const std::function<std::string()>& line);

  // After the work, with the lock: throws what the callable threw, and takes up a Ctrl-C, which is
  // then no longer pending. True where there was one.
  [[nodiscard]] bool interrupted();

 private:
  pybind11::object progress_;
  std::exception_ptr failure_;
  std::chrono::steady_clock::time_point next_;
};

class SolveWatch : public SolveObserver {
 public:
  SolveWatch(Call& call, std::string solver) : call_(call), solver_(std::move(solver)) {}
  bool on_progress(const TracePoint& point) override;

 private:
  Call& call_;
  std::string solver_;
};

class ExactWatch : public ExactObserver {
 public:
  ExactWatch(Call& call, std::string method) : call_(call), method_(std::move(method)) {}
  bool on_progress(const ExactProgress& progress) override;

 private:
  Call& call_;
  std::string method_;
};

}  // namespace graybox::python
