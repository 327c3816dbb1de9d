#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return "none";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kUnknown:
      break;
  }
  return "unknown";
}

}  // namespace graybox
