// Where results go: text on stdout, JSON to a file or stdout (then alone), progress and warnings on
// stderr.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cli/options/command.h"
#include "workloads/base/text/json.h"

namespace pirt::cli {

/// "-" and the names that stdout has in the file system.
[[nodiscard]] bool means_stdout(std::string_view name);

/// Whether a result may go to standard output.
enum class StdoutUse : std::uint8_t { kAllowed, kRefused };

/// Where one result of a command goes: to stdout unless an option said otherwise. Options alone
/// make one (files.h), so that main has seen that it overwrites nothing that is read.
class Output {
 public:
  Output() = default;

  /// Whether it was asked for.
  [[nodiscard]] explicit operator bool() const { return !path_.empty(); }
  [[nodiscard]] bool to_stdout() const { return means_stdout(path_); }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& option() const { return option_; }

 private:
  friend Option add_output(Command& command, const std::string& name, Output& output,
                           const std::string& help, StdoutUse stdout_use);
  Output(std::string option, std::string path)
      : option_(std::move(option)), path_(std::move(path)) {}

  std::string option_, path_;
};

/// Prints @p text unless JSON takes stdout, and writes @p json if that was asked for.
void emit(const std::string& text, const Json& json, const Output& json_target);

/// Writes @p text to @p target, or to stdout. @throws Error if it cannot be written.
void emit_text(const std::string& text, const Output& target);

/// Several results of a run that cannot be had again: what cannot be written does not cost the
/// rest.
class Results {
 public:
  void emit(const std::string& text, const Json& json, const Output& json_target);
  void write(const std::string& text, const Output& target);
  /// Something else that is not there.
  void add(const std::string& problem);
  /// @throws Error{kBadInput} with the first thing that could not be written; the others are
  /// warnings.
  void check() const;

 private:
  std::vector<std::string> problems_;
};

/// @throws Error{kBadInput} with @p remedy if both are the same file.
void refuse_same_file(const std::string& a, const std::string& b, const std::string& remedy);

/// A note on stderr. Not fmt::print, which throws where nobody listens.
void say(const std::string& line);
void warn(const std::string& message);
void warn_all(std::span<const std::string> messages);

/// How wide the terminal of stdout is; 0 if it is none, or does not say.
[[nodiscard]] std::size_t stdout_columns();

/// Whether stderr is a terminal that may be written over (progress lines).
[[nodiscard]] bool stderr_is_terminal();

}  // namespace pirt::cli
