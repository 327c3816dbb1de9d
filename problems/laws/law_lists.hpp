// The parts of the catalogue, one for each kind of law; for law_catalogue.cpp alone.
#pragma once

#include <vector>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

[[nodiscard]] std::vector<LawEntry> spring_laws();
[[nodiscard]] std::vector<LawEntry> friction_laws();
[[nodiscard]] std::vector<LawEntry> hysteresis_laws();
[[nodiscard]] std::vector<LawEntry> inertia_laws();
[[nodiscard]] std::vector<LawEntry> signal_laws();

[[nodiscard]] std::vector<LawEntry> supplementary_spring_laws();
[[nodiscard]] std::vector<LawEntry> supplementary_friction_laws();
[[nodiscard]] std::vector<LawEntry> supplementary_hysteresis_laws();
[[nodiscard]] std::vector<LawEntry> supplementary_signal_laws();

}  // namespace graybox
