// Runs the built binary as its user would: arguments in, exit code, stdout and stderr out.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/paths.h"

namespace pirt::test {

struct Outcome {
  int exit_code = -1;  ///< -1 if a signal ended it.
  std::string out;
  std::string err;

  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(out); }
};

/// A folder that is gone when the test ends.
class Scratch {
 public:
  Scratch() {
    std::string name = (std::filesystem::temp_directory_path() / "pirt-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return file(name);
  }

 private:
  std::filesystem::path path_;
};

inline std::string slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// Runs a script of sh(1).
inline Outcome run(const std::string& script) {
  const Scratch scratch;
  const std::string command = "(" + script + ") </dev/null >" + quoted(scratch.file("out")) +
                              " 2>" + quoted(scratch.file("err"));
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, slurp(scratch.file("out")),
          slurp(scratch.file("err"))};
}

/// @param environment  "NAME=value" pairs in front of the command.
inline Outcome pirt(const std::vector<std::string>& arguments,
                    const std::string& environment = "") {
  std::string command = environment + " " + quoted(kProgram);
  for (const auto& argument : arguments) command += " " + quoted(argument);
  return run(command);
}

/// Exit 2, nothing on stdout, exactly one message line, which contains all of @p parts.
inline void expect_refused(const Outcome& outcome, const std::vector<std::string>& parts) {
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, testing::StartsWith("pirt: "));
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  for (const auto& part : parts) EXPECT_THAT(outcome.err, testing::HasSubstr(part));
}

}  // namespace pirt::test
