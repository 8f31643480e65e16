#include "scheduler/trace/trace_reader.h"

#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "scheduler/trace/trace_document.h"
#include "scheduler/trace/trace_file.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// What stands between @p begin and a brace with a comma or without, on lines that begin so.
std::optional<std::string_view> arguments(std::string_view line, std::string_view begin) {
  if (!line.starts_with(begin)) return std::nullopt;
  line.remove_prefix(begin.size());
  if (line.ends_with(',')) line.remove_suffix(1);
  if (line.ends_with('}')) line.remove_suffix(1);
  return line;
}

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
  naming(source_, [&] { begin(path); });
}

void TraceReader::begin(const std::filesystem::path& path) {
  // A line of what is no trace may have no end.
  line_.resize(TraceFile::kHeaderLine.size());
  in_.read(line_.data(), static_cast<std::streamsize>(line_.size()));
  std::string rest;
  if (line_ == TraceFile::kHeaderLine) std::getline(in_, rest);
  line_ += rest;
  if (const auto header = arguments(line_, TraceFile::kHeaderLine); header && !in_.eof()) {
    setup_ = dispatcher_setup_from_json(parse_json(*header));
    return;
  }
  Json document = parse_trace(read_text(path, kAnySize));
  Json& part = document.at("pirt");
  setup_ = dispatcher_setup_from_json(part);
  torn_ = part.at("inputs").is_null();
  if (!torn_) size_ = part.at("inputs").get<std::size_t>();
  log_ = std::move(part.at("log"));
}

std::optional<LogEntry> TraceReader::next() {
  return naming(source_, [this]() -> std::optional<LogEntry> {
    if (!log_) return next_line();
    if (read_ == log_->size()) return last(size_.value_or(read_));
    const Json& entry = log_->at(read_++);
    return log_entry_from_json(entry, read_);
  });
}

std::optional<LogEntry> TraceReader::next_line() {
  // A line without its end is one that was being written.
  while (std::getline(in_, line_) && !in_.eof()) {
    if (const auto entry = arguments(line_, TraceFile::kEntryLine)) {
      ++read_;
      return log_entry_from_json(parse_json(*entry), read_);
    }
    if (const auto end = arguments(line_, TraceFile::kEndLine)) {
      return last(parse_json(*end).at("inputs").get<std::size_t>());
    }
  }
  torn_ = true;
  return last(read_);
}

std::optional<LogEntry> TraceReader::last(std::size_t size) {
  size_ = size;
  if (read_ != size) throw_bad_input("its log is not as long as it says");
  return std::nullopt;
}

}  // namespace pirt
