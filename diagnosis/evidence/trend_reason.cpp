#include "diagnosis/evidence/trend_reason.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "diagnosis/evidence/number_words.hpp"

namespace graybox {
namespace {

constexpr double kTrendErrors = 4.5, kTrendShare = 0.1;  // of the parameter
constexpr double kLeastOfSignal = 0.03;

// Beyond zero the line of the trend says no more than "none".
constexpr const char* kNone = "none";

// So far beyond the parameter's own value the line is drawn out, not measured.
constexpr double kDrawnOut = 2.0, kNearZero = 0.1;

struct Course {
  std::string from, to, least, most;
};

// "about 8.7", "more than 4.3" or "none".
Course course_in_words(const LawTrend& trend, double value) {
  const bool changes_sign = trend.from * trend.to < 0.0;
  const bool is_from_smaller = std::abs(trend.from) < std::abs(trend.to);
  const auto words = [&](double end, bool is_smaller) {
    if (changes_sign && is_smaller) return std::string(kNone);
    const double times = std::abs(end) / std::max(std::abs(value), 1e-300);
    return times > kDrawnOut && times < 1.0 / kNearZero ? "more than " + three_digits(value)
                                                        : "about " + three_digits(end);
  };
  Course course;
  course.from = words(trend.from, is_from_smaller);
  course.to = words(trend.to, !is_from_smaller);
  const bool rises = trend.from < trend.to;
  course.least = rises ? course.from : course.to;
  course.most = rises ? course.to : course.from;
  return course;
}

std::string first_size(const std::string& size, const std::string& unit) {
  return size == kNone ? size : size + unit;
}

// The second of two: its unit stands with the first, and so does "about".
std::string second_size(const std::string& size, const std::string& first,
                        const std::string& unit) {
  constexpr std::string_view kAbout = "about ";
  if (first == kNone) return first_size(size, unit);
  return size.starts_with(kAbout) ? size.substr(kAbout.size()) : size;
}

std::string course_of(const LawTrend& trend, const LawParameterEstimate& parameter) {
  const Course course = course_in_words(trend, parameter.value);
  const std::string& own_unit = parameter.unit;
  const std::string unit = own_unit == "1" || own_unit.empty() ? "" : " " + own_unit;
  const std::string from = first_size(course.from, unit),
                    to = second_size(course.to, course.from, unit);
  switch (trend.on) {
    case LawTrend::On::kTime:
      return fmt::format("{} where recordings begin, {} where they end", from, to);
    case LawTrend::On::kPosition:
      return course.least == kNone || course.most == kNone
                 ? fmt::format("between none and {} along the way",
                               first_size(course.least == kNone ? course.most : course.least, unit))
                 : fmt::format("between {} and {}{} along the way", course.least,
                               second_size(course.most, course.least, unit), unit);
    case LawTrend::On::kSpeed:
      return fmt::format("{} in fast motion, {} in slow motion", from, to);
    case LawTrend::On::kDirection:
      return fmt::format("{} one way, {} the other", from, to);
  }
  return {};
}

std::string trend_advice(LawTrend::On on) {
  switch (on) {
    case LawTrend::On::kTime:
      return "look for what changes while it is recorded, as a temperature, a load or wear; "
             "record it, and fit the beginning and the end by themselves";
    case LawTrend::On::kPosition:
      return "look for what else depends on the place, as a weight, a spring, a cable, a worn "
             "guide "
             "or the pull of another axis; record slow motion over the whole way";
    case LawTrend::On::kSpeed:
      return "record slow motion and standstill beside fast motion: another law of the speed "
             "fits better, as friction that falls with speed";
    case LawTrend::On::kDirection:
      return "record the same motion both ways: a constant force, or friction that differs by "
             "direction, is missing";
  }
  return {};
}

// A tenth of the parameter, and of the law's largest in that unit: a cosine near zero may be none.
bool is_much(const LawTrend& trend, std::span<const FoundEffect> effects) {
  const std::vector<LawParameterEstimate>& all = effects[trend.law].law.parameters;
  double larger = std::max(std::abs(trend.from), std::abs(trend.to));
  for (const LawParameterEstimate& other : all) {
    if (other.unit == all[trend.parameter].unit) larger = std::max(larger, std::abs(other.value));
  }
  return std::abs(trend.to - trend.from) > kTrendShare * larger;
}

bool matters(const LawTrend& trend) { return !(trend.of_signal < kLeastOfSignal); }

const LawTrend* worst_of(std::span<const LawTrend> trends, std::span<const FoundEffect> effects) {
  const LawTrend* worst = nullptr;
  for (const LawTrend& trend : trends) {
    const bool is_worse = worst == nullptr || std::abs(trend.z) > std::abs(worst->z);
    if (is_much(trend, effects) && matters(trend) && is_worse) worst = &trend;
  }
  return worst;
}

}  // namespace

VerdictReason trend_reason(std::span<const LawTrend> trends, std::span<const FoundEffect> effects,
                           const char* why_not) {
  VerdictReason reason;
  reason.test = "what was found changes with time, place or speed";
  reason.limit = kTrendErrors;
  const LawTrend* const worst = worst_of(trends, effects);
  if (worst == nullptr) {
    reason.test += ", standard errors";
    if (trends.empty()) reason.not_tested = why_not;
    if (!trends.empty()) reason.value = 0.0;
    return reason;
  }
  reason.test += fmt::format(" ({}), standard errors", trend_words(*worst, effects));
  reason.value = std::abs(worst->z);
  reason.passed = *reason.value <= kTrendErrors;
  if (reason.passed) return reason;
  reason.next = trend_advice(worst->on);
  if (worst->on != LawTrend::On::kTime) reason.otherwise = Verdict::kAmbiguous;
  return reason;
}

std::vector<LawTrend> told_trends(std::span<const LawTrend> trends,
                                  std::span<const FoundEffect> effects) {
  std::vector<LawTrend> told;
  for (const LawTrend& trend : trends) {
    if (is_much(trend, effects) && std::abs(trend.z) > kTrendErrors) told.push_back(trend);
  }
  std::ranges::stable_sort(
      told, [](const LawTrend& a, const LawTrend& b) { return std::abs(a.z) > std::abs(b.z); });
  return told;
}

std::string trend_words(const LawTrend& trend, std::span<const FoundEffect> effects) {
  const LawParameterEstimate& parameter = effects[trend.law].law.parameters[trend.parameter];
  return fmt::format("{} of {}: {}", parameter.name, trend.law_at, course_of(trend, parameter));
}

}  // namespace graybox
