// Strict reading of YAML model files: every mistake ends in an InputError of one line that names
// the file, the line, the field and what was expected. A line marked "# ANSWER:" is a mistake, too.
//
//   const YamlField root = YamlField::load("robot.yaml");
//   root.allow_keys({"format", "mass"});                 // an unknown or doubled key is an error
//   const double mass = root.at("mass").positive();      // "robot.yaml:3: mass: must be ..."
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace graybox {

class YamlField {
 public:
  static YamlField load(const std::filesystem::path& file);

  // Checks that this is a mapping and that it has no other keys than these, and none twice.
  void allow_keys(std::initializer_list<std::string_view> keys) const;
  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] YamlField at(const std::string& key) const;  // throws where the key is missing
  [[nodiscard]] std::vector<std::pair<std::string, YamlField>> entries() const;  // of a mapping
  [[nodiscard]] std::vector<YamlField> items() const;                            // of a list
  [[nodiscard]] bool is_list() const { return node_.IsSequence(); }
  [[nodiscard]] bool is_mapping() const { return node_.IsMap(); }

  [[nodiscard]] std::string text() const;
  [[nodiscard]] double number() const;  // finite
  [[nodiscard]] double positive() const;
  [[nodiscard]] double non_negative() const;
  [[nodiscard]] std::size_t count() const;  // a whole number from 1 to 1e9
  [[nodiscard]] std::vector<double> numbers(std::size_t expected_size) const;
  // One of the words given.
  [[nodiscard]] std::string choice(std::initializer_list<std::string_view> words) const;

  // As YAML again, without comments.
  [[nodiscard]] std::string dump() const;

  // Throws InputError "file:line: field: message".
  [[noreturn]] void fail(const std::string& message) const;

 private:
  YamlField(std::string file, std::string path, YAML::Node node);

  std::string file_;
  std::string path_;
  YAML::Node node_;
};

}  // namespace graybox
