#include "scheduler/trace/trace_reader.h"

#include <cerrno>
#include <cstring>
#include <string_view>

#include "scheduler/trace/trace_file.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

/// What @p read throws is about the file.
template <typename Read>
auto naming(const std::string& source, const Read& read) {
  try {
    return read();
  } catch (const JsonError& error) {
    throw_bad_input(not_a_trace(source, error));
  } catch (const Error& error) {
    throw_bad_input(source + ": " + error.what());
  }
}

}  // namespace

TraceReader::TraceReader(const std::filesystem::path& path)
    : source_(path.string()), in_(path, std::ios::binary) {
  if (!in_) throw_bad_input("cannot read '" + source_ + "': " + std::strerror(errno));
  naming(source_, [this] { begin(); });
}

void TraceReader::begin() {
  if (!std::getline(in_, line_) || line_ != TraceFile::kFirstLine) {
    otherwise_ = true;
    return;
  }
  while (std::getline(in_, line_)) {
    const std::string_view line = line_;
    if (!line.starts_with(TraceFile::kPart) || !line.ends_with(TraceFile::kLog)) continue;
    const auto begin = TraceFile::kPart.size();
    const auto header = line.substr(begin, line.size() - begin - TraceFile::kLog.size());
    const Json part = parse_json(std::string(header) + "}");
    setup_ = dispatcher_setup_from_json(part);
    size_ = part.at("inputs").get<std::size_t>();
    return;
  }
  otherwise_ = true;
}

std::optional<LogEntry> TraceReader::next() {
  return naming(source_, [this]() -> std::optional<LogEntry> {
    const bool read = static_cast<bool>(std::getline(in_, line_));
    std::string_view line = line_;
    if (!read) throw_bad_input("its log is cut off after " + std::to_string(read_) + " inputs");
    if (line == TraceFile::kEnd) {
      if (read_ != size_) throw_bad_input("its log is not as long as it says");
      return std::nullopt;
    }
    if (line.ends_with(',')) line.remove_suffix(1);
    ++read_;
    return log_entry_from_json(parse_json(line), read_);
  });
}

}  // namespace pirt
