// The cloud: calls go to workers elsewhere, over a link that may fail. See README.md.
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<const Backend> make_nats_backend();

}  // namespace pirt
