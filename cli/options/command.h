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

/// What a command does with a file that it is given.
enum class FileUse : std::uint8_t {
  kRead,          ///< With all files below it, if it is a folder.
  kReadIfFile,    ///< A name of something shipped, unless names_a_file().
  kReadPictures,  ///< A picture, or a folder whose pictures are read.
  kContinued,     ///< Read and added to: a database, a ledger, a tuning file.
  kWritten,       ///< Replaced as a whole.
};

/// The value that a command line in the making has of an option, "--platform".
using TypedValue = std::function<std::optional<std::string>(const std::string& option)>;

/// The names that a shell offers for a value.
struct Offer {
  std::function<std::vector<std::string>(const TypedValue&)> names;
  std::string suffix = {};  ///< What follows a name within the value: "=" of a unit's weight.
};

/// What CLI11 has no place for. The command owns it.
struct OptionFacts {
  std::optional<FileUse> file = std::nullopt;  ///< If its value names one.
  Offer offer = {};                            ///< Without names: nothing is known.
  bool with_commas = false;
};

/// Where the value of an option goes. An optional one stays absent without the option.
using Target = std::variant<std::string*, std::optional<std::string>*, std::vector<std::string>*,
                            int*, std::optional<int>*, std::int64_t*, std::optional<std::int64_t>*,
                            std::uint64_t*, double*, std::optional<double>*>;

/// An option that was added.
class Option {
 public:
  Option(CLI::Option* option, OptionFacts* facts) : option_(option), facts_(facts) {}
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
  /// What completion offers for its value.
  const Option& offers(Offer offer) const;
  const Option& offers(std::vector<std::string> names) const;
  /// Its value names a file.
  const Option& names_file(FileUse use) const;
  /// What becomes of a value before anything sees it.
  const Option& reads_as(const std::function<std::string(std::string)>& change) const;
  /// Whether the command line has it.
  [[nodiscard]] bool given() const;

 private:
  CLI::Option* option_;
  OptionFacts* facts_;
};

/// An option that the command line has.
struct GivenOption {
  std::string name;
  std::vector<std::string> values;
  const OptionFacts* facts;
};
[[nodiscard]] std::vector<GivenOption> given_options(const CLI::App& command);

class Subcommand;

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
  Subcommand* app_;
};

/// Adds a command to the program.
using AddCommand = void(CLI::App& app, Action& action);

/// Parses the command line, checks the files that it names, and runs the command.
/// @param version  What --version prints.
/// @param warnings  Said before the command runs.
/// @throws Error{kBadInput} for what no command knows, with the nearest names.
/// @return  The exit code.
[[nodiscard]] int run(std::span<AddCommand* const> commands,
                      const std::function<std::string()>& version,
                      std::span<const std::string> warnings, int argc, char** argv);

}  // namespace pirt::cli
