#include "workloads/base/system/program_path.h"

#include <unistd.h>

#include <cstdlib>
#include <sstream>
#include <system_error>

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

}  // namespace pirt
