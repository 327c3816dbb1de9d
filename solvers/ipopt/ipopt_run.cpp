#include "graybox/solvers/ipopt/ipopt_run.hpp"

#include <fmt/format.h>

#include <IpIpoptApplication.hpp>
#include <IpIpoptCalculatedQuantities.hpp>
#include <IpIpoptData.hpp>
#include <IpOrigIpoptNLP.hpp>
#include <IpTNLPAdapter.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <new>
#include <numeric>
#include <string>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/solvers/sensitivity.hpp"
#include "graybox/solvers/tracer.hpp"

namespace graybox::ipopt {
namespace {

constexpr int kDefaultIterationLimit = 3000;
constexpr int kStarts = 6;

std::mutex& linear_solver_turn() {
  static std::mutex turn;
  return turn;
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

// One solve: the clock, the best weights so far, and what the callback decided.
class Session {
 public:
  Session(const InformationSet& set, const SolveOptions& options, SolveObserver* observer)
      : set_(set),
        options_(options),
        tracer_(set, options, observer),
        iteration_limit_(options.iteration_limit > 0 ? options.iteration_limit
                                                     : kDefaultIterationLimit),
        best_(set.candidate_count(), 1.0 / static_cast<double>(set.candidate_count())),
        candidate_(set.candidate_count()) {}

  Solution solve(MakeForm make_form);

  // Judges an iterate; false asks Ipopt to stop.
  bool consider(const Form& form, const double* variables, const double* multipliers,
                bool new_iteration);

  [[nodiscard]] bool out_of_time() const { return tracer_.out_of_time(); }
  void count_pass() { tracer_.count_passes(1.0); }

 private:
  [[nodiscard]] Ipopt::ApplicationReturnStatus start(const NormalizedSet& normalized,
                                                     MakeForm make_form);
  void judge(std::span<double> weights);
  [[nodiscard]] bool met() const { return best_gap_ <= options_.duality_gap; }

  const InformationSet& set_;
  const SolveOptions& options_;
  Tracer tracer_;
  std::int64_t iteration_limit_;
  std::int64_t iterations_ = 0;
  std::vector<double> best_;
  double best_gap_ = std::numeric_limits<double>::infinity();
  std::vector<double> candidate_;
};

void Session::judge(std::span<double> weights) {
  for (double& weight : weights) weight = std::max(weight, 0.0);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0) || !std::isfinite(sum)) return;
  for (double& weight : weights) weight /= sum;
  const double gap = duality_gap(set_, weights);
  tracer_.count_passes(2.0);
  tracer_.record(gap, iterations_);
  if (gap < best_gap_) {
    best_gap_ = gap;
    std::ranges::copy(weights, best_.begin());
  }
}

bool Session::consider(const Form& form, const double* variables, const double* multipliers,
                       bool new_iteration) {
  if (new_iteration) ++iterations_;
  form.weights_of(variables, multipliers, candidate_);
  judge(candidate_);
  return !met() && !tracer_.out_of_time() && iterations_ < iteration_limit_;
}

Ipopt::ApplicationReturnStatus Session::start(const NormalizedSet& normalized, MakeForm make_form) {
  const auto q = static_cast<double>(set_.candidate_count());
  const auto d = static_cast<double>(set_.dimension());
  // On the central path the gap is Q mu / d. The first start begins where that is 1.
  const double gap = std::clamp(best_gap_, 1e-15, 10.0);
  const double barrier = 0.1 * gap * d / q;
  const double final_barrier = 1e-3 * options_.duality_gap * d / q;

  Form* raw_form = make_form(normalized);
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
  // both sparse forms (the automatic choice made ipopt_dual 20 times slower at Q = 2000, PORD ends
  // the process on the dense one).
  set_options->SetIntegerValue("mumps_pivot_order", 6);
  // The empty name keeps Ipopt from reading ipopt.opt in the working directory.
  const Ipopt::ApplicationReturnStatus status = application->Initialize("");
  return status == Ipopt::Solve_Succeeded ? application->OptimizeTNLP(form) : status;
}

Solution Session::solve(MakeForm make_form) {
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    return tracer_.finish({std::move(best_)}, status, iterations_, std::move(message));
  };
  Ipopt::ApplicationReturnStatus status = Ipopt::Internal_Error;
  try {
    const NormalizedSet normalized(set_, {.scale_rows = false, .threads = options_.threads});
    tracer_.count_passes(normalized.passes());
    if (!normalized.regular()) {
      Solution solution = finish(SolveStatus::kUnsupported, normalized.message());
      solution.design.weights.clear();
      return solution;
    }
    candidate_ = best_;
    judge(candidate_);
    for (int number = 0; number < kStarts && !met(); ++number) {
      if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
      if (iterations_ >= iteration_limit_) return finish(SolveStatus::kIterationLimit);
      const double before = best_gap_;
      status = start(normalized, make_form);
      if (!met() && number > 0 && !(best_gap_ <= 0.5 * before)) break;
    }
  } catch (const std::bad_alloc&) {
    return finish(SolveStatus::kNumericalFailure, "out of memory");
  }
  if (met()) return finish(SolveStatus::kSolved);
  if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
  if (iterations_ >= iteration_limit_) return finish(SolveStatus::kIterationLimit);
  return finish(SolveStatus::kNumericalFailure,
                fmt::format("{}, but the duality gap is {:.2g}", reason(status), best_gap_));
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
  const std::lock_guard turn(linear_solver_turn());
  return Session(set, options, observer).solve(make_form);
}

}  // namespace graybox::ipopt
