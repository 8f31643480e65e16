#include "workloads/base/system/module.h"

#include <dlfcn.h>
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "workloads/base/error.h"

namespace pirt {

namespace fs = std::filesystem;

std::vector<fs::path> module_folders() {
  std::error_code unknown;
  const fs::path program = fs::read_symlink("/proc/self/exe", unknown);
  return {program.parent_path().parent_path() / PIRT_MODULE_FOLDER, fs::path(PIRT_BUILD_FOLDER),
          fs::path(PIRT_INSTALLED_FOLDER)};
}

std::vector<fs::path> modules() {
  for (const fs::path& folder : module_folders()) {
    std::vector<fs::path> found;
    std::error_code missing;
    for (const auto& entry : fs::directory_iterator(folder, missing)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("libpirt_") && name.ends_with(".so")) found.push_back(entry.path());
    }
    std::ranges::sort(found);
    if (!found.empty()) return found;
  }
  return {};
}

void* module_symbol(const char* module, const char* symbol, const std::string& remedy) {
  std::string why;
  const auto places = module_folders();
  for (const fs::path& folder : places) {
    const fs::path place = folder / module;
    if (!fs::exists(place)) continue;
    void* const loaded = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const found = loaded == nullptr ? nullptr : ::dlsym(loaded, symbol);
    if (found != nullptr) return found;
    why = ::dlerror();
  }
  if (why.empty()) {
    why = fmt::format("it is neither in {} nor in {}", places[0].string(), places[2].string());
  }
  throw_environment(
      fmt::format("cannot load {}, {}: {}; install pirt with it", module, remedy, why));
}

}  // namespace pirt
