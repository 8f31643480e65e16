// Playing the recorded inputs of a workload on a prepared kernel, frame by frame, with its state:
// for whoever measures or verifies. A workload of one call has a sequence of one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

/// All inputs of a workload's sequence; the parameters are the first one's.
[[nodiscard]] std::vector<Data> make_sequence(const Workload& workload, const DataRequest& first);

/// "sequence of 8 frames"; empty where one call is repeated.
[[nodiscard]] std::string sequence_note(const Workload& workload);

/// Used by one thread at a time.
class Player {
 public:
  /// Binds the first frame and the initial state, and takes that to the device.
  /// @param kernel            Prepared for @p workload on a device that outlives this.
  /// @param workload, frames  Outlive this.
  /// @param initial           The state before the first frame, where somebody has made it; absent
  /// = it is made here, which may take as long as what it comes from.
  /// @param memory  Of the outputs: Device::output_memory.
  /// @throws Whatever the kernel throws, here and below.
  Player(std::unique_ptr<Kernel> kernel, const Workload& workload, std::span<const Data> frames,
         std::optional<std::vector<Tensor>> initial = std::nullopt, TensorMemory* memory = nullptr);

  [[nodiscard]] Kernel& kernel() { return *kernel_; }
  /// Gives the kernel away and goes on with what @p wrap makes of it; what is bound stays so.
  void wrap_kernel(const std::function<std::unique_ptr<Kernel>(std::unique_ptr<Kernel>)>& wrap) {
    kernel_ = wrap(std::move(kernel_));
  }

  /// One complete call on the frame that is bound. Calls again give the same: only next() goes on.
  void call();
  /// Commits what the last call made of the state and binds the next frame; after the last one the
  /// sequence begins anew. Nothing for workloads that repeat one call.
  void next();
  /// The first frame and the initial state.
  void restart();
  /// From here on no frame counts as called, and their outputs hold nothing but @p with, which
  /// makes NaN of floats unless somebody says otherwise, with as many rows as they can have: what
  /// is found there later was written later.
  void scribble(std::byte with = std::byte{0xFF});
  /// Plays the sequence from its beginning if a frame of it was not called since scribble().
  void complete();
  /// Says that somebody else called the frame that is bound (Kernel::upload, execute, download).
  void called() { was_called_[frame_] = true; }

  [[nodiscard]] std::size_t frames() const { return frames_.size(); }
  /// Whether all outputs are in @p memory, which may have had less.
  [[nodiscard]] bool outputs_in(const TensorMemory& memory) const;
  /// The outputs of each frame's last call, beside what is expected of it.
  /// @param expected  As reference_of gives it.
  [[nodiscard]] std::vector<PlayedFrame> played(
      std::span<const std::vector<Tensor>> expected) const;
  /// Operations and bytes of a call, the mean over the frames; what does not follow from the data
  /// is the workload's. Outputs have been written.
  [[nodiscard]] std::optional<std::int64_t> mean_ops() const;
  [[nodiscard]] std::int64_t mean_bytes() const;

 private:
  void bind();

  const Workload& workload_;
  std::span<const Data> frames_;
  std::vector<std::vector<Tensor>> outputs_;  ///< Of each frame.
  std::vector<Tensor> current_, next_;        ///< The state's two sets; empty if there is none.
  std::vector<Tensor> initial_;
  std::vector<bool> was_called_;
  std::size_t frame_ = 0;
  std::unique_ptr<Kernel> kernel_;  // goes first: it may still hold what is bound
};

}  // namespace pirt
