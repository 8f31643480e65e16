// What a platform file may say of a unit of backend nats, with or without the backend.
#pragma once

#include <string>
#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

/// Keys of the unit whose values are texts; nats_backend.cpp reads them from its request's script,
/// a map of them. Figures do not depend on them but by where the workers are.
[[nodiscard]] inline std::vector<std::string> nats_settings() {
  return {"server", "robot", "outbox", "insecure", "ca", "certificate", "key", "nkey", "nkey_seed"};
}

/// In the order in which nats_backend.cpp reads them.
[[nodiscard]] inline std::vector<OptionSpec> nats_options() {
  return {{"outbox_mb", "MB", "what the outbox may hold", 1, 1e6, 64},
          {"patience_s", "s", "a call waits for a lost server or worker before it is given back", 0,
           1e6, 30}};
}

}  // namespace pirt
