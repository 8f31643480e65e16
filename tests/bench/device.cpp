// What a call of each workload costs on an OpenCL device with memory of its own, part by part, and
// beside what nobody can do without: the same bytes copied by pinned memory, and a peer's layers.
//
// Usage: device [--device NAME] [--filter REGEX] [--peers FILE] [--rounds N]
//   NAME is part of the device's name, the first one without. FILE has a line "WORKLOAD US" for
//   each layer that somebody else timed on the same device, calls in a row
//   (tests/bench/peers/layers.py); other lines, a library's warnings, are none.
//
// Columns: `waited` one call's launch and execution, waited for; `in a row` a call of 200 that are
// waited for once; `device` from its first kernel's start to its last one's end by its own stamps,
// `beside` what of `waited` is not that; `up` and `down` the transfers, each with its ratio to the
// pinned copy of as many bytes, one a tensor, queued and waited for once, and to and from the
// pinned memory.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <sstream>

#include "characterize/statistics/statistics.h"
#include "reports/document/document.h"
#include "reports/document/figures.h"
#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/backends/opencl/opencl_device.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/base/error.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"

namespace {

using namespace pirt;  // NOLINT: a program

constexpr int kInARow = 200;
constexpr double kLongestRowUs = 1e5;  // fewer in a row where these would take longer

struct Options {
  std::string device, filter = ".*", peers;
  int rounds = 30;
};

/// Median microseconds of a step, after three to settle.
double us_of(int rounds, const std::function<void()>& step) {
  static const MachineClock clock;
  for (int i = 0; i < 3; ++i) step();
  std::vector<Nanos> times;
  for (int i = 0; i < rounds; ++i) {
    const Nanos begin = clock.now();
    step();
    times.push_back(clock.now() - begin);
  }
  return static_cast<double>(median(times).count()) * 1e-3;
}

/// The same bytes by pinned memory: the least that a transfer of theirs takes.
class PinnedCopies {
 public:
  PinnedCopies(const opencl::DeviceSession& session, std::span<const Tensor> tensors)
      : session_(session) {
    for (const Tensor& tensor : tensors) {
      const std::size_t bytes = tensor.used_bytes().size();
      if (bytes == 0) continue;
      parts_.push_back({.tensor = tensor,
                        .bytes = bytes,
                        .device = cl::Buffer(session.context, CL_MEM_READ_WRITE, bytes),
                        .pinned = std::make_unique<opencl::PinnedMemory>(session.queue, bytes),
                        .host = std::vector<std::byte>(bytes)});
    }
  }
  void up() {
    for (Part& part : parts_) {
      std::memcpy(part.pinned->bytes().data(), part.tensor.data(), part.bytes);
      session_.queue.enqueueWriteBuffer(part.device, CL_FALSE, 0, part.bytes,
                                        part.pinned->bytes().data());
    }
    session_.queue.finish();
  }
  void down() {
    for (Part& part : parts_) {
      session_.queue.enqueueReadBuffer(part.device, CL_FALSE, 0, part.bytes,
                                       part.pinned->bytes().data());
    }
    session_.queue.finish();
    for (Part& part : parts_) {
      std::memcpy(part.host.data(), part.pinned->bytes().data(), part.bytes);
    }
  }

 private:
  struct Part {
    const Tensor& tensor;
    std::size_t bytes;
    cl::Buffer device;
    std::unique_ptr<opencl::PinnedMemory> pinned;
    std::vector<std::byte> host;
  };
  const opencl::DeviceSession& session_;
  std::vector<Part> parts_;
};

std::map<std::string, double> peers_of(const std::string& path) {
  std::map<std::string, double> peers;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name, more;
    double us = 0;
    if (words >> name >> us && !(words >> more)) peers[name] = us;
  }
  return peers;
}

std::vector<std::string> row_of(const opencl::DeviceSession& session, const Workload& workload,
                                const Options& options,
                                const std::map<std::string, double>& peers) {
  const auto images = generated_images(1);
  const Data data = workload.make_data({.seed = 1, .images = images.get()});
  std::vector<Tensor> outputs = make_tensors(workload.outputs, session.pinned.get());
  const auto kernel = opencl::make_kernel(session, workload, data.parameters);
  kernel->bind(data.inputs, outputs);
  std::vector<Tensor> state, next;
  if (workload.state) {
    state = workload.make_state();
    next = make_tensors(workload.state->tensors);
    kernel->bind_state(state, next);
    kernel->upload_state();
  }
  kernel->upload();
  kernel->execute(1);
  kernel->download();
  const double waited = us_of(options.rounds, [&] { kernel->execute(1); });
  const int many = std::clamp(static_cast<int>(kLongestRowUs / waited), 1, kInARow);
  const double in_a_row = us_of(3, [&] { kernel->execute(many); }) / many;
  double on_device = 0;
  if (auto* const launching = dynamic_cast<opencl::LaunchingKernel*>(kernel.get())) {
    std::vector<Nanos> spans;
    for (int i = 0; i < options.rounds; ++i) {
      if (const auto stamps = launching->stamped()) spans.push_back(stamps->span());
    }
    if (!spans.empty()) on_device = static_cast<double>(median(spans).count()) * 1e-3;
  }
  std::vector<Tensor> down = copy_tensors(outputs);
  for (Tensor& tensor : next) down.push_back(std::move(tensor));
  if (workload.state) {
    next = make_tensors(workload.state->tensors);
    kernel->bind_state(state, next);
  }
  PinnedCopies up_copies(session, data.inputs), down_copies(session, down);
  const double up = us_of(options.rounds, [&] { kernel->upload(); });
  const double least_up = us_of(options.rounds, [&] { up_copies.up(); });
  const double fetched = us_of(options.rounds, [&] { kernel->download(); });
  const double least_down = us_of(options.rounds, [&] { down_copies.down(); });
  const auto us = [](double value) { return fmt::format("{:.1f}", value); };
  const auto ratio = [](double a, double b) { return fmt::format("{:.2f}", a / b); };
  const auto peer = peers.find(workload.name);
  return {workload.name,
          us(waited),
          us(in_a_row),
          us(on_device),
          us(waited - on_device),
          us(up),
          ratio(up, least_up),
          us(fetched),
          ratio(fetched, least_down),
          peer == peers.end() ? "-" : us(peer->second),
          peer == peers.end() ? "-" : ratio(peer->second, in_a_row)};
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("What a call costs on an OpenCL device, part by part.");
  app.add_option("--device", options.device);
  app.add_option("--filter", options.filter);
  app.add_option("--peers", options.peers);
  app.add_option("--rounds", options.rounds);
  CLI11_PARSE(app, argc, argv);
  try {
    const opencl::DeviceSession session = opencl::open_session(
        {.unit = "device", .cores = {}, .device = options.device, .script = {}});
    const NameFilter filter(options.filter);
    const auto peers = peers_of(options.peers);
    Table table{.title = opencl::describe(session.device).name,
                .columns = {{"workload", Align::kLeft},
                            {"waited us"},
                            {"in a row us"},
                            {"device us"},
                            {"beside us"},
                            {"up us"},
                            {"of pinned"},
                            {"down us"},
                            {"of pinned"},
                            {"peer us"},
                            {"its / ours"}}};
    std::vector<std::string> names = workload_names();
    for (const char* batch : {"alexnet@batch16", "alexnet@batch64"}) names.emplace_back(batch);
    for (const std::string& name : names) {
      const Workload& workload = find_workload(name);
      if (!filter.picks(name) || !opencl::support_of(workload, session.device).ok) continue;
      table.rows.push_back(row_of(session, workload, options, peers));
    }
    if (table.rows.empty()) throw_bad_input("no workload of this device matches " + options.filter);
    Document document;
    document.parts.emplace_back(std::move(table));
    fmt::print("{}", render(document, Format::kText));
  } catch (const std::exception& error) {
    fmt::print(stderr, "device: {}\n", error.what());
    return 4;
  }
  return 0;
}
