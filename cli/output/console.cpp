#include "cli/output/console.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "bench/study/progress.hpp"
#include "cli/process/interrupt.hpp"

namespace graybox::cli {
namespace {

constexpr std::size_t kShownSupport = 10;
constexpr std::chrono::milliseconds kAtOnce(100);  // between two lines of progress

std::string bytes_text(double bytes) {
  if (bytes < 1e6) return fmt::format("{:.1f} kB", bytes / 1e3);
  if (bytes < 1e9) return fmt::format("{:.1f} MB", bytes / 1e6);
  return fmt::format("{:.2f} GB", bytes / 1e9);
}

std::string seconds_text(double seconds) {
  return seconds < 1.0 ? fmt::format("{:.3g} ms", 1e3 * seconds) : fmt::format("{:.3g} s", seconds);
}

// The criterion's value, and how far from the best it can be.
std::string value_text(const SolveReport& report) {
  const Certificate& certificate = report.certificate;
  const CriterionKind kind = report.options.criterion.kind();
  const double gap = largest_gap(certificate);
  const std::string start =
      fmt::format("  {:<12}  {:.10g}, ", name_of_value(kind), certificate.criterion_value);
  switch (kind) {
    case CriterionKind::kD:
    case CriterionKind::kDs:
      return start + fmt::format("at most {:.2e} below the optimum\n", certificate.log_det_gap);
    case CriterionKind::kCompound:
      return start + fmt::format("at most {:.2e} below the optimum\n", std::log1p(gap));
    case CriterionKind::kE:
      return start + fmt::format("at most a factor {:.2e} below the optimum\n", gap);
    default:
      return start + fmt::format("at most a factor {:.2e} above the optimum\n", gap);
  }
}

std::string counted(std::size_t count, const char* noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

}  // namespace

const char* name_of_value(CriterionKind kind) {
  switch (kind) {
    case CriterionKind::kD:
      return "log det M";
    case CriterionKind::kDs:
      return "log det S";
    case CriterionKind::kA:
      return "tr M^-1";
    case CriterionKind::kL:
      return "tr W M^-1";
    case CriterionKind::kE:
      return "lambda_min M";
    case CriterionKind::kC:
      return "variance";
    case CriterionKind::kI:
      return "mean variance";
    case CriterionKind::kPhiP:
      return "phi_p";
    case CriterionKind::kG:
      return "largest var.";
    case CriterionKind::kCompound:
      return "log Phi";
  }
  return "";
}

std::string_view status_word(ReportStatus status) {
  if (status == ReportStatus::kTimeLimit && interrupted()) return "interrupted";
  return to_string(status);
}

std::string describe(const InformationSet& set) {
  const std::string form =
      set.has_factors() ? fmt::format(" as factors of rank {}", set.rank()) : std::string();
  return fmt::format("{}, {}, {}{}", counted(set.candidate_count(), "candidate"),
                     counted(set.dimension(), "parameter"),
                     bytes_text(static_cast<double>(set.bytes())), form);
}

std::string describe(const SolveReport& report) {
  const Certificate& certificate = report.certificate;
  std::string text = fmt::format("{}: {}", report.solver.empty() ? "design" : report.solver,
                                 status_word(report.status));
  if (!report.message.empty()) text += fmt::format(" ({})", report.message);
  text += '\n';
  if (certificate.status == CertificateStatus::kCertified) {
    text += fmt::format(
        "  duality gap   {:.3e}  (asked {:.3g}; rounding at most {:.1e})\n"
        "{}"
        "  {:<12}  at least {:.10f}\n",
        certificate.duality_gap, report.options.duality_gap, certificate.rounding_bound,
        value_text(report),
        fmt::format("{}-efficiency", to_string(report.options.criterion.kind())),
        certificate.efficiency);
  }
  text += fmt::format("  work          {} iterations, {:.1f} passes, {}; peak memory {}\n",
                      report.counters.iterations, report.counters.passes,
                      seconds_text(report.counters.seconds),
                      bytes_text(static_cast<double>(report.peak_memory_bytes)));
  if (report.account.seconds) {
    text += fmt::format("  stated        {} by the program's own clock\n",
                        seconds_text(*report.account.seconds));
  }
  return text;
}

std::string describe_support(const InformationSet& set, const Design& design) {
  std::vector<std::size_t> support;
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (design.weights[i] > 0.0) support.push_back(i);
  }
  std::ranges::stable_sort(
      support, [&](std::size_t a, std::size_t b) { return design.weights[a] > design.weights[b]; });
  const CandidateTable& table = set.candidates();
  std::string text = fmt::format(
      "  support       {}, heaviest first\n"
      "  {:>10} {:>12}",
      counted(support.size(), "candidate"), "weight", "candidate");
  for (std::size_t k = 0; k < table.names.size(); ++k) {
    const std::string unit = table.units[k].empty() ? "" : " [" + table.units[k] + "]";
    text += fmt::format(" {:>12}", table.names[k] + unit);
  }
  text += '\n';
  for (std::size_t rank = 0; rank < std::min(support.size(), kShownSupport); ++rank) {
    const std::size_t i = support[rank];
    text += fmt::format("  {:>10.6f} {:>12}", design.weights[i], i);
    for (const double value : set.coordinates(i)) text += fmt::format(" {:>12.6g}", value);
    text += '\n';
  }
  if (support.size() > kShownSupport) {
    text += fmt::format("  {:>10} and {} more\n", "...", support.size() - kShownSupport);
  }
  return text;
}

Progress::Progress(std::string solver)
    : solver_(std::move(solver)), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (written_) std::fputs("\r\033[K", stderr);
}

bool Progress::on_progress(const TracePoint& point) {
  const auto now = std::chrono::steady_clock::now();
  if (terminal_ && now >= next_) {
    next_ = now + std::chrono::milliseconds(100);
    written_ = true;
    fmt::print(stderr, "\r\033[K{}: iteration {}, gap {:.2e}, {:.1f} passes, {}", solver_,
               point.iteration, point.duality_gap, point.passes, seconds_text(point.seconds));
    std::fflush(stderr);
  }
  return !interrupted();
}

CountProgress::CountProgress(std::string stage) : terminal_(isatty(STDERR_FILENO) == 1) {
  begin(std::move(stage));
}

CountProgress::CountProgress(std::string noun, std::size_t total)
    : terminal_(isatty(STDERR_FILENO) == 1) {
  begin(std::move(noun), total);
}

CountProgress::~CountProgress() { clear(); }

void CountProgress::begin(std::string stage) { begin(std::move(stage), 0); }

void CountProgress::begin(std::string noun, std::size_t total, Total kind) {
  noun_ = std::move(noun);
  total_ = total;
  kind_ = kind;
  counting_ = false;
  before_ = 0;
  start_ = Clock::now();
  write(0);
}

bool CountProgress::update(std::size_t done) {
  const auto now = Clock::now();
  if (!counting_ && done > 0) {
    counting_ = true;
    // Counts that begin later, or come with the announcement, do not tell what a piece takes.
    if (done > 1 || now - start_ < kAtOnce) {
      before_ = done;
      start_ = now;
    }
  }
  if (now >= next_) write(done);
  return !interrupted();
}

std::string CountProgress::time_left(std::size_t done) const {
  const std::chrono::duration<double> elapsed = Clock::now() - start_;
  if (done <= before_ || done >= total_ || elapsed < kAtOnce) return "";
  const double seconds =
      elapsed.count() * static_cast<double>(total_ - done) / static_cast<double>(done - before_);
  return fmt::format(", {} {} left", kind_ == Total::kExact ? "about" : "at most about",
                     bench::readable_duration(seconds));
}

void CountProgress::write(std::size_t done) {
  if (!terminal_) return;
  next_ = Clock::now() + kAtOnce;
  written_ = true;
  if (total_ == 0) {
    fmt::print(stderr, "\r\033[K{} ...", noun_);
  } else {
    fmt::print(stderr, "\r\033[K{} {} of {}{}{}", noun_, done,
               kind_ == Total::kExact ? "" : "at most ", total_, time_left(done));
  }
  std::fflush(stderr);
}

void CountProgress::clear() {
  if (!written_) return;
  written_ = false;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
}

}  // namespace graybox::cli
