// What a robot does beside localizing itself, on the same units: whoever does it is told of each
// frame, and asks for workloads by name.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "scheduler/runtime/runtime.h"
#include "workloads/slam/run/pipeline.h"

namespace pirt {

/// Somebody who has workloads computed: a runtime, or the calling thread.
class Caller {
 public:
  virtual ~Caller() = default;
  /// Its outputs, or none if it did not complete; they are to be read within the call.
  using Done = std::function<void(std::optional<std::span<const Tensor>> outputs)>;
  /// @param done  Called once, perhaps from within this call, perhaps from another thread.
  virtual void call(std::string_view workload, const std::vector<Tensor>& inputs,
                    const TaskOptions& options, Done done) = 0;
};

/// Its functions are called by one thread at a time; they must be short, for the next frame waits.
class Companion {
 public:
  virtual ~Companion() = default;
  /// Before anything begins: adds what it will ask for.
  virtual void list_workloads(RuntimeOptions& options) const = 0;
  /// @param caller  Outlives all other calls.
  virtual void begin(Caller& caller) = 0;
  /// A frame has come that is not dropped. May be called beside `localized`, of an earlier frame.
  virtual void arrived(Nanos time, const GreyImage& left) = 0;
  /// @param state  Makes a copy of the state after this frame.
  virtual void localized(const slam::FrameResult& frame,
                         const std::function<slam::State()>& state) = 0;
  /// Points of the localization's map that are known better since it was last asked, at most
  /// slam::kMostBetter. Before each frame that is localized, after `localized` of the one before.
  virtual slam::BetterMap better_map() { return {}; }
};

}  // namespace pirt
