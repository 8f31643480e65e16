#include "workloads/base/system/program_path.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

namespace pirt {

namespace fs = std::filesystem;

namespace {

std::optional<fs::path> if_it_runs(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored) || ::access(path.c_str(), X_OK) != 0) return std::nullopt;
  return fs::absolute(path);
}

}  // namespace

std::optional<fs::path> try_find_program(const std::string& word) {
  if (word.find('/') != std::string::npos) return if_it_runs(word);
  const char* const variable = std::getenv("PATH");
  if (variable == nullptr) return std::nullopt;
  std::istringstream folders(std::string(variable) + ':');  // an empty last one counts
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (auto found = if_it_runs(fs::path(folder.empty() ? "." : folder) / word)) return found;
  }
  return std::nullopt;
}

std::vector<CommandFile> files_named_by(std::span<const std::string> words,
                                        const fs::path& folder) {
  std::vector<CommandFile> files;
  std::set<std::string> known, written;
  std::vector<fs::path> folders = {""};  // The command's own, and those that it changes to.
  const auto add_within = [&](const fs::path& within, const std::string& word) {
    const std::string name = (within / word).string();
    if (!known.insert(name).second) return;
    const fs::path beside = folder / name;
    const bool has_path = name.find('/') != std::string::npos;
    const auto program = try_find_program(has_path ? beside.string() : name);
    std::error_code ignored;
    if (program && ::access(program->c_str(), R_OK) == 0) files.push_back({name, *program, true});
    // A word without a slash may be both.
    if (program && has_path) return;
    if (!fs::is_regular_file(beside, ignored) || ::access(beside.c_str(), R_OK) != 0) return;
    files.push_back({name, beside, false});
  };
  const auto add = [&](const std::string& word) {
    if (word.empty() || written.contains(word)) return;
    for (const fs::path& within : folders) add_within(within, word);
  };
  // From any of the others: a subshell's change ends with it.
  const auto change_to = [&](const std::string& word) {
    for (std::size_t i = 0, count = folders.size(); i < count; ++i) {
      fs::path next = (folders[i] / word).lexically_normal();
      std::error_code ignored;
      if (!fs::is_directory(folder / next, ignored)) continue;
      const bool is_new = std::find(folders.begin(), folders.end(), next) == folders.end();
      if (is_new) folders.push_back(std::move(next));
    }
  };
  std::string before;
  for (const std::string& word : words) {
    add(word);
    add(word.substr(word.find('=') + 1));
    std::string script;
    for (const char c : word) {
      const bool divides = std::string_view(";|&()<='\"`").find(c) != std::string_view::npos;
      script += c == '>' ? " > " : std::string(1, divides ? ' ' : c);
    }
    std::istringstream stream(script);
    std::vector<std::string> parts;
    for (std::string part; stream >> part;) parts.push_back(part);
    // What it writes is no part of what it is.
    for (std::size_t i = 1; i < parts.size(); ++i) {
      if (parts[i - 1] == ">") written.insert(parts[i]);
    }
    for (const std::string& part : parts) {
      if (before == "cd" || before == "-C" || before == "--chdir") change_to(part);
      add(part);
      before = part;
    }
  }
  return files;
}

}  // namespace pirt
