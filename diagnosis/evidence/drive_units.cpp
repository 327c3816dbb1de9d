#include "diagnosis/evidence/drive_units.hpp"

#include <cctype>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

namespace graybox {
namespace {

struct UnitOfForce {
  std::string_view name, rest;  // of the drive's unit: "N m/rad" is "/rad"
};

// Longer names before those that they begin with.
constexpr UnitOfForce kUnits[] = {
    {"kg m^2", " s^2/rad"},
    {"N m", ""},
    {"kg", " s^2/m"},
    {"N", ""},
};

bool is_part_of_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
}

// Whether a unit of this name stands there: after a number's space or at the beginning, and whole.
bool stands_at(const std::string& text, std::size_t at, std::string_view name) {
  if (text.compare(at, name.size(), name) != 0) return false;
  if (at > 0 && (is_part_of_word(text[at - 1]) || text[at - 1] == '\'')) return false;
  const std::size_t end = at + name.size();
  if (end == text.size()) return true;
  if (is_part_of_word(text[end]) || text[end] == '\'' || text[end] == '^') return false;
  return true;
}

const UnitOfForce* unit_at(const std::string& text, std::size_t at) {
  for (const UnitOfForce& each : kUnits) {
    if (stands_at(text, at, each.name)) return &each;
  }
  return nullptr;
}

class Renaming {
 public:
  explicit Renaming(std::string unit) : unit_(std::move(unit)) {}

  void operator()(std::string& text) const { text = in_drive_unit(std::move(text), unit_); }
  void operator()(std::vector<std::string>& texts) const {
    for (std::string& text : texts) (*this)(text);
  }
  void operator()(LawParameterEstimate& estimate) const { (*this)(estimate.unit); }
  void operator()(FittedLaw& law) const { each(law.parameters); }
  void operator()(Rival& rival) const {
    (*this)(rival.law);
    each(rival.same_at);
    each(rival.with);
  }
  void operator()(FoundEffect& effect) const {
    (*this)(effect.law);
    each(effect.rivals);
    each(effect.generalisations);
    each(effect.excluded);
    each(effect.same_at);
  }
  void operator()(ExtendedFit& fit) const {
    each(fit.model_parameters);
    each(fit.laws);
  }
  void operator()(RejectedLaw& rejected) const {
    (*this)(rejected.law);
    (*this)(rejected.reason);
  }
  void operator()(VerdictReason& reason) const {
    (*this)(reason.test);
    (*this)(reason.not_tested);
    (*this)(reason.next);
  }
  void operator()(Implausibility& flaw) const {
    (*this)(flaw.words);
    (*this)(flaw.remedy);
  }
  void operator()(CheckedRange::Span& span) const { (*this)(span.unit); }
  void operator()(CheckedRange& checked) const {
    each(checked.spans);
    each(checked.recorded);
    if (checked.standing) (*this)(checked.standing->unit);
  }
  void operator()(ChangedSize& size) const {
    (*this)(size.in_fit);
    (*this)(size.kept_out);
  }
  void operator()(ResidualCurve& curve) const { (*this)(curve.unit); }
  void operator()(DetectableEffect& effect) const { (*this)(effect.unit); }
  void operator()(HypothesisScore& score) const { (*this)(score.amplitude_unit); }
  void operator()(ForcePicture& picture) const { (*this)(picture.force_unit); }
  void operator()(FreedModel& model) const { (*this)(model.departures); }

  template <typename Item>
  void each(std::vector<Item>& items) const {
    for (Item& item : items) (*this)(item);
  }

 private:
  std::string unit_;
};

}  // namespace

std::string in_drive_unit(std::string text, const std::string& unit) {
  if (unit.empty() || text.find_first_of("Nk") == std::string::npos) return text;
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const UnitOfForce* found = unit_at(text, at);
    if (found == nullptr) {
      result += text[at++];
      continue;
    }
    result.append(unit).append(found->rest);
    at += found->name.size();
  }
  return result;
}

Diagnosis in_drive_unit(Diagnosis diagnosis, const std::string& unit) {
  if (unit.empty()) return diagnosis;
  const Renaming rename(unit);
  rename(diagnosis.trouble);
  rename(diagnosis.assumptions);
  rename.each(diagnosis.effects);
  rename(diagnosis.before);
  rename(diagnosis.after);
  if (diagnosis.time_variation) {
    rename(diagnosis.time_variation->unit);
    rename(diagnosis.time_variation->alternatives);
  }
  rename.each(diagnosis.detectable);
  rename.each(diagnosis.ranking);
  rename.each(diagnosis.curves_before);
  rename.each(diagnosis.curves_after);
  rename.each(diagnosis.pictures);
  rename.each(diagnosis.rejected);
  if (diagnosis.freed_model) rename(*diagnosis.freed_model);
  if (diagnosis.doubted_model) rename(*diagnosis.doubted_model);
  if (diagnosis.kept_out_change) rename.each(diagnosis.kept_out_change->sizes);
  rename.each(diagnosis.implausible);
  rename(diagnosis.checked);
  rename.each(diagnosis.reasons);
  return diagnosis;
}

}  // namespace graybox
