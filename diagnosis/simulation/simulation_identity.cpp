#include "diagnosis/simulation/simulation_identity.hpp"

#include <fstream>
#include <sstream>

#include "problems/base/sha256.hpp"

namespace graybox {
namespace {

void add_file(Sha256& hash, const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  hash.update(text.str());
}

}  // namespace

std::string simulation_identity(const SimulatedSystem& system, const std::filesystem::path& plan) {
  Sha256 hash;
  for (const auto& file : system.files) add_file(hash, file);
  add_file(hash, plan);
  return hash.hexadecimal();
}

}  // namespace graybox
