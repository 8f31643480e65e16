#include "workloads/base/system/module.h"

#include <dlfcn.h>
#include <fmt/core.h>
#include <link.h>

#include <filesystem>
#include <map>
#include <vector>

#include "workloads/base/error.h"

/// Of programs that have an object more for it (module_folder.cpp.in): where modules are, and below
/// which folder the program lies then. Installed ones look into no build folder, which may be
/// somebody else's by then.
extern "C" {
[[gnu::weak]] const char* pirt_module_folder();
[[gnu::weak]] const char* pirt_program_folder();
}

namespace pirt {

namespace fs = std::filesystem;

namespace {

/// The file that this code is in: a library, or the program itself.
fs::path own_file() {
  Dl_info info{};
  link_map* object = nullptr;
  const bool known = ::dladdr1(reinterpret_cast<const void*>(&own_file), &info,
                               reinterpret_cast<void**>(&object), RTLD_DL_LINKMAP) != 0;
  const bool is_library = known && object->l_name != nullptr && *object->l_name != '\0';
  std::error_code unknown;
  return is_library ? fs::canonical(object->l_name, unknown)
                    : fs::read_symlink("/proc/self/exe", unknown);
}

}  // namespace

std::vector<fs::path> module_folders() { return module_folders(own_file()); }

std::vector<fs::path> module_folders(const fs::path& file) {
  std::vector<fs::path> folders;
  if (file.is_absolute()) {  // without /proc it is not known
    const fs::path beside = file.parent_path();
    const fs::path installed = beside.parent_path() / PIRT_MODULE_FOLDER;
    folders = {beside, beside / "pirt", installed, installed.parent_path()};
  }
  if (pirt_module_folder != nullptr && file.string().starts_with(pirt_program_folder())) {
    folders.emplace_back(pirt_module_folder());
  }
  folders.emplace_back(PIRT_INSTALLED_FOLDER);
  return folders;
}

std::vector<fs::path> program_files(const fs::path& program) {
  std::vector<fs::path> files = {program};
  std::error_code missing;
  const fs::path code = own_file();
  if (fs::exists(code, missing) && !fs::equivalent(code, program, missing)) files.push_back(code);
  std::map<std::string, fs::path> modules;  // of a name the first, as module_symbol takes it
  for (const fs::path& folder : module_folders()) {
    for (const auto& entry : fs::directory_iterator(folder, missing)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("libpirt_") && name.ends_with(".so")) {
        modules.try_emplace(name, entry.path());
      }
    }
  }
  for (const auto& [name, file] : modules) files.push_back(file);
  return files;
}

void* module_symbol(const char* module, const char* symbol, const std::string& remedy) {
  std::string why;
  const auto places = module_folders();
  for (const fs::path& folder : places) {
    const fs::path place = folder / module;
    std::error_code unreadable;
    if (!fs::exists(place, unreadable)) {
      if (unreadable) why = fmt::format("{}: {}", place.string(), unreadable.message());
      continue;
    }
    void* const loaded = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const found = loaded == nullptr ? nullptr : ::dlsym(loaded, symbol);
    if (found != nullptr) return found;
    why = ::dlerror();
  }
  if (why.empty()) {
    why = fmt::format("it is neither in {} nor in {}", places.front().string(),
                      places.back().string());
  }
  throw_environment(
      fmt::format("cannot load {}, {}: {}; install pirt with it", module, remedy, why));
}

}  // namespace pirt
