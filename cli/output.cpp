#include "cli/output.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt::cli {
namespace {

void write_stdout(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw_environment(std::string("cannot write to standard output: ") + std::strerror(errno));
  }
}

}  // namespace

void emit(const std::string& text, const nlohmann::ordered_json& json,
          const std::optional<std::string>& json_target) {
  if (json_target == "-") {
    write_stdout(json.dump(2) + "\n");
    return;
  }
  if (json_target) write_file(*json_target, json.dump(2) + "\n");
  write_stdout(text);
}

void emit_text(const std::string& text, const std::optional<std::string>& target) {
  if (target && *target != "-") {
    write_file(*target, text);
  } else {
    write_stdout(text);
  }
}

void refuse_same_file(const std::string& a, const std::string& b, const std::string& remedy) {
  std::error_code missing;  // which opening it explains
  if (std::filesystem::equivalent(a, b, missing)) {
    throw_bad_input("'" + a + "' and '" + b + "' are the same file" + remedy);
  }
}

void warn(const std::string& message) { std::fprintf(stderr, "warning: %s\n", message.c_str()); }

void warn_all(std::span<const std::string> messages) {
  for (const auto& message : messages) warn(message);
}

bool stderr_is_terminal() { return ::isatty(STDERR_FILENO) == 1; }

}  // namespace pirt::cli
