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

TraceFile::TraceFile(const std::filesystem::path& path, Layout layout, Json header)
    : events_(target_of(path)), header_(std::move(header)) {
  if (layout == Layout::kWhole) {
    log_.emplace(follow_links(path));
    events_.write(std::string(kFirstLine) + "\n");
  } else {
    line(kHeaderLine, json_text(header_), "},\n");
  }
}

void TraceFile::line(std::string_view begin, std::string_view json, std::string_view end) {
  events_.write(begin);
  events_.write(json);
  events_.write(end);
}

void TraceFile::event(std::string_view json) {
  if (!log_) return line({}, json, ",\n");
  line(events_count_++ > 0 ? ",\n" : "", json, {});
}

void TraceFile::log(std::string_view json) {
  const bool first = log_count_++ == 0;
  if (!log_) {
    line(kEntryLine, json, "},\n");
    if (first) events_.publish();
    return;
  }
  if (!first) log_->write(",\n");
  log_->write(json);
}

void TraceFile::flush() {
  if (!log_) events_.flush();
}

void TraceFile::finish() {
  if (!log_) {
    line(kEndLine, json_text(Json{{"inputs", log_count_}}), "}\n]\n");
    return log_count_ == 0 ? events_.publish() : events_.flush();
  }
  header_["inputs"] = log_count_;
  std::string text = json_text(header_);
  text.pop_back();  // The brace; "log" comes last.
  // Perfetto leaves the rest of the file alone after a key that it does not know.
  events_.write("\n],\n" + std::string(kPart) + text + std::string(kLog) + "\n");
  events_.append(*log_);
  events_.write("\n" + std::string(kEnd) + "\n");
  events_.publish();
}

}  // namespace pirt
