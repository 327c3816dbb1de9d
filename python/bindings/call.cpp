#include "python/bindings/call.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <utility>

namespace graybox::python {
namespace {

constexpr std::chrono::milliseconds kFirstLine{500}, kBetweenLines{200};

std::atomic<int> depth{0};
struct sigaction python_action {};

extern "C" void on_interrupt(int signal) {
  request_stop();
  python_action.sa_handler(signal);
}

bool takes_signals() { return getpid() == gettid(); }

struct OpenBlas {
  int (*threads)() = nullptr;
  void (*set_threads)(int) = nullptr;
};

// The library that is loaded already; nothing where BLAS is another one.
const OpenBlas& open_blas() {
  static const OpenBlas found = [] {
    OpenBlas blas;
    void* library = dlopen("libopenblas.so.0", RTLD_LAZY | RTLD_NOLOAD);
    if (library == nullptr) library = dlopen("libblas.so.3", RTLD_LAZY | RTLD_NOLOAD);
    if (library == nullptr) return blas;
    blas.threads = reinterpret_cast<int (*)()>(dlsym(library, "openblas_get_num_threads"));
    blas.set_threads = reinterpret_cast<void (*)(int)>(dlsym(library, "openblas_set_num_threads"));
    if (blas.threads == nullptr || blas.set_threads == nullptr) blas = {};
    return blas;
  }();
  return found;
}

}  // namespace

InterruptWatch::InterruptWatch() {
  if (!takes_signals() || depth.fetch_add(1) > 0) return;
  sigaction(SIGINT, nullptr, &python_action);
  if (python_action.sa_handler == SIG_DFL || python_action.sa_handler == SIG_IGN) return;
  struct sigaction action = python_action;
  action.sa_handler = &on_interrupt;
  sigaction(SIGINT, &action, nullptr);
  installed_ = true;
}

InterruptWatch::~InterruptWatch() {
  if (installed_) sigaction(SIGINT, &python_action, nullptr);
  if (takes_signals()) depth.fetch_sub(1);
}

OneBlasThread::OneBlasThread() {
  if (open_blas().threads == nullptr) return;
  threads_ = open_blas().threads();
  if (threads_ != 1) open_blas().set_threads(1);
}

OneBlasThread::~OneBlasThread() {
  if (threads_ > 1) open_blas().set_threads(threads_);
}

Call::Call(pybind11::object progress)
    : progress_(std::move(progress)), next_(std::chrono::steady_clock::now() + kFirstLine) {}

bool Call::proceed(const std::function<std::string()>& line) {
  if (stop_was_asked_for()) return false;
  if (progress_.is_none() || failure_) return !failure_;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return true;
  next_ = now + kBetweenLines;
  const pybind11::gil_scoped_acquire locked;
  try {
    progress_(line());
  } catch (...) {
    failure_ = std::current_exception();
    return false;
  }
  return true;
}

bool Call::interrupted() {
  const bool asked = stop_was_asked_for();
  if (asked) forget_stops();
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  if (PyErr_CheckSignals() == 0) return false;
  if (!PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) throw pybind11::error_already_set();
  PyErr_Clear();
  return true;
}

bool SolveWatch::on_progress(const TracePoint& point) {
  return call_.proceed([&] {
    return fmt::format("{}: iteration {}, gap {:.2e}, {:.1f} passes, {:.3g} s", solver_,
                       point.iteration, point.duality_gap, point.passes, point.seconds);
  });
}

bool ExactWatch::on_progress(const ExactProgress& progress) {
  return call_.proceed([&] {
    return fmt::format(
        "{}: {:.0f} s, {} nodes, {} open, log det {:.6f}, bound {:.6f}, efficiency "
        "at least {:.6f}",
        method_, progress.seconds, progress.nodes, progress.open, progress.log_det,
        progress.log_det_bound, progress.proven_efficiency);
  });
}

}  // namespace graybox::python
