// Weights as they are typed on the command line.
#pragma once

#include <map>
#include <string>

namespace pirt::cli {

/// "gpu=4,cpu=3" -> {gpu: 4, cpu: 3}. @throws Error{kBadInput} for another form, a weight that is
/// not an integer of at least 0, or a unit named twice. Whether there is such a unit is the
/// scheduler's to say.
[[nodiscard]] std::map<std::string, int> parse_weights(const std::string& text);

}  // namespace pirt::cli
