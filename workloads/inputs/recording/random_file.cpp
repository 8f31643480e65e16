#include "workloads/inputs/recording/random_file.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {

RandomFile::RandomFile(const std::filesystem::path& file, std::string name)
    : name_(name.empty() ? file.string() : std::move(name)),
      fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  struct stat about {};
  if (fd_.get() < 0 || ::fstat(fd_.get(), &about) != 0) {
    throw_bad_input("'" + name_ + "' cannot be read: " + std::strerror(errno));
  }
  if (!S_ISREG(about.st_mode)) throw_bad_input("'" + name_ + "' is no file");
  size_ = static_cast<std::uint64_t>(about.st_size);
  if (size_ == 0) throw_bad_input("'" + name_ + "' is empty");
  refuse_pointer(file, read(0, std::min<std::uint64_t>(size_, 64)));
}

std::string RandomFile::read(std::uint64_t at, std::uint64_t count) const {
  const auto cut = [this] {
    throw_bad_input(fmt::format(
        "'{}' is not whole: it ends within a record, at byte {}. Copy it again, or repair it with "
        "`rosbag reindex` or `mcap recover`",
        name_, size_));
  };
  if (at > size_ || count > size_ - at) cut();
  std::string bytes(count, '\0');
  for (std::size_t done = 0; done < count;) {
    const auto got =
        ::pread(fd_.get(), bytes.data() + done, count - done, static_cast<off_t>(at + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw_bad_input("'" + name_ + "' cannot be read: " + std::strerror(errno));
    if (got == 0) cut();
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

std::function<std::string(std::size_t)> RandomFile::pieces(std::uint64_t at,
                                                           std::uint64_t count) const {
  return [this, at, end = at + count](std::size_t most) mutable {
    std::string piece = read(at, std::min<std::uint64_t>(most, end - at));
    at += piece.size();
    return piece;
  };
}

}  // namespace pirt
