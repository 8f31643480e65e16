#include "workloads/pictures/decoder.h"

#include <dlfcn.h>
#include <fmt/core.h>

#include <filesystem>
#include <vector>

#include "workloads/base/error.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr const char* kModule = "libpirt_pictures.so";

/// Where it is installed, seen from the program; where it is built.
std::vector<fs::path> places() {
  std::error_code unknown;
  const fs::path program = fs::read_symlink("/proc/self/exe", unknown);
  return {program.parent_path().parent_path() / PIRT_MODULE_FOLDER / kModule,
          fs::path(PIRT_BUILD_FOLDER) / kModule};
}

DecodePictureFunction* load() {
  std::string why;
  for (const fs::path& place : places()) {
    if (!fs::exists(place)) continue;
    void* const module = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = module == nullptr ? nullptr : ::dlsym(module, kDecodePictureName);
    if (symbol != nullptr) return reinterpret_cast<DecodePictureFunction*>(symbol);
    why = ::dlerror();
  }
  if (why.empty())
    why = fmt::format("it is neither in {} nor in {}", places()[0].parent_path().string(),
                      places()[1].parent_path().string());
  throw_environment(fmt::format(
      "cannot load {}, which reads pictures: {}; install pirt with it, or leave out --images",
      kModule, why));
}

}  // namespace

DecodedPicture decode_picture(const std::string& bytes) {
  static DecodePictureFunction* const decode = load();
  DecodedPicture picture;
  decode(bytes, picture);
  return picture;
}

}  // namespace pirt
