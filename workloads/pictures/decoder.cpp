#include "workloads/pictures/decoder.h"

#include <dlfcn.h>
#include <fmt/format.h>

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

template <typename Function>
Function* load(const char* name) {
  std::string why;
  for (const fs::path& place : places()) {
    if (!fs::exists(place)) continue;
    void* const module = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = module == nullptr ? nullptr : ::dlsym(module, name);
    if (symbol != nullptr) return reinterpret_cast<Function*>(symbol);
    why = ::dlerror();
  }
  if (why.empty())
    why = fmt::format("it is neither in {} nor in {}", places()[0].parent_path().string(),
                      places()[1].parent_path().string());
  throw_environment(fmt::format(
      "cannot load {}, which reads and writes pictures: {}; install pirt with it, or use no files "
      "of pictures",
      kModule, why));
}

}  // namespace

DecodedPicture decode_picture(const std::string& bytes) {
  static auto* const decode = load<DecodePictureFunction>(kDecodePictureName);
  DecodedPicture picture;
  decode(bytes, picture);
  return picture;
}

cv::Mat decode_unchanged(const std::string& bytes) {
  static auto* const decode = load<DecodeUnchangedFunction>(kDecodeUnchangedName);
  cv::Mat pixels;
  decode(bytes, pixels);
  return pixels;
}

std::string encode_png(const cv::Mat& image) {
  static auto* const encode = load<EncodePngFunction>(kEncodePngName);
  std::string bytes;
  encode(image, bytes);
  if (bytes.empty()) throw_environment("OpenCV cannot write a PNG picture here");
  return bytes;
}

}  // namespace pirt
