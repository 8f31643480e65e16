#include "workloads/base/text/json_value.h"

template class nlohmann::basic_json<nlohmann::ordered_map>;

namespace pirt {

Json parse_json(std::string_view text) { return Json::parse(text); }

Json parse_json_or_discard(std::string_view text) { return Json::parse(text, nullptr, false); }

std::string json_text(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace pirt
