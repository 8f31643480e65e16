#include "scheduler/trace/trace_document.h"

#include <string_view>
#include <utility>

#include "scheduler/trace/trace_file.h"
#include "workloads/base/error.h"

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

}  // namespace

Json parse_trace(const std::string& text) {
  Json json = text.starts_with('[') ? parse_lines(text) : parse_json(text);
  if (json.is_array()) json = sorted(json);
  if (!json.is_object() || !json.contains("traceEvents") || !json.contains("pirt")) {
    throw_bad_input("not a trace of pirt's; `pirt schedule --trace FILE` writes one");
  }
  return json;
}

}  // namespace pirt
