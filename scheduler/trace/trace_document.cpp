#include "scheduler/trace/trace_document.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string_view>
#include <utility>

#include "scheduler/trace/trace_file.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// Also of lines of which the rest is missing.
Json parse_lines(std::string_view text) {
  try {
    return parse_json(text);
  } catch (const JsonError&) {
    const auto last = text.rfind(",\n");
    if (!text.starts_with(TraceFile::kHeaderLine) || last == std::string_view::npos) throw;
    return parse_json(std::string(text.substr(0, last)) + "]");
  }
}

Json sorted(Json& lines) {
  Json events = Json::array();
  Json log = Json::array();
  Json header;
  Json inputs;
  for (Json& line : lines) {
    const auto name = line.is_object() ? line.value("name", "") : "";
    if (name == TraceFile::kHeaderName) {
      header = std::move(line.at("args"));
    } else if (name == TraceFile::kEntryName) {
      log.push_back(std::move(line.at("args")));
    } else if (name == TraceFile::kEndName) {
      inputs = line.at("args").at("inputs");
    } else {
      events.push_back(std::move(line));
    }
  }
  if (!header.is_object()) return {};
  header["inputs"] = inputs;
  header["log"] = std::move(log);
  return Json::object({{"traceEvents", std::move(events)}, {"pirt", std::move(header)}});
}

/// What stands between @p begin and a brace with a comma or without, on lines that begin so.
std::optional<std::string_view> arguments(std::string_view line, std::string_view begin) {
  if (!line.starts_with(begin)) return std::nullopt;
  line.remove_prefix(begin.size());
  if (line.ends_with(',')) line.remove_suffix(1);
  if (line.ends_with('}')) line.remove_suffix(1);
  return line;
}

/// That of a file with a line for each; absent where it is laid out otherwise.
std::optional<Json> read_header(std::istream& in) {
  // A line of what is no trace may have no end.
  std::string line(TraceFile::kHeaderLine.size(), ' ');
  in.read(line.data(), static_cast<std::streamsize>(line.size()));
  if (line != TraceFile::kHeaderLine || !std::getline(in, line) || in.eof()) return std::nullopt;
  return parse_json(*arguments(line, ""));
}

void check_length(std::size_t read, LogFile& log) {
  if (log.size.value_or(read) != read) throw_bad_input("its log is not as long as it says");
  log.size = read;
}

void read_lines(std::istream& in, const TakeEntry& take, LogFile& log) {
  std::size_t read = 0;
  std::string line;
  while (!log.size && log.complete) {
    // A line without its end is one that was being written.
    log.complete = std::getline(in, line) && !in.eof();
    if (!log.complete) break;
    if (const auto entry = arguments(line, TraceFile::kEntryLine)) {
      if (!take(log.setup, log_entry_from_json(parse_json(*entry), ++read))) return;
    } else if (const auto end = arguments(line, TraceFile::kEndLine)) {
      log.size = parse_json(*end).at("inputs").get<std::size_t>();
    }
  }
  check_length(read, log);
}

void read_document(const Json& part, const TakeEntry& take, LogFile& log) {
  log.complete = !part.at("inputs").is_null();
  if (log.complete) log.size = part.at("inputs").get<std::size_t>();
  const Json& entries = part.at("log");
  for (std::size_t read = 0; read < entries.size(); ++read) {
    if (!take(log.setup, log_entry_from_json(entries.at(read), read + 1))) return;
  }
  check_length(entries.size(), log);
}

}  // namespace

Json parse_trace(const std::string& text) {
  Json json = text.starts_with('[') ? parse_lines(text) : parse_json(text);
  if (json.is_array()) json = sorted(json);
  if (!json.is_object() || !json.contains("traceEvents") || !json.contains("pirt")) {
    throw_bad_input("not a trace of pirt's; `pirt schedule --trace FILE` writes one");
  }
  return json;
}

LogFile read_log(const std::filesystem::path& path, const TakeEntry& take) {
  const std::string source = path.string();
  std::ifstream in(path, std::ios::binary);
  if (!in) throw_bad_input("cannot read '" + source + "': " + std::strerror(errno));
  try {
    LogFile log;
    if (const auto header = read_header(in)) {
      log.setup = dispatcher_setup_from_json(*header);
      read_lines(in, take, log);
      return log;
    }
    // Without the events, of which there are more.
    const Json part = std::move(parse_trace(read_text(path, kAnySize)).at("pirt"));
    log.setup = dispatcher_setup_from_json(part);
    read_document(part, take, log);
    return log;
  } catch (const JsonError& error) {
    throw_bad_input(not_a_trace(source, error));
  } catch (const Error& error) {
    throw_bad_input(source + ": " + error.what());
  }
}

}  // namespace pirt
