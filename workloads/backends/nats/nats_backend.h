// The cloud: calls go to workers elsewhere, over a link that may fail. See README.md. What a
// platform file may say of its unit is there with or without the backend.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<const Backend> make_nats_backend();

/// Keys of the unit whose values are texts; nats_backend.cpp reads them from its request's script,
/// a map of them. Figures do not depend on them but by where the workers are.
[[nodiscard]] inline std::vector<std::string> nats_settings() {
  return {"server", "robot", "insecure", "ca", "certificate", "key", "nkey", "nkey_seed", "hedge"};
}

/// In the order in which nats_backend.cpp reads them.
[[nodiscard]] inline std::vector<OptionSpec> nats_options() {
  return {{"patience_s", "s", "a call waits for a lost server or worker before it is given back", 0,
           1e6, 30}};
}

/// Why a key is none any more; empty for others.
[[nodiscard]] inline std::string nats_gone(std::string_view key) {
  if (key != "outbox" && key != "outbox_mb") return "";
  return "there is no outbox any more: every workload of the cloud is a function of its inputs, so "
         "that the robot sends a task again, or computes it itself; leave it out";
}

}  // namespace pirt
