#include "scheduler/trace/trace_file.h"

#include <string>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// Where a trace of that name is to be.
/// @throws Error{kBadInput} if what is there is no file.
std::filesystem::path target_of(std::filesystem::path path) {
  auto target = follow_links(std::move(path));
  if (std::filesystem::exists(target) && !std::filesystem::is_regular_file(target)) {
    throw_bad_input("cannot write a trace to '" + target.string() + "': it is not a regular file");
  }
  remove_left_beside(target);
  return target;
}

}  // namespace

TraceFile::TraceFile(const std::filesystem::path& path)
    : events_(target_of(path)), log_(follow_links(path)) {
  events_.write(std::string(kFirstLine) + "\n");
}

void TraceFile::event(std::string_view json) {
  if (events_count_++ > 0) events_.write(",\n");
  events_.write(json);
}

void TraceFile::log(std::string_view json) {
  if (log_count_++ > 0) log_.write(",\n");
  log_.write(json);
}

void TraceFile::finish(const Json& header) {
  auto head = header;
  head["inputs"] = log_count_;
  std::string text = json_text(head);
  text.pop_back();  // The brace; "log" comes last.
  // Perfetto leaves the rest of the file alone after a key that it does not know.
  events_.write("\n],\n" + std::string(kPart) + text + std::string(kLog) + "\n");
  events_.append(log_);
  events_.write("\n" + std::string(kEnd) + "\n");
  events_.publish();
}

}  // namespace pirt
