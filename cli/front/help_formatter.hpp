// How --help looks. Its text is folded to the terminal. The options that a command has for itself
// come first. Those that many commands share are names in a line, with their topic
// (help_topics.hpp).
//
//   app.formatter(std::make_shared<HelpFormatter>(terminal_columns()));  // before add_subcommand()
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>

namespace graybox::cli {

class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(std::size_t columns) : columns_(columns) {}

  [[nodiscard]] std::string make_help(const CLI::App* app, std::string name,
                                      CLI::AppFormatMode mode) const override;
  [[nodiscard]] std::string make_subcommands(const CLI::App* app,
                                             CLI::AppFormatMode mode) const override;
  [[nodiscard]] std::string make_option(const CLI::Option* option,
                                        bool is_positional) const override;
  [[nodiscard]] std::string make_option_name(const CLI::Option* option,
                                             bool is_positional) const override;
  [[nodiscard]] std::string make_option_opts(const CLI::Option* option) const override;
  [[nodiscard]] std::string make_option_desc(const CLI::Option* option) const override;

 private:
  [[nodiscard]] std::string option_groups(const CLI::App& app) const;

  std::size_t columns_;  // of the terminal
};

}  // namespace graybox::cli
