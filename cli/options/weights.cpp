#include "cli/options/weights.h"

#include <fmt/core.h>

#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

constexpr int kHighestWeight = 1'000'000;

}  // namespace

std::map<std::string, int> parse_weights(const std::string& text) {
  std::map<std::string, int> weights;
  for (const auto& part : split(text, ',')) {
    const auto equals = part.find('=');
    const bool has_both = equals != std::string::npos && equals > 0;
    const auto weight = whole_number(has_both ? part.substr(equals + 1) : "", 0, kHighestWeight);
    if (!weight.value) {
      throw_bad_input(fmt::format(
          "'{}' is not UNIT=WEIGHT with a whole number between 0 and {}; write e.g. gpu=4,cpu=3",
          part, kHighestWeight));
    }
    if (!weights.emplace(part.substr(0, equals), *weight.value).second) {
      throw_bad_input("unit '" + part.substr(0, equals) + "' is named twice");
    }
  }
  return weights;
}

}  // namespace pirt::cli
