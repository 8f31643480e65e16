#include "workloads/pictures/decoder.h"

#include "workloads/base/module.h"

namespace pirt {

DecodedPicture decode_picture(const std::string& bytes) {
  static auto* const decode = reinterpret_cast<DecodePictureFunction*>(module_symbol(
      "libpirt_pictures.so", kDecodePictureName, "which reads pictures (or leave out --images)"));
  DecodedPicture picture;
  decode(bytes, picture);
  return picture;
}

}  // namespace pirt
