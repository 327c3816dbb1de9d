#include "cli/front/help_topics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "cli/arguments/option_groups.hpp"
#include "cli/front/help_formatter.hpp"
#include "cli/front/help_text.hpp"

namespace graybox::cli {
namespace {

constexpr HelpTopic kTopics[] = {
    {.name = "constraints",
     .group = kConstraintOptions,
     .title = "Costs, earlier trials, and limits on the next experiments",
     .footer = "An option replaces what the file of --request says. The help of each command\n"
               "names those that it takes. See docs/how_to/constraints.md.\n"
               "Examples:\n"
               "  graybox solve set.h5 --costs minutes.csv --budget 90 -o design.json\n"
               "  graybox exact set.h5 --request request.yaml -o next.json"},
    {.name = "criteria",
     .group = kCriterionOptions,
     .title = "What a criterion makes small, and what it needs",
     .footer = "Criteria, M being the information matrix of the design:\n"
               "  D       det M^-1, the volume of the confidence ellipsoid (default)\n"
               "  A       tr M^-1, the sum of the variances\n"
               "  E       the largest eigenvalue of M^-1\n"
               "  L       tr W M^-1, with --weights\n"
               "  Ds      D of some parameters, with --interest\n"
               "  c       the variances of linear functions, with --combination\n"
               "  I       the mean variance of predictions over --region\n"
               "  G       the largest variance of predictions over --region\n"
               "  phi_p   the p-th power mean of the variances along the axes, with --p\n"
               "See docs/how_to/criteria.md.\n"
               "Examples:\n"
               "  graybox solve set.h5 --criterion Ds --interest k1,k2 -o design.json\n"
               "  graybox solve set.h5 --criterion D=0.5,A=0.5"},
};

struct OptionsOfTopic {
  std::vector<std::string> commands;  // that have some
  std::vector<const CLI::Option*> options;
};

void collect(const CLI::App& app, const std::string& path, const HelpTopic& topic,
             OptionsOfTopic& found) {
  const auto options = app.get_options(
      [&](const CLI::Option* option) { return option->get_group() == topic.group; });
  if (!options.empty()) found.commands.push_back(path);
  for (const CLI::Option* option : options) {
    const auto has_name = [&](const CLI::Option* other) {
      return other->get_name() == option->get_name();
    };
    if (std::ranges::none_of(found.options, has_name)) found.options.push_back(option);
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    collect(*command, path + " " + command->get_name(), topic, found);
  }
}

}  // namespace

std::span<const HelpTopic> help_topics() { return kTopics; }

const HelpTopic* topic_of_group(const std::string& group) {
  const auto* const found =
      std::ranges::find_if(kTopics, [&](const HelpTopic& each) { return each.group == group; });
  return found == std::end(kTopics) ? nullptr : found;
}

const HelpTopic* topic_named(const std::string& name) {
  const auto* const found =
      std::ranges::find_if(kTopics, [&](const HelpTopic& each) { return each.name == name; });
  return found == std::end(kTopics) ? nullptr : found;
}

std::string topic_text(const CLI::App& app, const HelpTopic& topic) {
  const std::size_t columns = terminal_columns();
  OptionsOfTopic found;
  collect(app, "graybox", topic, found);
  return folded(topic.title, columns) +
         folded(fmt::format("Usage: {}", fmt::join(found.commands, ", ")), columns, 7) +
         HelpFormatter(columns).make_group("Options", false, found.options) + '\n' +
         folded_paragraphs(topic.footer, columns);
}

}  // namespace graybox::cli
