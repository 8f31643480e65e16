#include "scheduler/trace/trace_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::filesystem::path beside(std::filesystem::path path, const std::string& suffix) {
  path += suffix + std::to_string(::getpid());
  return path;
}

}  // namespace

TraceFile::TraceFile(std::filesystem::path path)
    : path_(follow_links(std::move(path))),
      events_path_(beside(path_, ".tmp")),
      log_path_(beside(path_, ".log.tmp")) {
  if (std::filesystem::exists(path_) && !std::filesystem::is_regular_file(path_)) {
    throw_bad_input("cannot write a trace to '" + path_.string() + "': it is not a regular file");
  }
  errno = 0;
  events_.open(events_path_, std::ios::binary | std::ios::trunc);
  log_.open(log_path_, std::ios::binary | std::ios::trunc);
  if (!events_ || !log_) fail();
  events_ << "{\"displayTimeUnit\": \"ms\", \"traceEvents\": [\n";
}

TraceFile::~TraceFile() {
  std::error_code ignored;
  std::filesystem::remove(events_path_, ignored);
  std::filesystem::remove(log_path_, ignored);
}

void TraceFile::event(std::string_view json) {
  if (events_count_++ > 0) events_ << ",\n";
  events_ << json;
}

void TraceFile::log(std::string_view json) {
  if (log_count_++ > 0) log_ << ",\n";
  log_ << json;
}

void TraceFile::finish(const Json& header) {
  auto head = header;
  head["inputs"] = log_count_;
  std::string text = json_text(head);
  text.pop_back();  // The brace; "log" comes last.
  // Perfetto leaves the rest of the file alone after a key that it does not know.
  events_ << "\n],\n\"pirt\": " << text << ",\"log\": [\n";
  log_.close();
  std::ifstream log(log_path_, std::ios::binary);
  if (log_count_ > 0) events_ << log.rdbuf();
  events_ << "\n]}}\n";
  events_.close();
  if (!log_ || !log || !events_) fail();
  std::error_code failed;
  std::filesystem::rename(events_path_, path_, failed);
  if (failed) {
    throw_bad_input("cannot write the trace '" + path_.string() + "': " + failed.message());
  }
}

void TraceFile::fail() const {
  const int error = errno != 0 ? errno : EIO;
  // A constructor that throws runs no destructor.
  std::error_code ignored;
  std::filesystem::remove(events_path_, ignored);
  std::filesystem::remove(log_path_, ignored);
  throw_bad_input("cannot write the trace '" + path_.string() + "': " + std::strerror(error));
}

}  // namespace pirt
