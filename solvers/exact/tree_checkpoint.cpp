#include "solvers/exact/tree_checkpoint.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <type_traits>
#include <unordered_map>

#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::json;

constexpr const char* kFormat = "graybox-exact-checkpoint/1";

static_assert(std::is_trivially_copyable_v<BoxEntry> && sizeof(BoxEntry) == 16);
static_assert(std::endian::native == std::endian::little);

Json box_json(const CountBox& box) {
  std::vector<std::uint8_t> bytes(box.size() * sizeof(BoxEntry));
  std::memcpy(bytes.data(), box.data(), bytes.size());
  return Json::binary(std::move(bytes));
}

std::shared_ptr<const CountBox> read_box(const Json& json, std::size_t pool_size) {
  const Json::binary_t& bytes = json.get_binary();
  if (bytes.empty() || bytes.size() % sizeof(BoxEntry) != 0) {
    throw std::runtime_error("box truncated");
  }
  auto box = std::make_shared<CountBox>(bytes.size() / sizeof(BoxEntry));
  std::memcpy(box->data(), bytes.data(), bytes.size());
  for (const BoxEntry& entry : *box) {
    if (entry.member >= pool_size || entry.lower < 0 || entry.upper < entry.lower ||
        !std::isfinite(entry.start)) {
      throw std::runtime_error("box out of range");
    }
  }
  return box;
}

Json open_json(const std::vector<TreeNode>& open, Json& boxes) {
  Json nodes = Json::array();
  std::unordered_map<const CountBox*, std::size_t> places;
  for (const TreeNode& node : open) {
    const auto [place, fresh] = places.try_emplace(node.box.get(), boxes.size());
    if (fresh) boxes.push_back(box_json(*node.box));
    nodes.push_back({node.bound, node.number, place->second, node.entry, node.lower, node.upper});
  }
  return nodes;
}

TreeState read_state(const Json& root, const InformationSet& set) {
  TreeState state;
  state.pool = root.at("pool").get<std::vector<std::size_t>>();
  for (const std::size_t candidate : state.pool) {
    if (candidate >= set.candidate_count()) throw std::runtime_error("pool out of range");
  }
  state.incumbent.assign(set.candidate_count(), 0);
  for (const Json& pair : root.at("incumbent")) {
    state.incumbent.at(pair.at(0).get<std::size_t>()) = pair.at(1).get<std::int64_t>();
  }
  state.incumbent_log_det = root.at("incumbent_log_det").get<double>();
  state.given_up_bound = root.at("given_up_bound").get<double>();
  state.nodes = root.at("nodes").get<std::int64_t>();
  state.created = root.at("created").get<std::int64_t>();
  state.seconds = root.at("seconds").get<double>();
  state.seconds_to_mark = root.at("seconds_to_mark").get<double>();
  state.newton_steps = root.at("newton_steps").get<std::int64_t>();
  std::vector<std::shared_ptr<const CountBox>> boxes;
  for (const Json& flat : root.at("boxes")) boxes.push_back(read_box(flat, state.pool.size()));
  for (const Json& node : root.at("open")) {
    state.open.push_back({.bound = node.at(0).get<double>(),
                          .number = node.at(1).get<std::int64_t>(),
                          .box = boxes.at(node.at(2).get<std::size_t>()),
                          .entry = node.at(3).get<std::uint32_t>(),
                          .lower = node.at(4).get<std::int32_t>(),
                          .upper = node.at(5).get<std::int32_t>()});
    if (state.open.back().entry >= state.open.back().box->size()) {
      throw std::runtime_error("entry out of range");
    }
  }
  return state;
}

}  // namespace

void write_checkpoint(const std::string& path, const InformationSet& set,
                      const ExactOptions& options, const TreeState& state) {
  Json boxes = Json::array(), incumbent = Json::array();
  for (std::size_t i = 0; i < state.incumbent.size(); ++i) {
    if (state.incumbent[i] > 0) incumbent.push_back({i, state.incumbent[i]});
  }
  Json open = open_json(state.open, boxes);
  const Json root{{"format", kFormat},
                  {"problem_hash", set.content_hash()},
                  {"experiments", options.experiments},
                  {"gap", options.gap},
                  {"seed", options.seed},
                  {"pool", state.pool},
                  {"incumbent", std::move(incumbent)},
                  {"incumbent_log_det", state.incumbent_log_det},
                  {"given_up_bound", state.given_up_bound},
                  {"nodes", state.nodes},
                  {"created", state.created},
                  {"seconds", state.seconds},
                  {"seconds_to_mark", state.seconds_to_mark},
                  {"newton_steps", state.newton_steps},
                  {"boxes", std::move(boxes)},
                  {"open", std::move(open)}};
  const std::vector<std::uint8_t> bytes = Json::to_cbor(root);
  write_text_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

TreeState read_checkpoint(const std::string& path, const InformationSet& set,
                          const ExactOptions& options) {
  { const InputFile present(path, InputUse::kOwnState); }  // missing, a folder, empty
  std::ifstream stream(path, std::ios::binary);
  Json root;
  TreeState state;
  try {
    root = Json::from_cbor(stream);
    if (root.at("format") != kFormat) throw std::runtime_error("another format");
    state = read_state(root, set);
  } catch (const std::exception&) {
    throw InputError(
        fmt::format("{}: no checkpoint of graybox exact for {}, or a damaged one; "
                    "start without --resume",
                    path, set.name()));
  }
  if (root.at("problem_hash") != set.content_hash()) {
    throw InputError(
        fmt::format("{}: this checkpoint is of another set than {}", path, set.name()));
  }
  if (root.at("experiments") != options.experiments || root.at("gap") != options.gap ||
      root.at("seed") != options.seed) {
    throw InputError(fmt::format(
        "{}: this checkpoint is of --experiments {} --gap {} --seed {}; resume with the same", path,
        root.at("experiments").dump(), root.at("gap").dump(), root.at("seed").dump()));
  }
  return state;
}

}  // namespace graybox
