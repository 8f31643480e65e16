#include "scheduler/trace/trace_file.h"

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

TraceFile::TraceFile(const std::filesystem::path& path, const Json& header)
    : file_(target_of(path)) {
  line(kHeaderLine, json_text(header), "},\n");
}

void TraceFile::line(std::string_view begin, std::string_view json, std::string_view end) {
  file_.write(begin);
  file_.write(json);
  file_.write(end);
}

void TraceFile::log(std::string_view json) {
  ++log_count_;
  line(kEntryLine, json, "},\n");
}

void TraceFile::flush() {
  if (log_count_ == 0) return;
  if (std::exchange(published_, true)) return file_.flush();
  file_.publish();
}

void TraceFile::finish() {
  line(kEndLine, json_text(Json{{"inputs", log_count_}}), "}\n]\n");
  return published_ ? file_.flush() : file_.publish();
}

}  // namespace pirt
