// PIRT_BZ2, PIRT_LZ4 and PIRT_ZSTD say which libraries there were when pirt was built.
#include "workloads/inputs/recording/compression.h"

#ifdef PIRT_BZ2
#include <bzlib.h>
#endif
#ifdef PIRT_LZ4
#include <lz4frame.h>
#endif
#ifdef PIRT_ZSTD
#include <zstd.h>
#endif

#include <algorithm>
#include <fstream>
#include <memory>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/random_file.h"

namespace pirt {
namespace {

[[noreturn, maybe_unused]] void throw_without(const std::string& file, const std::string& name,
                                              const std::string& package) {
  throw_environment("'" + file + "' is compressed with " + name +
                    ", which pirt was built without; install " + package +
                    " and build again, or unpack it: `rosbag decompress`, `ros2 bag convert`");
}

[[maybe_unused]] constexpr std::size_t kPiece = std::size_t{256} << 10;

#ifdef PIRT_BZ2
bool unpack_bz2(const ReadPacked& read, std::string& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  stream.next_out = out.data();
  stream.avail_out = static_cast<unsigned int>(out.size());
  int result = BZ_OK;
  for (std::string piece = read(kPiece); result == BZ_OK && !piece.empty(); piece = read(kPiece)) {
    stream.next_in = piece.data();
    stream.avail_in = static_cast<unsigned int>(piece.size());
    result = BZ2_bzDecompress(&stream);
    if (result == BZ_OK && stream.avail_in > 0) break;  // more comes out than there is room for
  }
  BZ2_bzDecompressEnd(&stream);
  return result == BZ_STREAM_END && stream.avail_out == 0;
}
#endif

#ifdef PIRT_LZ4
bool unpack_lz4(const ReadPacked& read, std::string& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
  LZ4F_decompressOptions_t options{};
  options.stableDst = 1;  // what came out stays where it is
  std::size_t made = 0;
  std::size_t hint = 1;
  std::string piece;
  std::size_t taken = 0;
  while (hint != 0 && !LZ4F_isError(hint)) {
    if (taken == piece.size()) {
      piece = read(kPiece);
      taken = 0;
      if (piece.empty()) break;
    }
    std::size_t room = out.size() - made;
    std::size_t given = piece.size() - taken;
    hint =
        LZ4F_decompress(context, out.data() + made, &room, piece.data() + taken, &given, &options);
    if (room == 0 && given == 0) break;
    made += room;
    taken += given;
  }
  LZ4F_freeDecompressionContext(context);
  return hint == 0 && made == out.size();
}
#endif

#ifdef PIRT_ZSTD
using Write = std::function<void(std::string_view bytes)>;

/// Of any number of frames, piece by piece. False if they are damaged or end early.
bool unpack_zstd(const ReadPacked& read, const Write& write) {
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(),
                                                                        ZSTD_freeDCtx);
  std::string made(kPiece, '\0');
  std::size_t hint = 1;
  for (std::string piece = read(kPiece); !piece.empty(); piece = read(kPiece)) {
    ZSTD_inBuffer in{piece.data(), piece.size(), 0};
    // The last byte of a frame is not taken before all that it holds was written.
    while (in.pos < in.size) {
      ZSTD_outBuffer out{made.data(), made.size(), 0};
      hint = ZSTD_decompressStream(context.get(), &out, &in);
      if (ZSTD_isError(hint) != 0) return false;
      write(std::string_view(made).substr(0, out.pos));
    }
  }
  return hint == 0;
}
#endif

#ifdef PIRT_LZ4
std::string pack_lz4(std::string_view bytes) {
  std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
  packed.resize(
      LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  return packed;
}
#endif

#ifdef PIRT_ZSTD
std::string pack_zstd(std::string_view bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 0));
  return packed;
}
#endif

}  // namespace

std::string_view best_compression() {
#if defined PIRT_ZSTD
  return "zstd";
#elif defined PIRT_LZ4
  return "lz4";
#else
  return "none";
#endif
}

std::string pack(std::string_view name, std::string_view bytes, const std::string& file) {
  check_compression(name, file);
#ifdef PIRT_LZ4
  if (name == "lz4") return pack_lz4(bytes);
#endif
#ifdef PIRT_ZSTD
  if (name == "zstd") return pack_zstd(bytes);
#endif
  return std::string(bytes);
}

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
  if (name == "zstd") {
#ifndef PIRT_ZSTD
    throw_without(file, "zstd", "libzstd-dev");
#endif
    return;
  }
  throw_bad_input("'" + file + "' is compressed with '" + std::string(name) +
                  "', which is not known; recordings have none, bz2, lz4 or zstd");
}

std::string unpack(std::string_view name, [[maybe_unused]] const ReadPacked& packed,
                   std::size_t size, const std::string& file) {
  std::string out(name == "zstd" ? 0 : size, '\0');
  bool done = false;
#ifdef PIRT_BZ2
  if (name == "bz2") done = unpack_bz2(packed, out);
#endif
#ifdef PIRT_LZ4
  if (name == "lz4") done = unpack_lz4(packed, out);
#endif
#ifdef PIRT_ZSTD
  if (name == "zstd") {
    out.reserve(size);
    bool fits = true;
    const bool is_whole = unpack_zstd(packed, [&](std::string_view bytes) {
      fits = fits && bytes.size() <= size - out.size();
      if (fits) out += bytes;
    });
    done = is_whole && fits && out.size() == size;
  }
#endif
  if (!done)
    throw_bad_input("'" + file + "' is damaged: a chunk of " + std::string(name) +
                    " does not unpack");
  return out;
}

bool is_packed(std::string_view message) { return message.starts_with("\x28\xb5\x2f\xfd"); }

std::string unpack_message(std::string message, const std::string& file) {
  check_compression("zstd", file);
  std::string out;
#ifdef PIRT_ZSTD
  const ReadPacked read = [&](std::size_t) { return std::exchange(message, {}); };
  const Write write = [&](std::string_view bytes) {
    if (out.size() + bytes.size() > kMostChunkBytes) {
      throw_bad_input("'" + file + "' is damaged: a message has no end");
    }
    out += bytes;
  };
  if (!unpack_zstd(read, write)) {
    throw_bad_input("'" + file + "' is damaged: a message of zstd does not unpack");
  }
#endif
  return out;
}

void unpack_file(const std::filesystem::path& packed,
                 [[maybe_unused]] const std::filesystem::path& plain) {
  check_compression("zstd", packed.string());
#ifdef PIRT_ZSTD
  const RandomFile from(packed);
  std::ofstream to(plain, std::ios::binary);
  const auto head = from.read(0, std::min<std::uint64_t>(from.size(), 18));
  const auto says = ZSTD_getFrameContentSize(head.data(), head.size());
  const auto need = says < ZSTD_CONTENTSIZE_ERROR ? std::uint64_t{says} : from.size();
  const auto check_room = [&](std::uint64_t bytes) {
    std::error_code failed;
    const auto room = std::filesystem::space(plain.parent_path(), failed);
    if (!failed && room.available >= bytes && to.good()) return;
    throw_environment("'" + packed.string() + "' does not fit unpacked into '" +
                      plain.parent_path().parent_path().string() +
                      "'; name a folder with more room: TMPDIR=FOLDER");
  };
  check_room(need);
  const Write write = [&](std::string_view bytes) {
    if (!to.write(bytes.data(), static_cast<std::streamsize>(bytes.size()))) check_room(1);
  };
  if (!unpack_zstd(from.pieces(0, from.size()), write)) {
    throw_bad_input("'" + packed.string() + "' is damaged: it does not unpack. Copy it again");
  }
  if (!to.flush()) check_room(1);
#endif
}

}  // namespace pirt
