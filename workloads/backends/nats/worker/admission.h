// What a worker computes: workloads that it knows, with the sizes that it knows, or those that its
// own makers make of a picture's, and nothing else.
// Pure; what it admits is ready to be computed, and what it does not was never allocated.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/own_sizes.h"
#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

struct Admitted {
  const Workload* workload = nullptr;
  std::optional<Blob> parameters = {};
  std::vector<Tensor> inputs = {};
};

class Admission {
 public:
  /// @param workloads  Are there as long as this is. Those with a state are left out.
  explicit Admission(std::span<const Workload* const> workloads);

  /// @param body  Of a task.
  [[nodiscard]] Decoded<Admitted> admit(ByteView body) const;
  /// What the worker announces.
  [[nodiscard]] std::vector<AnnouncementMessage::Known> known() const;

 private:
  struct Known {
    const Workload* workload = nullptr;
    Digest spec;
    std::uint64_t parameter_bytes = 0;  ///< As encode_tensors writes them.
  };
  std::map<std::string, Known, std::less<>> known_;
  OwnSizes own_sizes_;
};

}  // namespace pirt::cloud
