#include "solvers/ipopt/ipopt_run.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <IpIpoptApplication.hpp>
#include <IpIpoptCalculatedQuantities.hpp>
#include <IpIpoptData.hpp>
#include <IpOrigIpoptNLP.hpp>
#include <IpTNLPAdapter.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <numeric>
#include <semaphore>
#include <string>
#include <thread>
#include <utility>

#include "problems/base/stop.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox::ipopt {
namespace {

constexpr int kDefaultIterationLimit = 3000;
constexpr int kStarts = 6;
constexpr std::chrono::milliseconds kLook{10};       // how often the caller looks at the clock
constexpr std::chrono::milliseconds kPatience{200};  // with a factorisation after time is up

// MUMPS, for one run at a time. Whichever thread holds it last gives it back.
class Turn {
 public:
  // Waits until it comes, or until this thread's time is up.
  Turn() {
    while (!(has_come_ = free().try_acquire_for(kLook)) && !stop_requested()) {
    }
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  ~Turn() {
    if (has_come_) free().release();
  }
  [[nodiscard]] bool has_come() const { return has_come_; }

 private:
  static std::binary_semaphore& free() {
    static std::binary_semaphore semaphore{1};
    return semaphore;
  }
  bool has_come_ = false;
};

// Ends a process that has left a factorisation behind. It goes on until the very end, and the
// destructors of the linear algebra libraries would take its memory away.
void end_without_destructors(int exit_code, void*) {
  std::cout.flush();
  std::fflush(nullptr);
  _exit(exit_code);
}

void leave_behind(std::thread& thread) {
#ifdef __GLIBC__
  [[maybe_unused]] static const int registered = on_exit(end_without_destructors, nullptr);
#endif
  thread.detach();
}

std::string_view reason(Ipopt::ApplicationReturnStatus status) {
  switch (status) {
    case Ipopt::Solve_Succeeded:
    case Ipopt::Solved_To_Acceptable_Level:
      return "Ipopt reports success";
    case Ipopt::Infeasible_Problem_Detected:
      return "Ipopt reports an infeasible problem";
    case Ipopt::Search_Direction_Becomes_Too_Small:
      return "Ipopt's search direction vanished";
    case Ipopt::Diverging_Iterates:
      return "Ipopt's iterates diverged";
    case Ipopt::User_Requested_Stop:
      return "stopped";
    case Ipopt::Maximum_Iterations_Exceeded:
      return "Ipopt reached its iteration limit";
    case Ipopt::Restoration_Failed:
      return "Ipopt's restoration phase failed";
    case Ipopt::Error_In_Step_Computation:
      return "Ipopt could not compute a step";
    case Ipopt::Invalid_Number_Detected:
      return "Ipopt met an invalid number";
    case Ipopt::Insufficient_Memory:
      return "out of memory";
    default:
      return "Ipopt failed";
  }
}

}  // namespace

// One solve: the best weights so far, and what the callback decided. Ipopt runs on a thread of its
// own, because nothing stops MUMPS in the middle of a factorisation; the caller's thread waits, and
// leaves the other behind where that does not end in time. From then on the session answers every
// question with "stop" and touches nothing of the caller's: it owns all else, and the thread owns
// the session.
class Session {
 public:
  Session(const InformationSet& set, const SolveOptions& options, Tracer& tracer)
      : set_(set),
        options_(options),
        tracer_(&tracer),
        normalized_(set, {.scale_rows = false, .threads = options.threads}),
        iteration_limit_(options.iteration_limit > 0 ? options.iteration_limit
                                                     : kDefaultIterationLimit),
        best_(set.candidate_count(), 1.0 / static_cast<double>(set.candidate_count())),
        candidate_(set.candidate_count()) {
    tracer.count_passes(normalized_.passes());
  }

  // On the caller's thread.
  [[nodiscard]] const NormalizedSet& normalized() const { return normalized_; }
  void judge_start();
  // True once work() is done; waits so long for it.
  [[nodiscard]] bool done_after(std::chrono::milliseconds wait);
  [[nodiscard]] bool out_of_time();
  [[nodiscard]] Solution finish(bool is_done);

  // On the thread of Ipopt: starts it as often as that helps.
  void work(MakeForm make_form);

  // Judges an iterate; false asks Ipopt to stop.
  bool consider(const Form& form, const double* variables, const double* multipliers,
                bool new_iteration);
  void count_pass();

 private:
  [[nodiscard]] Ipopt::ApplicationReturnStatus start(MakeForm make_form);
  void run_starts(MakeForm make_form);
  void judge(std::span<double> weights);
  [[nodiscard]] bool met() const { return best_gap_ <= options_.duality_gap; }
  [[nodiscard]] Solution answer(SolveStatus status, std::string message = {}) {
    return tracer_->finish({best_}, status, iterations_, std::move(message));
  }

  std::mutex guard_;  // of what both threads use
  std::condition_variable end_;
  bool done_ = false;
  const InformationSet& set_;  // not after it was left behind
  SolveOptions options_;
  Tracer* tracer_;  // null once left behind
  NormalizedSet normalized_;
  std::int64_t iteration_limit_;
  std::int64_t iterations_ = 0;
  std::vector<double> best_;
  double best_gap_ = std::numeric_limits<double>::infinity();
  std::vector<double> candidate_;
  Ipopt::ApplicationReturnStatus status_ = Ipopt::Internal_Error;
  bool out_of_memory_ = false;
};

void Session::judge(std::span<double> weights) {
  for (double& weight : weights) weight = std::max(weight, 0.0);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0) || !std::isfinite(sum)) return;
  for (double& weight : weights) weight /= sum;
  const double gap = duality_gap(set_, weights);
  tracer_->count_passes(2.0);
  tracer_->record(gap, iterations_);
  if (gap < best_gap_) {
    best_gap_ = gap;
    std::ranges::copy(weights, best_.begin());
  }
}

void Session::judge_start() {
  candidate_ = best_;
  judge(candidate_);
}

bool Session::consider(const Form& form, const double* variables, const double* multipliers,
                       bool new_iteration) {
  const std::lock_guard lock(guard_);
  if (tracer_ == nullptr) return false;
  if (new_iteration) ++iterations_;
  form.weights_of(variables, multipliers, candidate_);
  judge(candidate_);
  return !met() && !tracer_->out_of_time() && iterations_ < iteration_limit_;
}

bool Session::out_of_time() {
  const std::lock_guard lock(guard_);
  return tracer_ == nullptr || tracer_->out_of_time();
}

void Session::count_pass() {
  const std::lock_guard lock(guard_);
  if (tracer_ != nullptr) tracer_->count_passes(1.0);
}

Ipopt::ApplicationReturnStatus Session::start(MakeForm make_form) {
  const auto q = static_cast<double>(normalized_.candidate_count());
  const auto d = static_cast<double>(normalized_.dimension());
  // On the central path the gap is Q mu / d. The first start begins where that is 1.
  const double gap = std::clamp(best_gap_, 1e-15, 10.0);
  const double barrier = 0.1 * gap * d / q;
  const double final_barrier = 1e-3 * options_.duality_gap * d / q;

  Form* raw_form = make_form(normalized_);
  const Ipopt::SmartPtr<Ipopt::TNLP> form = raw_form;
  raw_form->attach(*this);
  raw_form->start_from(best_, best_gap_, barrier);

  const Ipopt::SmartPtr<Ipopt::IpoptApplication> application =
      new Ipopt::IpoptApplication(/*create_console_out=*/false);
  const auto& set_options = application->Options();
  set_options->SetIntegerValue("print_level", 0);
  set_options->SetStringValue("sb", "yes");
  set_options->SetStringValue("linear_solver", "mumps");
  // The forms scale themselves.
  set_options->SetStringValue("nlp_scaling_method", "none");
  set_options->SetStringValue("mu_strategy", "monotone");
  set_options->SetNumericValue("mu_init", barrier);
  set_options->SetNumericValue("mu_max", 1e3);
  set_options->SetNumericValue("mu_min", 1e-3 * final_barrier);
  set_options->SetNumericValue("tol", final_barrier);
  set_options->SetNumericValue("dual_inf_tol", 1e-3 * options_.duality_gap);
  set_options->SetNumericValue("constr_viol_tol", 1e-3 * options_.duality_gap);
  set_options->SetNumericValue("compl_inf_tol", final_barrier);
  set_options->SetIntegerValue("acceptable_iter", 0);
  set_options->SetIntegerValue("max_iter", static_cast<Ipopt::Index>(std::min<std::int64_t>(
                                               iteration_limit_ - iterations_, 1000000)));
  // Bounds are exact, and a start close to them is meant to be there.
  set_options->SetNumericValue("bound_relax_factor", 0.0);
  for (const char* push : {"bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"}) {
    set_options->SetNumericValue(push, 1e-14);
  }
  set_options->SetStringValue("bound_mult_init_method", "mu-based");
  set_options->SetNumericValue("mumps_mem_percent", 100);
  // Quasi-dense minimum degree: it alone of the orderings finds the order that is linear in Q for
  // both sparse forms. The automatic choice does not for ipopt_dual, and PORD ends the process on
  // the dense form.
  set_options->SetIntegerValue("mumps_pivot_order", 6);
  // The empty name keeps Ipopt from reading ipopt.opt in the working directory.
  const Ipopt::ApplicationReturnStatus status = application->Initialize("");
  return status == Ipopt::Solve_Succeeded ? application->OptimizeTNLP(form) : status;
}

void Session::run_starts(MakeForm make_form) {
  for (int number = 0; number < kStarts && !met(); ++number) {
    if (out_of_time() || iterations_ >= iteration_limit_) return;
    const double before = best_gap_;
    status_ = start(make_form);
    if (!met() && number > 0 && !(best_gap_ <= 0.5 * before)) return;
  }
}

void Session::work(MakeForm make_form) {
  try {
    run_starts(make_form);
  } catch (const std::bad_alloc&) {
    out_of_memory_ = true;
  }
  const std::lock_guard lock(guard_);
  done_ = true;
  end_.notify_all();
}

bool Session::done_after(std::chrono::milliseconds wait) {
  std::unique_lock lock(guard_);
  return end_.wait_for(lock, wait, [&] { return done_; });
}

Solution Session::finish(bool is_done) {
  const std::lock_guard lock(guard_);
  Solution solution = [&] {
    if (met()) return answer(SolveStatus::kSolved);
    if (!is_done || tracer_->out_of_time()) return answer(SolveStatus::kTimeLimit);
    if (out_of_memory_) return answer(SolveStatus::kNumericalFailure, "out of memory");
    if (iterations_ >= iteration_limit_) return answer(SolveStatus::kIterationLimit);
    return answer(SolveStatus::kNumericalFailure,
                  fmt::format("{}, but the duality gap is {:.2g}", reason(status_), best_gap_));
  }();
  tracer_ = nullptr;
  return solution;
}

void Form::sum_candidates(std::span<const double> factors, std::span<double> packed) const {
  std::ranges::fill(packed, 0.0);
  kernels().accumulate(set_.rows(), set_.candidate_count(), set_.packed_size(), factors.data(),
                       packed.data());
  session_->count_pass();
}

void Form::price_candidates(std::span<const double> trace_dual, double* out) const {
  kernels().price(set_.rows(), set_.candidate_count(), set_.packed_size(), trace_dual.data(), out);
  session_->count_pass();
}

void Form::count_pass() const { session_->count_pass(); }

bool Form::interrupted() const { return session_->out_of_time(); }

bool Form::intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration, Ipopt::Number,
                                 Ipopt::Number, Ipopt::Number, Ipopt::Number, Ipopt::Number,
                                 Ipopt::Number, Ipopt::Number, Ipopt::Number, Ipopt::Index,
                                 const Ipopt::IpoptData* data,
                                 Ipopt::IpoptCalculatedQuantities* quantities) {
  if (data == nullptr || quantities == nullptr) return true;
  auto* nlp = dynamic_cast<Ipopt::OrigIpoptNLP*>(Ipopt::GetRawPtr(quantities->GetIpoptNLP()));
  // In the restoration phase the iterate belongs to another problem.
  if (mode == Ipopt::RestorationPhaseMode || nlp == nullptr) return !session_->out_of_time();
  auto* adapter = dynamic_cast<Ipopt::TNLPAdapter*>(Ipopt::GetRawPtr(nlp->nlp()));
  if (adapter == nullptr) return !session_->out_of_time();
  Ipopt::Index variable_count = 0, constraint_count = 0, jacobian_size = 0, hessian_size = 0;
  IndexStyleEnum style = C_STYLE;
  get_nlp_info(variable_count, constraint_count, jacobian_size, hessian_size, style);
  variables_.resize(static_cast<std::size_t>(variable_count));
  multipliers_.resize(static_cast<std::size_t>(constraint_count));
  const auto current = data->curr();
  adapter->ResortX(*current->x(), variables_.data());
  adapter->ResortG(*current->y_c(), *current->y_d(), multipliers_.data());
  return session_->consider(*this, variables_.data(), multipliers_.data(), iteration > 0);
}

void Form::finalize_solution(Ipopt::SolverReturn, Ipopt::Index, const Ipopt::Number*,
                             const Ipopt::Number*, const Ipopt::Number*, Ipopt::Index,
                             const Ipopt::Number*, const Ipopt::Number*, Ipopt::Number,
                             const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) {
  // Every iterate has been judged on its way.
}

Solution run(const InformationSet& set, const SolveOptions& options, SolveObserver* observer,
             MakeForm make_form) {
  static_cast<void>(Tracer(set, options, nullptr));  // throws for options out of range
  auto turn = [&] {
    const TimeLimit limit(options.time_limit);
    return std::make_shared<Turn>();
  }();
  Tracer tracer(set, options, observer);
  const std::size_t count = set.candidate_count();
  const auto short_of = [&](SolveStatus status, std::string message) {
    return tracer.finish({std::vector<double>(count, 1.0 / static_cast<double>(count))}, status, 0,
                         std::move(message));
  };
  if (!turn->has_come()) {
    return short_of(SolveStatus::kTimeLimit, "an earlier run has not left MUMPS yet");
  }
  std::shared_ptr<Session> session;
  try {
    session = std::make_shared<Session>(set, options, tracer);
  } catch (const std::bad_alloc&) {
    return short_of(SolveStatus::kNumericalFailure, "out of memory");
  }
  if (!session->normalized().regular()) {
    const std::string& message = session->normalized().message();
    if (tracer.out_of_time()) return short_of(SolveStatus::kTimeLimit, message);
    return tracer.finish({}, SolveStatus::kUnsupported, 0, message);
  }
  session->judge_start();
  std::thread thread([session, turn, make_form] { session->work(make_form); });
  bool done = false;
  while (!(done = session->done_after(kLook)) && !session->out_of_time()) {
  }
  done = done || session->done_after(kPatience);
  Solution solution = session->finish(done);
  if (done) {
    thread.join();
  } else {
    leave_behind(thread);
  }
  return solution;
}

}  // namespace graybox::ipopt
