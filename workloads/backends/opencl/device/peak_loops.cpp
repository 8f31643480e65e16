#include "workloads/backends/opencl/device/peak_loops.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <utility>

#include "opencl_files.h"
#include "workloads/base/math/peak_math.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/large_memory.h"

namespace pirt::opencl {
namespace {

constexpr int kChains = 8;
constexpr int kShifts = 4;  ///< Items start at one of so many places in the table of starts.
constexpr std::int32_t kIterations = 16'384;

/// Reads back what the items left.
template <typename T>
std::vector<T> read_back(const DeviceSession& session, const cl::Buffer& buffer,
                         std::size_t count) {
  std::vector<T> values(count);
  session.queue.enqueueReadBuffer(buffer, CL_TRUE, 0, count * sizeof(T), values.data());
  return values;
}

std::string shape_text(std::size_t items, const DeviceSession& session) {
  return fmt::format("{} work items in groups of {}", items, session.local_x);
}

/// Chains of multiply-adds: kernels chains1 to chains16.
class ChainPeak final : public PeakLoop {
 public:
  ChainPeak(DeviceSession session, const cl::Program& program, int width, std::size_t items)
      : session_(std::move(session)),
        kernel_(program, fmt::format("chains{}", width).c_str()),
        width_(width),
        items_(items) {
    std::vector<float> starts(static_cast<std::size_t>(width * kChains + kShifts));
    for (std::size_t i = 0; i < starts.size(); ++i) starts[i] = start_at(static_cast<int>(i));
    starts_ = cl::Buffer(session_.context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR,
                         starts.size() * sizeof(float), starts.data());
    sums_ = cl::Buffer(session_.context, CL_MEM_WRITE_ONLY, count() * sizeof(float));
    kernel_.setArg(0, sums_);
    kernel_.setArg(1, starts_);
    kernel_.setArg(2, peak_math::kFactor);
    kernel_.setArg(3, peak_math::kAddend);
    kernel_.setArg(4, static_cast<cl_int>(kIterations));
  }

  [[nodiscard]] PeakKind kind() const override { return PeakKind::kF32; }
  [[nodiscard]] std::string variant() const override {
    return fmt::format("{} chains of float{}, {}", kChains, width_, shape_text(items_, session_));
  }
  [[nodiscard]] double work() const override {
    return 2.0 * kIterations * kChains * width_ * static_cast<double>(items_);
  }

  void run(int repeats) override {
    translated("running a peak loop", [&] {
      for (int i = 0; i < repeats; ++i) {
        session_.queue.enqueueNDRangeKernel(kernel_, {}, {items_}, {session_.local_x});
      }
      session_.queue.finish();
    });
  }

  [[nodiscard]] Verdict verify() const override {
    const auto found = translated("reading a peak loop's result",
                                  [&] { return read_back<float>(session_, sums_, count()); });
    for (const auto rounding : {peak_math::Rounding::kOnce, peak_math::Rounding::kTwice}) {
      if (equals(found, expected(rounding))) {
        return {.ok = true, .detail = "every chain equals its scalar twin"};
      }
    }
    return {.ok = false, .detail = "no way of rounding gives the values found"};
  }

 private:
  static float start_at(int i) { return peak_math::start_of(i % peak_math::kStarts); }
  [[nodiscard]] std::size_t count() const { return items_ * static_cast<std::size_t>(width_); }

  /// What an item of each shift leaves, lane by lane: added in the kernel's order.
  [[nodiscard]] std::vector<float> expected(peak_math::Rounding rounding) const {
    std::array<float, peak_math::kStarts> ends{};
    for (int k = 0; k < peak_math::kStarts; ++k) {
      ends[static_cast<std::size_t>(k)] =
          peak_math::follow_chain(peak_math::start_of(k), kIterations, rounding);
    }
    std::vector<float> sums;
    for (int shift = 0; shift < kShifts; ++shift) {
      for (int lane = 0; lane < width_; ++lane) {
        const auto end = [&](int chain) {
          return ends[static_cast<std::size_t>((shift + chain * width_ + lane) %
                                               peak_math::kStarts)];
        };
        sums.push_back(((end(0) + end(1)) + (end(2) + end(3))) +
                       ((end(4) + end(5)) + (end(6) + end(7))));
      }
    }
    return sums;
  }

  static bool equals(const std::vector<float>& found, const std::vector<float>& expected) {
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i] != expected[i % expected.size()]) return false;
    }
    return true;
  }

  DeviceSession session_;
  cl::Kernel kernel_;
  cl::Buffer starts_, sums_;
  int width_;
  std::size_t items_;
};

/// Words on the device, in stretches one of which a launch reads, and on the host, where they are
/// summed to know what is right.
struct Words {
  LargeMemory host;
  std::size_t stretch_bytes;
  std::vector<cl::Buffer> stretches;

  /// @param stretch_bytes  Divides @p size_bytes.
  Words(const DeviceSession& session, std::size_t size_bytes, std::size_t stretch)
      : host(size_bytes), stretch_bytes(stretch) {
    peak_math::fill_words({host.as<std::uint32_t>(), size_bytes / sizeof(std::uint32_t)}, 1);
    // What is a host's already is not copied.
    const cl_mem_flags where = session.is_cpu ? CL_MEM_USE_HOST_PTR : CL_MEM_COPY_HOST_PTR;
    for (std::size_t at = 0; at < size_bytes; at += stretch) {
      stretches.emplace_back(session.context, CL_MEM_READ_ONLY | where, stretch,
                             host.as<std::byte>() + at);
    }
  }

  [[nodiscard]] std::size_t stretch_words() const { return stretch_bytes / sizeof(std::uint32_t); }

  [[nodiscard]] std::uint32_t sum(std::size_t stretch, int passes) const {
    const std::span words(host.as<std::uint32_t>() + stretch * stretch_words(), stretch_words());
    std::uint32_t total = 0;
    for (std::uint32_t pass = 0; pass < static_cast<std::uint32_t>(passes); ++pass) {
      for (const std::uint32_t word : words) total += word ^ pass;
    }
    return total;
  }
};

class ReadPeak final : public PeakLoop {
 public:
  enum class Order : std::uint8_t {
    kEachAll,      ///< A core's: every item reads all words, which each core has in its own cache.
    kStretches,    ///< A core's: items read one stretch each.
    kStreams,      ///< A core's: items read one stretch each, in four streams.
    kInterleaved,  ///< A GPU's: items read side by side.
  };

  /// @param items  Divides the lines (64 bytes) of what a launch reads into a multiple of four
  /// each.
  ReadPeak(DeviceSession session, const cl::Program& program, PeakKind kind, Order order,
           std::shared_ptr<const Words> words, std::size_t items, int passes)
      : session_(std::move(session)),
        kernel_(program, kernel_of(order)),
        kind_(kind),
        order_(order),
        words_(std::move(words)),
        items_(items),
        passes_(passes),
        sums_(session_.context, CL_MEM_WRITE_ONLY, items * sizeof(std::uint32_t)) {
    const std::size_t vector_words = order == Order::kInterleaved ? 4
                                     : order == Order::kStreams   ? 8
                                                                  : 16;
    const std::size_t shares = order == Order::kEachAll ? 1 : items;
    const auto count = static_cast<cl_int>(words_->stretch_words() / vector_words / shares);
    cl_uint next = 0;
    kernel_.setArg(next++, sums_);
    kernel_.setArg(next++, words_->stretches.front());
    if (order != Order::kInterleaved) {  // where an item begins
      kernel_.setArg(next++, order == Order::kEachAll ? cl_int{0} : count);
    }
    kernel_.setArg(next++, count);
    kernel_.setArg(next, static_cast<cl_int>(passes));
  }

  [[nodiscard]] PeakKind kind() const override { return kind_; }
  [[nodiscard]] std::string variant() const override {
    return fmt::format("{} of {} kB, {}", order_text(), words_->host.size_bytes() / 1024,
                       shape_text(items_, session_));
  }
  [[nodiscard]] double work() const override {
    return static_cast<double>(words_->stretch_bytes) * passes_ * times_read();
  }

  void run(int repeats) override {
    translated("running a peak loop", [&] {
      for (int i = 0; i < repeats; ++i) {
        at_ = (at_ + 1) % words_->stretches.size();
        kernel_.setArg(1, words_->stretches[at_]);
        session_.queue.enqueueNDRangeKernel(kernel_, {}, {items_}, {session_.local_x});
      }
      session_.queue.finish();
    });
  }

  [[nodiscard]] Verdict verify() const override {
    const auto sums = translated("reading a peak loop's result",
                                 [&] { return read_back<std::uint32_t>(session_, sums_, items_); });
    std::uint32_t found = 0;
    for (const std::uint32_t sum : sums) found += sum;
    const std::uint32_t expected =
        words_->sum(at_, passes_) * static_cast<std::uint32_t>(times_read());
    if (found == expected) return {.ok = true, .detail = "the sum is exact"};
    return {.ok = false, .detail = fmt::format("the sum is {} instead of {}", found, expected)};
  }

 private:
  static const char* kernel_of(Order order) {
    switch (order) {
      case Order::kEachAll:
      case Order::kStretches:
        return "read_lines";
      case Order::kStreams:
        return "read_streams";
      case Order::kInterleaved:
        break;
    }
    return "read_words";
  }

  [[nodiscard]] const char* order_text() const {
    switch (order_) {
      case Order::kEachAll:
        return "the same words";
      case Order::kStretches:
        return "stretches";
      case Order::kStreams:
        return "stretches in four streams";
      case Order::kInterleaved:
        break;
    }
    return "interleaved vectors";
  }

  /// In one pass, by all items together.
  [[nodiscard]] int times_read() const {
    return order_ == Order::kEachAll ? static_cast<int>(items_) : 1;
  }

  DeviceSession session_;
  cl::Kernel kernel_;
  PeakKind kind_;
  Order order_;
  std::shared_ptr<const Words> words_;
  std::size_t items_;
  int passes_;
  cl::Buffer sums_;
  std::size_t at_ = 0;  ///< The stretch that the last launch read.
};

/// What the loops need to know of a device.
struct Shape {
  std::size_t units = 1;
  std::optional<std::int64_t> l2_bytes;     ///< Of one core, or of a whole GPU.
  std::optional<std::int64_t> cache_bytes;  ///< All of the last level.
  std::int64_t memory_bytes = 0;            ///< That one buffer may have.
};

Shape shape_of(const DeviceSession& session) {
  Shape shape;
  shape.units = session.device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  shape.cache_bytes = cache_bytes(session.device, session.is_cpu);
  shape.l2_bytes = shape.cache_bytes;
  if (session.is_cpu) {
    shape.l2_bytes = read_cache_sizes(current_cores().front()).l2_bytes;
    shape.cache_bytes = std::max(shape.cache_bytes, all_last_cache_bytes());
  }
  const auto largest = session.device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  const auto memory = session.device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>() / 8;
  shape.memory_bytes = static_cast<std::int64_t>(std::min(largest, memory));
  return shape;
}

void add_chains(const DeviceSession& session, const cl::Program& program, const Shape& shape,
                PeakLoops& all) {
  // A core's vector is a work item's, a GPU's is made of work items.
  const std::array<int, 3> widths = session.is_cpu ? std::array{4, 8, 16} : std::array{1, 4, 8};
  const std::array<std::size_t, 2> groups =
      session.is_cpu ? std::array<std::size_t, 2>{1, 4} : std::array<std::size_t, 2>{8, 32};
  for (const int width : widths) {
    for (const std::size_t per_unit : groups) {
      all.loops.push_back(std::make_unique<ChainPeak>(session, program, width,
                                                      shape.units * session.local_x * per_unit));
    }
  }
}

/// @param wished_bytes  The size is the power of two below it: whatever the number of items (one,
/// too), all read alike.
void add_reads(const DeviceSession& session, const cl::Program& program, PeakKind kind,
               std::int64_t wished_bytes, const Shape& shape, PeakLoops& all) {
  // Enough that launching costs nothing, in several passes where one takes microseconds.
  const std::size_t bytes_a_launch = std::size_t{session.is_cpu ? 64U : 1024U} << 20U;
  const auto size_bytes = std::bit_floor(static_cast<std::size_t>(wished_bytes));
  // Of a core's memory not more: the stretch that comes next is the one that was read longest ago.
  const auto stretch = session.is_cpu ? std::min(size_bytes, bytes_a_launch) : size_bytes;
  const auto words = std::make_shared<const Words>(session, size_bytes, stretch);
  using Order = ReadPeak::Order;
  const auto orders = !session.is_cpu ? std::vector{Order::kInterleaved}
                      : kind == PeakKind::kBandwidthL2
                          ? std::vector{Order::kEachAll}
                          : std::vector{Order::kStretches, Order::kStreams};
  const std::size_t lines = stretch / 64;
  std::size_t last_items = 0;
  for (const std::size_t per_unit :
       session.is_cpu ? std::array<std::size_t, 2>{1, 4} : std::array<std::size_t, 2>{8, 32}) {
    const std::size_t items =
        std::min(std::bit_floor(shape.units * session.local_x * per_unit), lines / 4);
    if (items < session.local_x || items % session.local_x != 0 || items == last_items) continue;
    last_items = items;
    for (const Order order : orders) {
      const std::size_t a_pass = order == Order::kEachAll ? stretch * items : stretch;
      const auto passes = static_cast<int>(std::max<std::size_t>(bytes_a_launch / a_pass, 1));
      all.loops.push_back(
          std::make_unique<ReadPeak>(session, program, kind, order, words, items, passes));
    }
  }
}

void add_l2_reads(const DeviceSession& session, const cl::Program& program, const Shape& shape,
                  PeakLoops& all) {
  if (!shape.l2_bytes) return;
  add_reads(session, program, PeakKind::kBandwidthL2, *shape.l2_bytes / 2, shape, all);
  // What a GPU's driver calls its cache may be its units' own ones together (NVIDIA's: 4 MB of an
  // H200, whose L2 has 50): sizes around it, of which those beyond the L2 are read slower.
  if (session.is_cpu) return;
  for (const int times : {2, 4}) {
    add_reads(session, program, PeakKind::kBandwidthL2, times * *shape.l2_bytes, shape, all);
  }
}

/// Four times all caches of the last level, at least 64 MB; of a GPU, whose driver may not say how
/// large these are, at least 1 GB.
void add_memory_reads(const DeviceSession& session, const cl::Program& program, const Shape& shape,
                      PeakLoops& all) {
  const std::int64_t least = std::int64_t{session.is_cpu ? 64 : 1024} << 20;
  const std::int64_t wished = std::max(4 * shape.cache_bytes.value_or(0), least);
  const auto size = static_cast<std::int64_t>(
      std::bit_floor(static_cast<std::uint64_t>(std::min(wished, shape.memory_bytes))));
  if (size >= 2 * shape.cache_bytes.value_or(0)) {
    add_reads(session, program, PeakKind::kBandwidthMemory, size, shape, all);
  }
}

/// The session with groups that each kernel of the program takes.
DeviceSession with_groups_that_fit(DeviceSession session, cl::Program& program) {
  std::vector<cl::Kernel> kernels;
  program.createKernels(&kernels);
  for (const cl::Kernel& kernel : kernels) {
    session.local_x = std::min(
        session.local_x,
        std::bit_floor(kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(session.device)));
  }
  return session;
}

}  // namespace

std::optional<std::int64_t> cache_bytes(const cl::Device& device, bool is_cpu) {
  if (is_cpu) {
    if (const auto size = read_cache_sizes(current_cores().front()).last_bytes) return size;
  }
  const auto size = device.getInfo<CL_DEVICE_GLOBAL_MEM_CACHE_SIZE>();
  return size == 0 ? std::nullopt : std::optional(static_cast<std::int64_t>(size));
}

PeakLoops make_peak_loops(const DeviceSession& opened) {
  const auto source = find_embedded(opencl_files::files(), "peaks.cl");
  cl::Program program = build_program(opened, "peaks.cl", source.value());
  const DeviceSession session = with_groups_that_fit(opened, program);
  const Shape shape = shape_of(session);
  PeakLoops all;
  all.unavailable = {
      {PeakKind::kInt8, "OpenCL 1.2 has no dot product of 8-bit integers"},
      {PeakKind::kBandwidthL2, "the device does not say how large its cache is"},
      {PeakKind::kBandwidthMemory, "a buffer of the device cannot exceed its caches"}};
  add_chains(session, program, shape, all);
  add_l2_reads(session, program, shape, all);
  add_memory_reads(session, program, shape, all);
  for (const auto& loop : all.loops) all.unavailable.erase(loop->kind());
  return all;
}

}  // namespace pirt::opencl
