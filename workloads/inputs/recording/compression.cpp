// PIRT_BZ2 and PIRT_LZ4 say which libraries there were when pirt was built.
#include "workloads/inputs/recording/compression.h"

#ifdef PIRT_BZ2
#include <bzlib.h>
#endif
#ifdef PIRT_LZ4
#include <lz4frame.h>
#endif

#include "workloads/base/error.h"

namespace pirt {
namespace {

[[noreturn, maybe_unused]] void throw_without(const std::string& file, const std::string& name,
                                              const std::string& package) {
  throw_environment("'" + file + "' is compressed with " + name +
                    ", which pirt was built without; install " + package +
                    " and build again, or unpack it: rosbag decompress");
}

#ifdef PIRT_BZ2
bool unpack_bz2(const std::string& packed, std::string& out) {
  auto size = static_cast<unsigned int>(out.size());
  // The library has no view of constant memory; it only reads.
  const int result = BZ2_bzBuffToBuffDecompress(out.data(), &size, const_cast<char*>(packed.data()),
                                                static_cast<unsigned int>(packed.size()), 0, 0);
  return result == BZ_OK && size == out.size();
}
#endif

#ifdef PIRT_LZ4
bool unpack_lz4(const std::string& packed, std::string& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
  std::size_t made = 0;
  std::size_t read = 0;
  std::size_t hint = 1;
  while (hint != 0 && read < packed.size()) {
    std::size_t room = out.size() - made;
    std::size_t given = packed.size() - read;
    hint =
        LZ4F_decompress(context, out.data() + made, &room, packed.data() + read, &given, nullptr);
    if (LZ4F_isError(hint) || (room == 0 && given == 0)) break;
    made += room;
    read += given;
  }
  LZ4F_freeDecompressionContext(context);
  return hint == 0 && made == out.size();
}
#endif

}  // namespace

void check_compression(std::string_view name, const std::string& file) {
  if (name == "none") return;
  if (name == "bz2") {
#ifndef PIRT_BZ2
    throw_without(file, "bz2", "libbz2-dev");
#endif
    return;
  }
  if (name == "lz4") {
#ifndef PIRT_LZ4
    throw_without(file, "lz4", "liblz4-dev");
#endif
    return;
  }
  throw_bad_input("'" + file + "' is compressed with '" + std::string(name) +
                  "', which is not known; bags have none, bz2 or lz4");
}

std::string unpack(std::string_view name, const std::string& packed, std::size_t size,
                   const std::string& file) {
  std::string out(size, '\0');
  bool done = false;
#ifdef PIRT_BZ2
  if (name == "bz2") done = unpack_bz2(packed, out);
#endif
#ifdef PIRT_LZ4
  if (name == "lz4") done = unpack_lz4(packed, out);
#endif
  if (!done)
    throw_bad_input("'" + file + "' is damaged: a chunk of " + std::string(name) +
                    " does not unpack");
  return out;
}

}  // namespace pirt
