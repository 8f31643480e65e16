// Where results go: text on stdout, JSON to a file or stdout (then alone), progress and warnings on
// stderr.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

namespace pirt::cli {

/// With a newline. File names need not be UTF-8, and JSON has to be: their other bytes become
/// U+FFFD.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& json, int indent = 2);

/// Prints @p text unless JSON takes stdout, and writes @p json where `--json` says.
/// @param json_target  FILE or "-"; absent = no JSON.
void emit(const std::string& text, const nlohmann::ordered_json& json,
          const std::optional<std::string>& json_target);

/// Writes @p text to @p target; absent or "-" is stdout. @throws Error if it cannot be written.
void emit_text(const std::string& text, const std::optional<std::string>& target);

/// @throws Error{kBadInput} with @p remedy if both are the same file.
void refuse_same_file(const std::string& a, const std::string& b, const std::string& remedy);

void warn(const std::string& message);
void warn_all(std::span<const std::string> messages);

/// Whether stderr is a terminal that may be written over (progress lines).
[[nodiscard]] bool stderr_is_terminal();

}  // namespace pirt::cli
