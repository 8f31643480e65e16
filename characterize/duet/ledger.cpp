#include "characterize/duet/ledger.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kLedgerFormat = 1;
constexpr const char* kFormatKey = "pirt_ledger";

std::string value_text(const Ledger::Event& key, const std::string& field) {
  return key.contains(field) ? json_text(key[field]) : "nothing";
}

}  // namespace

Ledger::Ledger(std::filesystem::path path, const Event& key,
               const std::function<void(const Event&)>& replay)
    : path_(std::move(path)) {
  open();
  try {
    read(key, replay);
  } catch (...) {
    ::close(fd_);
    throw;
  }
}

Ledger::~Ledger() {
  if (fd_ >= 0) ::close(fd_);
}

Ledger::Ledger(Ledger&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)) {}

Ledger& Ledger::operator=(Ledger&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  return *this;
}

void Ledger::open() {
  fd_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (fd_ < 0) {
    throw_bad_input(fmt::format("cannot open ledger '{}': {}; name another with --ledger",
                                path_.string(), std::strerror(errno)));
  }
  struct stat file {};
  if (::fstat(fd_, &file) != 0 || !S_ISREG(file.st_mode)) {
    ::close(fd_);
    throw_bad_input(
        fmt::format("ledger '{}' is no file; name another with --ledger", path_.string()));
  }
  // A file system without locks: then nobody can have it either.
  if (::flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(fd_);
    throw_bad_input(fmt::format(
        "ledger '{}' is in use by another pirt; wait for it, or name another with --ledger",
        path_.string()));
  }
}

void Ledger::read(const Event& key, const std::function<void(const Event&)>& replay) {
  std::string text = read_file(path_, kAnySize);
  const std::size_t complete = text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1;
  // Only the tail of what this program writes is cut off, not somebody's notes.
  const std::string begin = fmt::format("{{\"{}\"", kFormatKey);
  const bool ours = text.starts_with(begin) || begin.starts_with(text);
  if (!ours) {
    throw_bad_input(
        fmt::format("'{}' is no ledger of pirt; name another with --ledger", path_.string()));
  }
  if (complete < text.size()) {
    if (::ftruncate(fd_, static_cast<off_t>(complete)) != 0) {
      throw_bad_input(
          fmt::format("cannot repair ledger '{}': {}", path_.string(), std::strerror(errno)));
    }
    text.resize(complete);
  }
  if (text.empty()) {
    Event header = {{kFormatKey, kLedgerFormat}};
    header["of"] = key;
    append(header);
    return;
  }
  text.pop_back();
  int number = 0;
  for (const std::string& line : split(text, '\n')) {
    ++number;
    const auto damaged = [&](const std::string& why) {
      throw_bad_input(fmt::format("ledger {}:{} is damaged ({}); remove it to begin anew",
                                  path_.string(), number, why));
    };
    const Event event = try_parse_json(line).value_or(Event());
    if (!event.is_object()) damaged("no JSON object");
    if (number > 1) {
      try {
        replay(event);
      } catch (const std::exception& error) {
        damaged(error.what());
      }
      continue;
    }
    if (event[kFormatKey] != kLedgerFormat || !event.contains("of")) {
      throw_bad_input(
          fmt::format("ledger '{}' is of another version of pirt; remove it", path_.string()));
    }
    const Event& there = event["of"];
    for (const auto& [field, value] : key.items()) {
      if (there.contains(field) && there[field] == value) continue;
      throw_bad_input(fmt::format(
          "ledger '{}' is of another comparison ({}: {} there, {} now); remove it, or name another "
          "with --ledger",
          path_.string(), field, value_text(there, field), value_text(key, field)));
    }
  }
}

void Ledger::append(const Event& event) {
  if (fd_ < 0) return;
  const std::string line = json_text(event) + "\n";
  struct stat before {};
  const bool known = ::fstat(fd_, &before) == 0;
  const ssize_t written = ::write(fd_, line.data(), line.size());
  const bool complete = written == static_cast<ssize_t>(line.size());
  if (complete && ::fdatasync(fd_) == 0) return;
  const std::string why = complete || written < 0 ? std::strerror(errno) : "no space";
  if (known) static_cast<void>(::ftruncate(fd_, before.st_size));
  throw_environment(
      fmt::format("cannot write to ledger '{}': {}; what was measured before is kept in it",
                  path_.string(), why));
}

}  // namespace pirt
