// How near pirt's kernels come to the machine's limits and to other libraries: one run, all
// contestants in turns, on all cores, execute phase, data resident.
//
// Usage: kernels [--rounds N] [--filter REGEX] [--device NAME] [--pirt PROGRAM]
//   NAME is part of the name of backend opencl's device, the first one without; OpenCV's own path
//   takes the device that OPENCV_OPENCL_DEVICE says.
//   PROGRAM (build/pirt) is started for set-up with empty and filled kernel caches; without it that
//   line is left out. Peers: OpenCV; CLBlast where it was installed at build time
//   (libclblast-dev).
#include "tests/bench/peers/kernels.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "characterize/platform/platform.h"
#include "characterize/platform/unit_request.h"
#include "characterize/statistics/rank_tests.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/job_runner.h"
#include "characterize/worker/measure.h"
#include "characterize/worker/scratch.h"
#include "reports/document/document.h"
#include "reports/document/figures.h"
#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"

namespace {

using namespace pirt;  // NOLINT: a program
using bench::Call;

constexpr std::array kVision = {"gaussian_blur", "convolution",    "sobel",
                                "undistort",     "feature_detect", "optical_flow"};

/// Data of a workload, shared by all who compute it.
const Data& data_of(const std::string& name) {
  static std::map<std::string, Data> all;
  if (!all.contains(name)) {
    const auto images = generated_images(1);
    all[name] = find_workload(name).make_data({1, images.get()});
  }
  return all[name];
}

/// A prepared kernel of one of our backends on all cores.
class Ours {
 public:
  Ours(Device& device, const std::string& name) : workload_(find_workload(name)) {
    kernel_ = device.prepare(workload_, data_of(name).parameters);
    outputs_ = make_tensors(workload_.outputs);
    kernel_->bind(data_of(name).inputs, outputs_);
    kernel_->upload();
    run();
    kernel_->download();
  }
  void run() { kernel_->execute(1); }
  /// From submit to start, by the device's stamps; 0 where it has none.
  [[nodiscard]] Nanos launch() { return kernel_->stamped_launch().value_or(Nanos(0)); }

 private:
  const Workload& workload_;
  std::vector<Tensor> outputs_;
  std::unique_ptr<Kernel> kernel_;
};

/// Two that are compared. Times are those of the same work; a limit's is work over rate.
struct Contest {
  std::string group, name;
  Call ours, peer;
  double peer_scale = 1;  ///< The peer's time counts this often.
  /// Of our last call, what is not its execution: against a limit, which has no launch.
  std::function<Nanos()> launch = {};
  std::vector<double> ours_s = {}, peer_s = {}, ratios = {};
};

struct Group {
  std::string name, what, against;
  std::optional<double> each, mean;  ///< Goals.
};

/// @param on_cores  Whether backend opencl computes on the host's.
std::vector<Group> groups(bool on_cores) {
  using Goal = std::optional<double>;
  return {
      {"umat", "opencl, vision", "OpenCV's OpenCL path (UMat), same device", on_cores ? 6 : 2.5,
       on_cores ? 20 : 10},
      {"plain-opencl", "opencl, vision",
       on_cores ? "OpenCV called plainly, same cores" : "OpenCV called plainly, the host's cores",
       on_cores ? Goal(0.97) : Goal(), on_cores ? Goal(1.5) : Goal()},
      {"clblast", "opencl, conv1-5", "CLBlast im2col + GEMM, same device", {}, 10},
      {"onednn", "opencl, conv2-5", "oneDNN f32, same cores", 0.84, {}},
      {"fma-opencl", "opencl, conv2-5", "best measured FMA rate of the cores", 0.8, {}},
      {"weights",
       "opencl, fc6-8",
       "reading the weights at measured bandwidth (launch subtracted)",
       0.7,
       {}},
      {"plain-cpu", "cpu, vision", "OpenCV called plainly, same cores", 0.97, 1.5},
      {"fma", "cpu, conv2-5", "best measured FMA rate of the cores", 0.75, {}}};
}

/// Median seconds a call: 3 calls to settle, then for 12 ms and at least 3.
/// @param launch  Subtracted from each; may be empty.
double sample(const Call& call, const std::function<Nanos()>& launch = {}) {
  static const MachineClock clock;
  for (int i = 0; i < 3; ++i) call();
  std::vector<Nanos> times;
  const Nanos end = clock.now() + std::chrono::milliseconds(12);
  while (times.size() < 3 || clock.now() < end) {
    const Nanos begin = clock.now();
    call();
    const Nanos wall = clock.now() - begin;
    times.push_back(wall - (launch ? launch() : Nanos(0)));
  }
  return static_cast<double>(median(times).count()) * 1e-9;
}

struct Devices {
  std::unique_ptr<Device> cpu, opencl;
};

std::unique_ptr<Device> open(const char* platform_name, const char* unit,
                             const std::string& device = "") {
  const auto platform = load_platform(platform_name);
  UnitRequest request = make_unit_request(platform, platform.unit(unit));
  if (!device.empty()) request.device = device;
  return find_backend(unit).open(request);
}

Call ours(Device& device, const std::string& name) {
  auto kernel = std::make_shared<Ours>(device, name);
  return [kernel] { kernel->run(); };
}

/// Reads as many bytes as the parameters of @p name have, each core its share, with the fastest
/// loop.
Call reading_weights(const std::string& name) {
  std::size_t bytes = 0;
  for (const Tensor& tensor : data_of(name).parameters) bytes += tensor.bytes().size();
  struct State {
    cpu::CoreTeam team{current_cores()};
    std::vector<std::vector<std::uint32_t>> shares;
    const cpu::ReadLoop* loop = nullptr;
    std::vector<std::uint32_t> sums;
  };
  auto state = std::make_shared<State>();
  const auto cores = static_cast<std::size_t>(state->team.size());
  const std::size_t share = bytes / cores / cpu::ReadLoop::kGrain * cpu::ReadLoop::kGrain;
  state->sums.resize(cores);
  for (std::size_t i = 0; i < cores; ++i) {
    state->shares.emplace_back(share / sizeof(std::uint32_t) + 16, 1U);
  }
  const auto run = [state, share] {
    state->team.run([&](int index) {
      const auto i = static_cast<std::size_t>(index);
      auto address = reinterpret_cast<std::uintptr_t>(state->shares[i].data());
      address = (address + 63) / 64 * 64;
      state->sums[i] = state->loop->sum(reinterpret_cast<const std::uint32_t*>(address), share);
    });
  };
  double best = 0;
  const cpu::ReadLoop* fastest = nullptr;
  for (const cpu::ReadLoop& loop : cpu::read_loops()) {
    if (!loop.available()) continue;
    state->loop = &loop;
    const double time = sample(run);
    if (fastest != nullptr && time >= best) continue;
    best = time;
    fastest = &loop;
  }
  state->loop = fastest;
  return run;
}

/// The fastest multiply-add loop of the CPU, and its operations.
std::pair<Call, double> fastest_fma(Device& device) {
  auto loops = std::make_shared<PeakLoops>(device.peak_loops());
  PeakLoop* fastest = nullptr;
  double best = 0;
  for (const auto& loop : loops->loops) {
    if (loop->kind() != PeakKind::kF32) continue;
    const double rate = loop->work() / sample([&] { loop->run(1); });
    if (rate <= best) continue;
    best = rate;
    fastest = loop.get();
  }
  // Long enough that waking the cores costs nothing.
  const int repeats = std::max(1, static_cast<int>(best * 2e-3 / fastest->work()));
  return {[loops, fastest, repeats] { fastest->run(repeats); }, fastest->work() * repeats};
}

std::vector<Contest> make_contests(Devices& devices, const NameFilter& filter) {
  std::vector<Contest> all;
  const auto wanted = [&](const std::string& group, const std::string& name) {
    return filter.picks(group + "/" + name);
  };
  for (const char* name : kVision) {
    const Workload& workload = find_workload(name);
    if (wanted("umat", name)) {
      if (auto peer = bench::opencv_opencl(workload, data_of(name))) {
        all.push_back({"umat", name, ours(*devices.opencl, name), *peer});
      }
    }
    if (wanted("plain-opencl", name)) {
      all.push_back({"plain-opencl", name, ours(*devices.opencl, name),
                     bench::opencv_plain(workload, data_of(name))});
    }
    if (wanted("plain-cpu", name)) {
      all.push_back({"plain-cpu", name, ours(*devices.cpu, name),
                     bench::opencv_plain(workload, data_of(name))});
    }
  }
  std::optional<std::pair<Call, double>> fma;
  for (int i = 1; i <= 5; ++i) {
    const std::string name = fmt::format("conv{}", i);
    if (wanted("clblast", name)) {
      if (auto peer = bench::clblast_convolution(find_workload(name), data_of(name))) {
        all.push_back({"clblast", name, ours(*devices.opencl, name), *peer});
      }
    }
    if (i == 1) continue;
    if (wanted("onednn", name)) {
      all.push_back({"onednn", name, ours(*devices.opencl, name), ours(*devices.cpu, name)});
    }
    for (const auto& [group, device] :
         {std::pair("fma", devices.cpu.get()), {"fma-opencl", devices.opencl.get()}}) {
      if (!wanted(group, name)) continue;
      if (!fma) fma = fastest_fma(*devices.cpu);
      const Workload& layer = find_workload(name);
      const auto ops = static_cast<double>(layer.needed_ops().value());
      all.push_back({group, name, ours(*device, name), fma->first, ops / fma->second});
    }
  }
  for (const char* name : {"fc6", "fc7", "fc8"}) {
    if (!wanted("weights", name)) continue;
    const auto kernel = std::make_shared<Ours>(*devices.opencl, name);
    Contest contest{"weights", name, [kernel] { kernel->run(); }, reading_weights(name)};
    contest.launch = [kernel] { return kernel->launch(); };
    all.push_back(std::move(contest));
  }
  return all;
}

void run_rounds(std::vector<Contest>& contests, int rounds) {
  Random random(1);
  std::vector<std::size_t> order(contests.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
    for (const std::size_t at : order) {
      Contest& contest = contests[at];
      const bool first = random.below(2) == 0;
      double ours_s = first ? sample(contest.ours, contest.launch) : 0;
      const double peer_s = sample(contest.peer) * contest.peer_scale;
      if (!first) ours_s = sample(contest.ours, contest.launch);
      contest.ours_s.push_back(ours_s);
      contest.peer_s.push_back(peer_s);
      contest.ratios.push_back(peer_s / ours_s);
    }
  }
}

Table group_table(const Group& group, const std::vector<Contest>& contests) {
  Table table{.title = fmt::format("{} against {}", group.what, group.against),
              .columns = {{"workload", Align::kLeft},
                          {"ours ms"},
                          {"peer ms"},
                          {"ratio"},
                          {"95 % interval"},
                          {"goal", Align::kLeft}}};
  double log_sum = 0;
  int count = 0;
  for (const Contest& contest : contests) {
    if (contest.group != group.name) continue;
    const double ratio = median_of(contest.ratios);
    const auto low = median_lower_bound(contest.ratios, 0.975);
    const auto high = median_upper_bound(contest.ratios, 0.975);
    log_sum += std::log(ratio);
    ++count;
    const std::string goal =
        !group.each ? "-"
                    : fmt::format("{} {}", ratio >= *group.each ? "ok" : "BELOW", *group.each);
    table.rows.push_back({contest.name, figure(1e3 * median_of(contest.ours_s)),
                          figure(1e3 * median_of(contest.peer_s)), fmt::format("{:.2f}", ratio),
                          low && high ? fmt::format("{:.2f} to {:.2f}", *low, *high) : "-", goal});
  }
  if (count == 0) {
    table.footnotes.emplace_back("not compared: the peer is not there, or --filter leaves it out");
    return table;
  }
  const double mean = std::exp(log_sum / count);
  const std::string goal =
      !group.mean ? "-" : fmt::format("{} {}", mean >= *group.mean ? "ok" : "BELOW", *group.mean);
  table.rows.push_back({"geometric mean", "", "", fmt::format("{:.2f}", mean), "", goal});
  return table;
}

/// Sum of `prepare` over Table I on opencl, in fresh processes.
std::optional<double> prepare_sum(const JobRunner& runner, const std::filesystem::path& cache) {
  const auto platform = load_platform("host-opencl");
  Job job;
  job.kind = JobKind::kSetup;
  job.backend = "opencl";
  job.unit = make_unit_request(platform, platform.unit("opencl"));
  double sum = 0;
  for (const Workload& workload : catalog()) {
    if (!workload.has_tag("table1")) continue;
    job.workload = workload.name;
    const auto folder = cache / workload.name;
    std::filesystem::create_directories(folder);
    const auto result =
        runner.run(job, find_backend("opencl").kernel_cache_environment(folder.string()));
    if (!result || !result->prepare) return std::nullopt;
    sum += to_s(*result->prepare);
  }
  return sum;
}

void compare_prepare(const std::string& program) {
  const JobRunner runner(program, std::chrono::minutes(5), nullptr);
  std::vector<double> cold, warm;
  for (int round = 0; round < 3; ++round) {
    const ScratchFolder cache;
    const auto first = prepare_sum(runner, cache.path());
    const auto second = prepare_sum(runner, cache.path());
    if (!first || !second) throw_environment("set-up failed in a process of " + program);
    cold.push_back(*first);
    warm.push_back(*second);
  }
  const double ratio = median_of(warm) / median_of(cold);
  fmt::print(
      "prepare, sum over Table I on opencl: warm {:.2f} s, cold {:.2f} s, ratio {:.3f} "
      "(goal: at most 0.1, {})\n",
      median_of(warm), median_of(cold), ratio, ratio <= 0.1 ? "ok" : "ABOVE");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"pirt's kernels beside their peers"};
  int rounds = 21;
  std::string filter = ".", device, program;
  app.add_option("--rounds", rounds, "Rounds")->check(CLI::Range(6, 1000));
  app.add_option("--filter", filter, "Regular expression over GROUP/WORKLOAD");
  app.add_option("--device", device, "Part of the name of backend opencl's device");
  app.add_option("--pirt", program, "A pirt, for set-up in fresh processes");
  CLI11_PARSE(app, argc, argv);
  try {
    Devices devices{open("host-cpu", "cpu"), open("host-opencl", "opencl", device)};
    auto contests = make_contests(devices, NameFilter(filter));
    fmt::print("{} cores, opencl: {}, OpenCV's OpenCL: {}, {} rounds\n", current_cores().size(),
               devices.opencl->info().name, bench::opencv_opencl_device(), rounds);
    run_rounds(contests, rounds);
    Document document;
    for (const Group& group : groups(devices.opencl->info().is_cpu)) {
      document.parts.emplace_back(group_table(group, contests));
    }
    document.parts.emplace_back(
        Paragraph{{"ratio: the peer's time over ours, median of rounds; above 1 we are faster."}});
    fmt::print("{}", render(document, Format::kText));
    if (!program.empty()) compare_prepare(program);
    return 0;
  } catch (const Error& error) {
    fmt::print(stderr, "kernels: {}\n", error.what());
    return exit_code(error.code());
  }
}
