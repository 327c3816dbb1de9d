#include "bench/challenge/seal.hpp"

#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "problems/base/error.hpp"
#include "problems/base/sha256.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/json_file.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError(fmt::format("{}: can't be read", file.string()));
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::string digest(const std::string& text) {
  Sha256 hash;
  hash.update(text);
  return hash.hexadecimal();
}

Json parsed(const fs::path& file, const std::string& text, const char* format) {
  Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded() || !json.is_object() || json.value("format", "") != format) {
    throw InputError(fmt::format("{}: is no {} file", file.string(), format));
  }
  return json;
}

}  // namespace

std::uint64_t seed_of_commit(const std::string& commit) {
  return std::stoull(digest(commit).substr(0, 16), nullptr, 16);
}

fs::path truth_file(const fs::path& folder, const std::string& name) {
  return folder / (name + ".json");
}

std::string seal_truth(const fs::path& folder, const ChallengeOrigin& origin,
                       const std::vector<std::string>& names) {
  Json files = Json::object();
  for (const std::string& name : names) files[name] = digest(text_of(truth_file(folder, name)));
  const Json index{{"format", "graybox-truth-index/1"},
                   {"set", origin.set},
                   {"seed", origin.seed},
                   {"commit", origin.commit},
                   {"cases", origin.cases},
                   {"family", origin.family},
                   {"sha256", files}};
  const std::string text = index.dump(2) + "\n";
  write_text_file((folder / "index.json").string(), text);
  return digest(text);
}

void write_header(const fs::path& cases, const ChallengeHeader& header) {
  const Json json{{"format", "graybox-challenge/1"},
                  {"set", header.set},
                  {"cases", header.cases},
                  {"truth_sha256", header.truth_sha256}};
  write_text_file((cases / "challenge.json").string(), json.dump(2) + "\n");
}

ChallengeHeader read_header(const fs::path& cases) {
  const fs::path file = cases / "challenge.json";
  if (!fs::exists(file)) {
    throw InputError(
        fmt::format("{}: is no folder of challenge cases (no challenge.json)", cases.string()));
  }
  const Json json = parsed(file, text_of(file), "graybox-challenge/1");
  try {
    return {json.at("cases").get<std::size_t>(), json.at("truth_sha256").get<std::string>(),
            json.value("set", std::string(kPeriodicSet))};
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

UnsealedTruth unseal(const fs::path& folder, const ChallengeHeader& header) {
  const fs::path file = folder / "index.json";
  if (!fs::exists(file)) {
    throw InputError(
        fmt::format("{}: is no folder of a challenge's truth (no index.json)", folder.string()));
  }
  const std::string text = text_of(file);
  if (digest(text) != header.truth_sha256) {
    throw InputError(fmt::format(
        "{}: is not the truth that was sealed with these cases (SHA-256 differs)", file.string()));
  }
  const Json index = parsed(file, text, "graybox-truth-index/1");
  UnsealedTruth truth;
  truth.origin = {index.at("seed").get<std::uint64_t>(), index.at("commit").get<std::string>(),
                  index.at("cases").get<std::size_t>(), index.at("family").get<std::string>(),
                  index.value("set", std::string(kPeriodicSet))};
  for (const auto& [name, sha256] : index.at("sha256").items()) {
    const fs::path case_file = truth_file(folder, name);
    const std::string case_text = text_of(case_file);
    if (digest(case_text) != sha256.get<std::string>()) {
      throw InputError(fmt::format("{}: was changed after it was sealed", case_file.string()));
    }
    truth.cases.push_back(
        truth_from_json(parse_json<Json>(case_text, case_file.string()), case_file.string()));
  }
  return truth;
}

}  // namespace graybox::bench
