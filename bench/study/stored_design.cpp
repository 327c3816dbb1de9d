#include "bench/study/stored_design.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>

#include "problems/base/error.hpp"
#include "problems/base/sha256.hpp"
#include "problems/formats/npy_file.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kFolder = "designs";

std::string hash_of(const std::vector<double>& weights) {
  Sha256 hash;
  hash.update(weights.data(), weights.size() * sizeof(double));
  return hash.hexadecimal();
}

std::string write_side_file(const std::vector<double>& weights, const fs::path& folder) {
  const std::string name = fmt::format("{}/{}.npy", kFolder, hash_of(weights));
  const fs::path file = folder / name;
  if (fs::exists(file)) return name;
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) {
    throw InputError(fmt::format("{}: the folder can't be made: {}", file.parent_path().string(),
                                 error.message()));
  }
  // A set of one parameter has the bytes of an array [Q x 1].
  AlignedArray values(weights.size());
  std::ranges::copy(weights, values.begin());
  write_npy(file.string(), InformationSet(1, std::move(values)));
  return name;
}

std::vector<double> read_side_file(const std::string& name, const fs::path& folder) {
  const fs::path file = folder / name;
  std::vector<double> weights = read_npy_array(file.string()).values;
  if (hash_of(weights) != file.stem().string()) {
    throw InputError(fmt::format("{}: does not have the hash that it is named by; it was changed",
                                 file.string()));
  }
  return weights;
}

}  // namespace

void to_json(json& out, const StoredDesign& design) {
  if (!design.file.empty()) {
    out = {{"file", design.file}};
    return;
  }
  json support = json::array();
  for (const auto& [index, weight] : design.support) {
    support.push_back({index, std::isfinite(weight) ? json(weight) : json(nullptr)});
  }
  out = {{"support", std::move(support)}};
}

void from_json(const json& in, StoredDesign& design) {
  design.file = in.value("file", std::string());
  design.support.clear();
  for (const json& pair : in.value("support", json::array())) {
    design.support.emplace_back(
        pair.at(0).get<std::size_t>(),
        pair.at(1).is_null() ? std::numeric_limits<double>::quiet_NaN() : pair.at(1).get<double>());
  }
}

StoredDesign store_design(const Design& design, const fs::path& folder) {
  StoredDesign stored;
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (design.weights[i] != 0.0) stored.support.emplace_back(i, design.weights[i]);
  }
  if (stored.support.size() > kLongestSupport) {
    stored.file = write_side_file(design.weights, folder);
    stored.support.clear();
  }
  return stored;
}

Design stored_design(const StoredDesign& stored, std::size_t candidates, const fs::path& folder) {
  if (!stored.file.empty()) {
    Design design{read_side_file(stored.file, folder)};
    if (design.weights.size() != candidates) {
      throw InputError(fmt::format("{}: has {} weights, but the set {} candidates",
                                   (folder / stored.file).string(), design.weights.size(),
                                   candidates));
    }
    return design;
  }
  Design design{std::vector<double>(candidates, 0.0)};
  for (const auto& [index, weight] : stored.support) {
    if (index >= candidates) {
      throw InputError(fmt::format("its design has a weight for candidate {}, but the set has {}",
                                   index, candidates));
    }
    design.weights[index] = weight;
  }
  return design;
}

}  // namespace graybox::bench
