#include "workloads/model/player.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace pirt {
namespace {

std::int64_t mean(std::int64_t sum, std::size_t count) {
  const auto n = static_cast<std::int64_t>(count);
  return (sum + n / 2) / n;
}

}  // namespace

std::vector<Data> make_sequence(const Workload& workload, const DataRequest& first) {
  std::vector<Data> frames;
  for (int frame = 0; frame < workload.frames; ++frame) {
    DataRequest request = first;
    request.frame = frame;
    frames.push_back(workload.make_data(request));
  }
  return frames;
}

std::string sequence_note(const Workload& workload) {
  if (!workload.is_played()) return "";
  return "sequence of " + std::to_string(workload.frames) +
         (workload.frames == 1 ? " frame" : " frames");
}

Player::Player(std::unique_ptr<Kernel> kernel, const Workload& workload,
               std::span<const Data> frames, std::optional<std::vector<Tensor>> initial,
               TensorMemory* memory)
    : workload_(workload), frames_(frames), was_called_(frames.size()), kernel_(std::move(kernel)) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    outputs_.push_back(make_tensors(workload.outputs, memory));
  }
  if (workload.state) {
    initial_ = initial ? std::move(*initial) : workload.make_state();
    current_ = make_tensors(workload.state->tensors);
    next_ = make_tensors(workload.state->tensors);
  }
  restart();
}

void Player::bind() {
  kernel_->bind(frames_[frame_].inputs, outputs_[frame_]);
  if (workload_.state) kernel_->bind_state(current_, next_);
}

void Player::call() {
  kernel_->upload();
  kernel_->execute(1);
  kernel_->download();
  called();
}

void Player::next() {
  if (!workload_.is_played()) return;
  if (frame_ + 1 == frames_.size()) {
    restart();
    return;
  }
  if (workload_.state) {
    kernel_->commit_state();
    std::swap(current_, next_);
  }
  ++frame_;
  bind();
}

void Player::restart() {
  frame_ = 0;
  for (std::size_t i = 0; i < initial_.size(); ++i) copy_tensor(initial_[i], current_[i]);
  bind();
  if (workload_.state) kernel_->upload_state();
}

void Player::scribble(std::byte with) {
  kernel_->scribble(with);
  for (auto& outputs : outputs_) {
    for (Tensor& tensor : outputs) {
      if (tensor.spec().varies) tensor.set_rows(tensor.dim(0));
      std::memset(tensor.data(), std::to_integer<int>(with), tensor.bytes().size());
    }
  }
  was_called_.assign(frames_.size(), false);
}

bool Player::outputs_in(const TensorMemory& memory) const {
  return std::ranges::all_of(outputs_, [&memory](const std::vector<Tensor>& outputs) {
    return std::ranges::all_of(
        outputs, [&memory](const Tensor& tensor) { return memory.holds(tensor.data()); });
  });
}

void Player::complete() {
  if (std::ranges::find(was_called_, false) == was_called_.end()) return;
  if (workload_.is_played()) restart();
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    call();
    next();
  }
}

std::vector<PlayedFrame> Player::played(std::span<const std::vector<Tensor>> expected) const {
  std::vector<PlayedFrame> all;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    all.push_back({.data = &frames_[i], .outputs = outputs_[i], .expected = expected[i]});
  }
  return all;
}

std::optional<std::int64_t> Player::mean_ops() const {
  if (!workload_.ops_of) return workload_.ops;
  std::int64_t sum = 0;
  for (const Data& data : frames_) sum += workload_.ops_of(data);
  return mean(sum, frames_.size());
}

std::int64_t Player::mean_bytes() const {
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    // Parameters are the first frame's and count by their specs.
    sum += workload_.bytes(frames_[i], outputs_[i]);
  }
  return mean(sum, frames_.size());
}

}  // namespace pirt
