#include "cli/options/output.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "cli/options/process_start.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

/// Files and pipes get what there is; a terminal would obey it.
void write_stdout(const std::string& text) {
  write_results(::isatty(results_descriptor()) == 1 ? printable(text, "\n\t") : text);
}

}  // namespace

bool means_stdout(std::string_view name) {
  return name == "-" || name == "/dev/stdout" || name == "/dev/fd/1" || name == "/proc/self/fd/1";
}

void emit(const std::string& text, const Json& json, const Output& json_target) {
  if (json_target.to_stdout()) {
    write_stdout(json_text(json, 2) + "\n");
    return;
  }
  if (json_target) write_file(json_target.path(), json_text(json, 2) + "\n");
  write_stdout(text);
}

void emit_text(const std::string& text, const Output& target) {
  if (target && !target.to_stdout()) {
    write_file(target.path(), text);
  } else {
    write_stdout(text);
  }
}

void Results::emit(const std::string& text, const Json& json, const Output& json_target) {
  try {
    cli::emit(text, json, json_target);
  } catch (const Error& error) {
    add(error.what());
    if (!json_target.to_stdout()) write(text, {});
  }
}

void Results::write(const std::string& text, const Output& target) {
  try {
    emit_text(text, target);
  } catch (const Error& error) {
    add(error.what());
  }
}

void Results::add(const std::string& problem) { problems_.push_back(problem); }

void Results::check() const {
  if (problems_.empty()) return;
  warn_all(std::span(problems_).subspan(1));
  throw_bad_input(problems_.front());
}

void refuse_same_file(const std::string& a, const std::string& b, const std::string& remedy) {
  std::error_code missing;  // which opening it explains
  if (std::filesystem::equivalent(a, b, missing)) {
    throw_bad_input("'" + a + "' and '" + b + "' are the same file" + remedy);
  }
}

void say(const std::string& line) { std::fprintf(stderr, "pirt: %s\n", printable(line).c_str()); }

void warn(const std::string& message) {
  std::fprintf(stderr, "warning: %s\n", printable(message).c_str());
}

void warn_all(std::span<const std::string> messages) {
  for (const auto& message : messages) warn(message);
}

std::size_t stdout_columns() {
  winsize size{};
  const bool known = ::ioctl(results_descriptor(), TIOCGWINSZ, &size) == 0;
  return known ? size.ws_col : 0;
}

bool stderr_is_terminal() {
  const char* const kind = std::getenv("TERM");
  return ::isatty(STDERR_FILENO) == 1 && (kind == nullptr || std::string_view(kind) != "dumb");
}

}  // namespace pirt::cli
