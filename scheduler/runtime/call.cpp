#include "scheduler/runtime/call.h"

#include <utility>

namespace pirt {

Nanos CallTimes::of(Phase phase) const {
  switch (phase) {
    case Phase::kUpload:
      return upload;
    case Phase::kLaunch:
      return launch.value_or(Nanos::zero());
    case Phase::kExecute:
      return execute;
    case Phase::kDownload:
      return download;
    default:
      return upload + launch.value_or(Nanos::zero()) + execute + download;
  }
}

StateValue::StateValue(const Workload& workload)
    : initial_(std::make_shared<const std::vector<Tensor>>(workload.make_state())),
      sets_{copy_tensors(*initial_), make_tensors(workload.state->tensors)} {}

StateValue::StateValue(const StateValue& other)
    : initial_(other.initial_),
      sets_{copy_tensors(other.committed()), copy_tensors(other.committed())},
      version_(other.version_) {}

void StateValue::commit(std::uint64_t version) {
  current_ = 1 - current_;
  version_ = version;
}

void Call::commit(const CallEnd& end) {
  if (const auto its = std::exchange(state, nullptr)) its->commit(end.version);
}

void StateValue::restart() {
  for (std::size_t i = 0; i < initial_->size(); ++i) copy_tensor((*initial_)[i], next()[i]);
  commit(0);
}

}  // namespace pirt
