#include "workloads/backends/opencl/plan/transfers.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <exception>

#include "workloads/base/error.h"

namespace pirt::opencl {
namespace {

/// Lists of no more come whole, together with how many rows they have, instead of after it.
constexpr std::size_t kComesWhole = std::size_t{1} << 16;

/// Stages below are of a power of two, so that lists which grow little by little make few.
constexpr std::size_t kRoundedStage = std::size_t{8} << 20;

/// Rows and planes of a resident with a border, in bytes, as the rectangle commands want them.
struct Rectangle {
  cl::array<cl::size_type, 3> device_origin, host_origin, region;
  std::size_t row_pitch, slice_pitch;
};

Rectangle rectangle(const DeviceTensor& resident) {
  const std::size_t element = size_bytes(resident.spec.element);
  const auto pad = static_cast<std::size_t>(resident.pad);
  const auto& shape = resident.spec.shape;
  return {.device_origin = {pad * element, pad, 0},
          .host_origin = {0, 0, 0},
          .region = {static_cast<std::size_t>(shape.back()) * element,
                     static_cast<std::size_t>(shape.end()[-2]),
                     static_cast<std::size_t>(resident.planes())},
          .row_pitch = static_cast<std::size_t>(resident.pitch()) * element,
          .slice_pitch = static_cast<std::size_t>(resident.plane()) * element};
}

/// Of the buffer that @p residents are parts of; 0 if they are none.
std::size_t block_size(std::span<const DeviceTensor> residents) {
  if (residents.empty() || residents.front().block() == nullptr) return 0;
  return residents.front().block.getInfo<CL_MEM_SIZE>();
}

/// Waits for what is queued, where something is thrown as well: the device has the caller's memory
/// until then.
class Waiting {
 public:
  explicit Waiting(const cl::CommandQueue& queue) : queue_(queue) {}
  ~Waiting() {
    if (std::uncaught_exceptions() > exceptions_) clFinish(queue_());
  }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

  void finish() const { queue_.finish(); }

 private:
  const cl::CommandQueue& queue_;
  int exceptions_ = std::uncaught_exceptions();
};

}  // namespace

std::int64_t checked_count(std::int64_t count, std::int64_t most, const std::string& of) {
  if (count >= 0 && count <= most) return count;
  throw_environment(
      fmt::format("opencl: the device counts {} {}, of which there are at most {}; its driver is "
                  "broken, choose another device",
                  count, of, most));
}

/// Parts of the stage, one after the other.
class Transfers::Parts {
 public:
  /// @param size_bytes  Of all, each rounded up to rounded().
  Parts(Transfers& transfers, std::size_t size_bytes) {
    const DeviceSession& session = transfers.session_;
    auto& stage = transfers.stage_;
    auto& heap = transfers.list_;
    const bool is_pinned = session.pinned != nullptr;
    if (is_pinned && size_bytes > 0 && (!stage || stage->bytes().size() < size_bytes)) {
      stage.reset();
      try {
        stage = std::make_unique<PinnedMemory>(
            session.queue, size_bytes < kRoundedStage ? std::bit_ceil(size_bytes) : size_bytes);
      } catch (const cl::Error&) {  // It has none, or no more: slower memory does as well.
      }
    }
    if (!stage) heap.resize(std::max(heap.size(), size_bytes));
    left_ = stage ? stage->bytes() : std::span(heap);
  }
  [[nodiscard]] static std::size_t rounded(std::size_t size_bytes) {
    return (size_bytes + Tensor::kAlignment - 1) / Tensor::kAlignment * Tensor::kAlignment;
  }
  [[nodiscard]] std::byte* take(std::size_t size_bytes) {
    std::byte* const part = left_.data();
    left_ = left_.subspan(rounded(size_bytes));
    return part;
  }

 private:
  std::span<std::byte> left_;
};

Transfers::Transfers(const DeviceSession& session) : session_(session) {}

bool Transfers::by_stage(const DeviceTensor& resident, const std::byte* data,
                         std::size_t size_bytes) const {
  if (session_.pinned == nullptr) return false;
  if (session_.pinned->holds(data)) return false;
  return resident.pad > 0 || size_bytes <= kMostStaged;
}

void Transfers::write(std::span<const DeviceTensor> to, std::span<const Tensor> from) {
  const cl::CommandQueue& queue = session_.queue;
  std::vector<cl_int> rows(from.size());
  std::size_t staged = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const auto bytes = from[i].used_bytes();
    if (to[i].block() == nullptr && by_stage(to[i], bytes.data(), bytes.size())) {
      staged += Parts::rounded(bytes.size());
    }
  }
  const std::size_t block_bytes = block_size(to);
  Parts parts(*this, staged + Parts::rounded(block_bytes));
  std::byte* const block = block_bytes > 0 ? parts.take(block_bytes) : nullptr;
  const Waiting waiting(queue);
  for (std::size_t i = 0; i < from.size(); ++i) {
    rows[i] = static_cast<cl_int>(from[i].rows());
    const auto bytes = from[i].used_bytes();
    const std::byte* data = bytes.data();
    if (to[i].block() != nullptr) {
      if (!bytes.empty()) std::memcpy(block + to[i].at, data, bytes.size());
      if (to[i].spec.varies) std::memcpy(block + to[i].rows_at, &rows[i], sizeof(cl_int));
      continue;
    }
    if (to[i].spec.varies) {
      queue.enqueueWriteBuffer(to[i].rows, CL_FALSE, 0, sizeof(cl_int), &rows[i]);
    }
    if (bytes.empty()) continue;
    if (by_stage(to[i], data, bytes.size())) {
      std::byte* const part = parts.take(bytes.size());
      std::memcpy(part, data, bytes.size());
      data = part;
    }
    if (to[i].pad == 0) {
      queue.enqueueWriteBuffer(to[i].buffer, CL_FALSE, 0, bytes.size(), data);
    } else {
      const Rectangle r = rectangle(to[i]);
      queue.enqueueWriteBufferRect(to[i].buffer, CL_FALSE, r.device_origin, r.host_origin, r.region,
                                   r.row_pitch, r.slice_pitch, 0, 0, data);
    }
  }
  if (block != nullptr) {
    queue.enqueueWriteBuffer(to.front().block, CL_FALSE, 0, block_bytes, block);
  }
  waiting.finish();
}

void Transfers::read(std::initializer_list<Download> all) {
  struct Item {
    const DeviceTensor& from;
    Tensor& to;
    cl_int rows = 0;
    std::byte* part = nullptr;  ///< Of the stage; null = it goes to the tensor itself.
  };
  const cl::CommandQueue& queue = session_.queue;
  std::vector<Item> items;
  std::size_t staged = 0;
  for (const Download& each : all) {
    staged += Parts::rounded(each.to.empty() ? 0 : block_size(each.from));
    for (std::size_t i = 0; i < each.to.size(); ++i) {
      items.push_back({each.from[i], each.to[i]});
      const std::size_t bytes = each.to[i].bytes().size();
      if (each.from[i].block() == nullptr && by_stage(each.from[i], each.to[i].data(), bytes)) {
        staged += Parts::rounded(bytes);
      }
    }
  }
  Parts parts(*this, staged);
  const Waiting waiting(queue);
  const auto fetch = [&queue](const Item& item, std::size_t bytes) {
    if (bytes == 0) return;
    queue.enqueueReadBuffer(item.from.buffer, CL_FALSE, 0, bytes,
                            item.part != nullptr ? item.part : item.to.data());
  };
  const auto comes_whole = [](const Item& item) {
    return !item.from.spec.varies || item.from.block() != nullptr ||
           item.to.bytes().size() <= kComesWhole;
  };
  for (const Download& each : all) {
    const std::size_t bytes = each.to.empty() ? 0 : block_size(each.from);
    if (bytes == 0) continue;
    std::byte* const block = parts.take(bytes);
    queue.enqueueReadBuffer(each.from.front().block, CL_FALSE, 0, bytes, block);
    for (Item& item : items) {
      if (item.from.block() == each.from.front().block()) item.part = block + item.from.at;
    }
  }
  for (Item& item : items) {
    if (item.from.block() != nullptr) continue;
    const std::size_t bytes = item.to.bytes().size();
    if (by_stage(item.from, item.to.data(), bytes)) item.part = parts.take(bytes);
    if (item.from.spec.varies) {
      queue.enqueueReadBuffer(item.from.rows, CL_FALSE, 0, sizeof(cl_int), &item.rows);
    }
    if (comes_whole(item)) fetch(item, bytes);
  }
  waiting.finish();
  bool more = false;
  for (Item& item : items) {
    if (!item.from.spec.varies) continue;
    if (item.from.block() != nullptr) {
      std::memcpy(&item.rows, item.part - item.from.at + item.from.rows_at, sizeof(cl_int));
    }
    item.to.set_rows(checked_count(item.rows, item.from.spec.shape.front(),
                                   "rows of " + item.from.spec.describe()));
    if (comes_whole(item)) continue;
    fetch(item, item.to.used_bytes().size());
    more = true;
  }
  if (more) waiting.finish();
  for (const Item& item : items) {
    if (item.part != nullptr) {
      std::memcpy(item.to.data(), item.part, item.to.used_bytes().size());
    }
  }
}

std::span<const std::byte> Transfers::read(const Counted& counted) {
  const cl::CommandQueue& queue = session_.queue;
  const std::size_t all = counted.entry_bytes * static_cast<std::size_t>(counted.most);
  const std::size_t first = std::min(all, kComesWhole);
  cl_int count = 0;
  const auto room = [this](std::size_t size_bytes) {
    return Parts(*this, Parts::rounded(size_bytes)).take(size_bytes);
  };
  const Waiting waiting(queue);
  std::byte* to = room(first);
  queue.enqueueReadBuffer(counted.count, CL_FALSE, counted.index * sizeof(cl_int), sizeof(cl_int),
                          &count);
  queue.enqueueReadBuffer(counted.list, CL_FALSE, 0, first, to);
  waiting.finish();
  const std::size_t bytes =
      counted.entry_bytes *
      static_cast<std::size_t>(checked_count(count, counted.most, std::string(counted.of)));
  if (bytes > first) {
    to = room(bytes);
    queue.enqueueReadBuffer(counted.list, CL_FALSE, 0, bytes, to);
    waiting.finish();
  }
  return {to, bytes};
}

}  // namespace pirt::opencl
