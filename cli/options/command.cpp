#include "cli/options/command.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <string_view>

#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/process_start.h"
#include "cli/options/program.h"
#include "workloads/base/error.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {

/// A command with what its options have besides.
class Subcommand : public CLI::App {
 public:
  using CLI::App::App;

  [[nodiscard]] Option wrap(CLI::Option* option) { return {option, &facts_[option]}; }
  /// Null for an option that CLI11 added by itself.
  [[nodiscard]] const OptionFacts* find(const CLI::Option* option) const {
    const auto found = facts_.find(option);
    return found == facts_.end() ? nullptr : &found->second;
  }

 private:
  std::map<const CLI::Option*, OptionFacts> facts_;
};

namespace {

const OptionFacts& facts_of(const CLI::App& command, const CLI::Option* option) {
  static const OptionFacts nothing;
  const auto* subcommand = dynamic_cast<const Subcommand*>(&command);  // not the program itself
  const OptionFacts* facts = subcommand == nullptr ? nullptr : subcommand->find(option);
  return facts == nullptr ? nothing : *facts;
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* option : app.get_options()) {
    for (const auto& name : option->get_lnames()) names.push_back("--" + name);
    for (const auto& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* command :
       app.get_subcommands([](const CLI::App* a) { return !a->get_group().empty(); })) {
    names.push_back(command->get_name());
  }
  return names;
}

/// What README once named and is written otherwise now.
struct OldSpelling {
  std::string_view command;  ///< Where it was an option; empty = it was a command.
  std::string_view word;
  std::string_view instead;
};
constexpr OldSpelling kOldSpellings[] = {
    {"", "detect", "pirt describe --table (or without --table, a line of JSON a picture)"},
    {"", "generate-dag", "pirt generate dag"},
    {"", "generate-bal", "pirt generate bal"},
    {"regress", "--self-test", "the benchmark build/tests/bench/self_test PIRT"}};

/// "pirt generate dag".
std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? command.get_name() : full_name(*parent) + " " + command.get_name();
}

/// One command, and one kind of it: a further name is an argument, where it would otherwise run in
/// the place of the first.
void take_one(CLI::App& app) { app.require_subcommand(0, 1); }

/// What the command line chose, from the command to the last of its kinds.
std::vector<const CLI::App*> chosen_commands(const CLI::App& root) {
  std::vector<const CLI::App*> chosen;
  for (auto next = root.get_subcommands(); !next.empty(); next = next.front()->get_subcommands()) {
    chosen.push_back(next.front());
  }
  return chosen;
}

/// What was said to a command of which a kind was chosen would be said to nobody.
void reject_before_kind(const CLI::App& command, const CLI::App& kind) {
  const auto given = given_options(command);
  if (given.empty()) return;
  throw_bad_input(fmt::format("'{}' before '{}' says nothing to it; see '{} --help'",
                              given.front().name, kind.get_name(), full_name(kind)));
}

void reject_old_spelling(const std::string& command, const std::string& word) {
  for (const OldSpelling& old : kOldSpellings) {
    if (old.command != command || old.word != word) continue;
    throw_bad_input(fmt::format("'{}' is no {} any more; it is {}", word,
                                command.empty() ? "command" : "option", old.instead));
  }
}

/// CLI11 leaves what it does not know in remaining(); the nearest known names make a better message
/// than its own.
void reject_unknown(const CLI::App& app, const CLI::App& root) {
  // All that remains of "--" is the mark itself, which is no argument.
  auto unknown = app.remaining();
  if (app.remaining_size() == 0) return;
  if (unknown.size() > app.remaining_size()) unknown.erase(std::ranges::find(unknown, "--"));
  const auto& word = unknown.front();
  const std::string command = full_name(app);
  if (word.size() > 1 && word.front() == '-') {
    const auto name = word.substr(0, word.find('='));
    reject_old_spelling(app.get_name(), name);
    throw_bad_input("unknown option '" + name + "'" + suggestion(name, option_names(app)) +
                    "; see '" + command + " --help'");
  }
  if (&app == &root) {
    reject_old_spelling("", word);
    throw_bad_input("unknown command '" + word + "'" + suggestion(word, command_names(app)));
  }
  throw_bad_input("unexpected argument '" + word + "'; see '" + command + " --help'");
}

constexpr const char* kQuiet = "-q,--quiet";

/// Nothing reaches stderr while it lives: of our own, of libraries and of processes that are
/// started.
class Quiet {
 public:
  /// @param asked  Otherwise it does nothing.
  explicit Quiet(bool asked) {
    if (!asked) return;
    saved_ = FileDescriptor(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO));
    std::fflush(stderr);
    const FileDescriptor nothing(::open("/dev/null", O_WRONLY | O_CLOEXEC));
    if (saved_.get() >= 0 && nothing.get() >= 0) lead_to(nothing);
  }
  ~Quiet() {
    std::fflush(stderr);
    if (saved_.get() >= 0) lead_to(saved_);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  /// What libraries write to standard output leads there, too.
  static void lead_to(const FileDescriptor& file) {
    ::dup2(file.get(), STDERR_FILENO);
    if (results_descriptor() != STDOUT_FILENO) ::dup2(file.get(), STDOUT_FILENO);
  }

  FileDescriptor saved_;
};

/// Without what an option excludes: the list is long, and the error says it to whom it concerns.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string text = CLI::Formatter::make_option_opts(option);
    return text.substr(0, text.find(" Excludes:"));
  }
};

}  // namespace

const Option& Option::shows_default() const { return option_->capture_default_str(), *this; }
const Option& Option::required() const { return option_->required(), *this; }
const Option& Option::excludes(const Option& other) const {
  return option_->excludes(other.option_), *this;
}
const Option& Option::needs(const Option& other) const {
  return option_->needs(other.option_), *this;
}
const Option& Option::takes(int least, int most) const {
  return option_->expected(least, most), *this;
}
const Option& Option::type(const std::string& name) const {
  return option_->type_name(name), *this;
}
const Option& Option::check(const Problem& problem) const {
  if (!problem.range().empty()) {
    option_->description(option_->get_description() + " [" + problem.range() + "]");
  }
  return option_->check(problem), *this;
}
const Option& Option::reads_as(const std::function<std::string(std::string)>& change) const {
  return option_->transform(change), *this;
}
const Option& Option::with_commas() const {
  facts_->with_commas = true;
  return option_->delimiter(',')->allow_extra_args(false), *this;
}
const Option& Option::offers(Offer offer) const { return facts_->offer = std::move(offer), *this; }
const Option& Option::offers(std::vector<std::string> names) const {
  return offers({.names = [names = std::move(names)](const TypedValue&) { return names; }});
}
const Option& Option::names_file(FileUse use) const { return facts_->file = use, *this; }
const Option& Option::one_at_a_time() const { return option_->allow_extra_args(false), *this; }
bool Option::given() const { return option_->count() > 0; }

std::vector<GivenOption> given_options(const CLI::App& command) {
  std::vector<GivenOption> given;
  for (const auto* option : command.get_options()) {
    if (option->count() == 0) continue;
    given.push_back({option->get_name(), option->results(), &facts_of(command, option)});
  }
  return given;
}

Command::Command(CLI::App& app, const std::string& name, const std::string& description) {
  const auto space = name.find(' ');
  CLI::App* parent = &app;
  if (space != std::string::npos) parent = app.get_subcommand(name.substr(0, space));
  auto own = std::make_shared<Subcommand>(description, name.substr(space + 1));
  own->formatter(app.get_formatter());
  app_ = own.get();
  parent->add_subcommand(std::move(own));
  app_->allow_extras();
  take_one(*app_);
  app_->add_flag(kQuiet)->description("Say nothing on stderr but an error that ends the command");
}

Option Command::add(const std::string& name, const Target& target, const std::string& help) {
  return app_->wrap(
      std::visit([&](auto* value) { return app_->add_option(name, *value, help); }, target));
}

Option Command::add(const std::string& name, const std::function<void(const std::string&)>& take,
                    const std::string& help) {
  return app_->wrap(app_->add_option_function<std::string>(name, take, help));
}

Option Command::add_flag(const std::string& name, bool& target, const std::string& help) {
  return app_->wrap(app_->add_flag(name, target, help));
}

Option Command::option(const std::string& name) const { return app_->wrap(app_->get_option(name)); }

void Command::footer(const std::string& text) { app_->footer(text); }

void Command::hide() { app_->group(""); }

void Command::runs(Action& action, const Action& run) {
  app_->callback([command = app_, &action, run] {
    if (command->get_subcommands().empty()) action = run;
  });
}

namespace {

OptionDescription describe(const CLI::App& command, const CLI::Option* option) {
  OptionDescription described;
  described.positional = option->get_positional();
  if (described.positional) {
    described.names.push_back(option->get_name(true));
  } else {
    for (const auto& name : option->get_snames()) described.names.push_back("-" + name);
    for (const auto& name : option->get_lnames()) described.names.push_back("--" + name);
  }
  described.help = option->get_description();
  described.type = option->get_type_size() == 0 ? "" : option->get_type_name();
  described.standard = option->get_default_str();
  described.required = option->get_required();
  described.least_values = option->get_items_expected_min();
  described.most_values = option->get_items_expected_max();
  described.repeatable =
      described.most_values > 1 || option->get_expected_max() > 1 || option->get_delimiter() != 0;
  described.facts = facts_of(command, option);
  for (const auto* needed : option->get_needs()) described.needs.push_back(needed->get_name());
  for (const auto* other : option->get_excludes()) described.excludes.push_back(other->get_name());
  return described;
}

}  // namespace

CommandDescription describe(const CLI::App& app) {
  CommandDescription described;
  described.name = full_name(app);
  described.help = app.get_description();
  described.footer = app.get_footer();
  for (const auto* option : app.get_options()) described.options.push_back(describe(app, option));
  for (const auto* kind :
       app.get_subcommands([](const CLI::App* a) { return !a->get_group().empty(); })) {
    described.kinds.push_back(describe(*kind));
  }
  return described;
}

int run(std::span<AddCommand* const> commands, const std::function<std::string()>& version,
        std::span<const std::string> warnings, int argc, char** argv) {
  CLI::App app{
      "Characterizes robot workloads on every processing unit of a machine and schedules a robot's "
      "mix\n"
      "of them for latency, throughput or energy."};
  app.name("pirt");
  app.formatter(std::make_shared<HelpFormatter>());
  app.set_version_flag("--version", version);
  app.allow_extras();
  take_one(app);
  Action action;
  for (AddCommand* add : commands) add(app, action);
  app.footer(
      "Exit codes: 0 good, 1 a check failed, 2 usage or bad input, 3 inconclusive, 4 not possible "
      "on this "
      "machine.\nFirst steps: pirt characterize --quick --db profile.db && pirt report profile.db");

  // Nothing but the command can follow.
  if (argc > 1 && std::string_view(argv[1]) == "--") argv[1] = argv[0], ++argv, --argc;
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    std::ostringstream text;
    const int code = app.exit(success, text, std::cerr);
    write_results(text.str());
    return code;
  } catch (const CLI::ParseError& error) {
    for (const auto* command : chosen_commands(app)) reject_unknown(*command, app);
    reject_unknown(app, app);
    throw_bad_input(error.what());
  }
  const auto chosen = chosen_commands(app);
  for (const auto* command : chosen) reject_unknown(*command, app);
  reject_unknown(app, app);
  if (!action) {
    std::fputs(app.help().c_str(), stderr);
    throw_bad_input("no command given (known: " + join(command_names(app), ", ") + ")");
  }
  for (std::size_t i = 1; i < chosen.size(); ++i) reject_before_kind(*chosen[i - 1], *chosen[i]);
  check_files(given_files(*chosen.back()));
  const Quiet quiet(chosen.back()->count("--quiet") > 0);
  warn_all(warnings);
  return action();
}

}  // namespace pirt::cli
