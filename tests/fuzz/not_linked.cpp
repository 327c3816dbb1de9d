// What design_file.cpp and ellipsoid_file.cpp refer to when they write, so that the fuzzer, which
// only reads, needs no solvers. The check whether limits fit a set is theirs, too.
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>

#include "solvers/certificates/certificate.hpp"
#include "solvers/ellipsoid/smallest_ellipsoid.hpp"
#include "solvers/report/design_limits.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox {

std::string_view to_string(ReportStatus) { std::abort(); }
std::string_view to_string(CertificateStatus) { std::abort(); }
std::string_view to_string(EllipsoidStatus) { std::abort(); }
nlohmann::ordered_json to_json(const DesignLimits&) { std::abort(); }
void require_fits(const DesignLimits&, const InformationSet&) {}

}  // namespace graybox
