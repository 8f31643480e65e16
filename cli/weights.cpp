#include "cli/weights.h"

#include <charconv>

#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt::cli {

std::map<std::string, int> parse_weights(const std::string& text) {
  std::map<std::string, int> weights;
  for (const auto& part : split(text, ',')) {
    const auto equals = part.find('=');
    int weight = -1;
    if (equals != std::string::npos && equals > 0) {
      const char* end = part.data() + part.size();
      const auto [stop, error] = std::from_chars(part.data() + equals + 1, end, weight);
      if (error != std::errc{} || stop != end) weight = -1;
    }
    if (weight < 0) {
      throw_bad_input("--weights: '" + part +
                      "' is not UNIT=WEIGHT with an integer of at least 0; write e.g. gpu=4,cpu=3");
    }
    if (!weights.emplace(part.substr(0, equals), weight).second) {
      throw_bad_input("--weights: unit '" + part.substr(0, equals) + "' is named twice");
    }
  }
  return weights;
}

}  // namespace pirt::cli
