// A subcommand and its options, as the files of commands see them. CLI11 itself stays in
// command.cpp: whoever includes its header compiles for seconds longer.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace pirt::cli {

/// Runs the chosen command; returns the exit code.
using Action = std::function<int()>;

/// What a value has to be without.
class Problem {
 public:
  /// @param find   What is wrong with a text; empty = nothing.
  /// @param range  What is right, for --help: "1 to 256"; empty where the option's type says it.
  template <std::invocable<const std::string&> Find>
  Problem(Find find, std::string range = "")  // NOLINT(google-explicit-constructor)
      : find_(std::move(find)), range_(std::move(range)) {}

  [[nodiscard]] std::string operator()(const std::string& text) const { return find_(text); }
  [[nodiscard]] const std::string& range() const { return range_; }

 private:
  std::function<std::string(const std::string&)> find_;
  std::string range_;
};

/// Where the value of an option goes. An optional one stays absent without the option.
using Target = std::variant<std::string*, std::optional<std::string>*, std::vector<std::string>*,
                            int*, std::optional<int>*, std::int64_t*, std::optional<std::int64_t>*,
                            std::uint64_t*, double*, std::optional<double>*>;

/// An option that was added.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}
  /// --help shows the value that the target has now.
  const Option& shows_default() const;
  const Option& required() const;
  const Option& excludes(const Option& other) const;
  const Option& needs(const Option& other) const;
  /// How many values may follow it.
  const Option& takes(int least, int most) const;
  /// What --help shows for its value: "DURATION", "UNIT,...".
  const Option& type(const std::string& name) const;
  /// --help says the range of @p problem, too.
  const Option& check(const Problem& problem) const;
  /// Several values, with commas.
  const Option& with_commas() const;
  /// Several values, each with the option before it.
  const Option& one_at_a_time() const;
  /// What becomes of a value before anything sees it.
  const Option& reads_as(const std::function<std::string(std::string)>& change) const;
  /// Whether the command line has it.
  [[nodiscard]] bool given() const;
  [[nodiscard]] CLI::Option* get() const { return option_; }

 private:
  CLI::Option* option_;
};

/// An option that the command line has.
struct GivenOption {
  const CLI::Option* option;
  std::string name;
  std::vector<std::string> values;
};
[[nodiscard]] std::vector<GivenOption> given_options(const CLI::App& command);

class Command {
 public:
  /// @param name  "generate", or a kind of a command that was added: "generate dag".
  Command(CLI::App& app, const std::string& name, const std::string& description);

  /// @param name    "--db", "-o,--output", or, of a positional argument, "trace".
  /// @param target  Lives until the command has run.
  Option add(const std::string& name, const Target& target, const std::string& help);
  /// @param take  Is given the value.
  Option add(const std::string& name, const std::function<void(const std::string&)>& take,
             const std::string& help);
  Option add_flag(const std::string& name, bool& target, const std::string& help);
  /// One that was added, by its name.
  [[nodiscard]] Option option(const std::string& name) const;
  void footer(const std::string& text);
  /// Not in the help.
  void hide();
  /// What @p action becomes when this command is chosen.
  void runs(Action& action, const Action& run);

 private:
  CLI::App* app_;
};

/// Adds a command to the program.
using AddCommand = void(CLI::App& app, Action& action);

/// Parses the command line, checks the files that it names, and runs the command.
/// @throws Error{kBadInput} for what no command knows, with the nearest names.
/// @return  The exit code.
[[nodiscard]] int run(std::span<AddCommand* const> commands, int argc, char** argv);

}  // namespace pirt::cli
