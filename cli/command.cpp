#include "cli/command.h"

#include <CLI/CLI.hpp>

namespace pirt::cli {

const Option& Option::shows_default() const { return option_->capture_default_str(), *this; }
const Option& Option::required() const { return option_->required(), *this; }
const Option& Option::excludes(const Option& other) const {
  return option_->excludes(other.option_), *this;
}
const Option& Option::takes(int least, int most) const {
  return option_->expected(least, most), *this;
}
const Option& Option::type(const std::string& name) const {
  return option_->type_name(name), *this;
}
const Option& Option::check(const Problem& problem) const { return option_->check(problem), *this; }
const Option& Option::with_commas() const {
  return option_->delimiter(',')->allow_extra_args(false), *this;
}
const Option& Option::one_at_a_time() const { return option_->allow_extra_args(false), *this; }
bool Option::given() const { return option_->count() > 0; }

std::vector<GivenOption> given_options(const CLI::App& command) {
  std::vector<GivenOption> given;
  for (const auto* option : command.get_options()) {
    if (option->count() == 0) continue;
    given.push_back({option->get_name(), option->get_type_name(), option->results()});
  }
  return given;
}

Command::Command(CLI::App& app, const std::string& name, const std::string& description)
    : app_(app.add_subcommand(name, description)) {}

Option Command::add(const std::string& name, const Target& target, const std::string& help) {
  return Option(
      std::visit([&](auto* value) { return app_->add_option(name, *value, help); }, target));
}

Option Command::add(const std::string& name, const std::function<void(const std::string&)>& take,
                    const std::string& help) {
  return Option(app_->add_option_function<std::string>(name, take, help));
}

Option Command::add_flag(const std::string& name, bool& target, const std::string& help) {
  return Option(app_->add_flag(name, target, help));
}

Option Command::option(const std::string& name) const { return Option(app_->get_option(name)); }

void Command::footer(const std::string& text) { app_->footer(text); }

void Command::hide() { app_->group(""); }

void Command::runs(Action& action, const Action& run) {
  app_->callback([&action, run] { action = run; });
}

}  // namespace pirt::cli
