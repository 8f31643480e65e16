// What the DSP's kernels take, in packets of one hardware thread: against their scalar twins,
// against what the compiler makes of these by itself, and against the bound of their busiest
// resource. Counts: there is no noise, and one run is all.
//
// Usage: dsp [--filter REGEX]
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <filesystem>
#include <optional>

#include "tests/bench/dsp_resources.h"
#include "workloads/backends/dsp/cost_model.h"
#include "workloads/backends/dsp/kernels.h"
#include "workloads/backends/dsp/tools.h"
#include "workloads/backends/dsp/undistort_plan.h"
#include "workloads/base/error.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace {

using namespace pirt;  // NOLINT: a program
namespace fs = std::filesystem;

/// In place of the tiles of the vector kernel.
void add_map(dsp::ProgramSession& session, const Workload& workload, dsp::Call& call) {
  const auto& op = operation_as<vision::Undistort>(workload);
  const auto offset = call.inputs[0].buffer.offset - call.buffers[0].offset;
  const auto pitch = static_cast<std::int32_t>(call.inputs[0].pitch_bytes);
  std::vector<PirtDspMapEntry> map;
  for (const auto& entry : vision::undistort_map(op)) {
    const std::int32_t x = std::clamp(entry.x >> 5, -2, op.width);
    const std::int32_t y = std::clamp(entry.y >> 5, -2, op.height);
    map.push_back({static_cast<std::int32_t>(offset) + y * pitch + x,
                   static_cast<std::int16_t>(entry.x & 31),
                   static_cast<std::int16_t>(entry.y & 31)});
  }
  const auto bytes = map.size() * sizeof(PirtDspMapEntry);
  call.buffers.push_back(session.allocate(bytes, "the twin's map"));
  std::memcpy(session.bytes(call.buffers.back()).data(), map.data(), bytes);
  call.values.push_back(op.width);
}

/// What one call of @p program costs, whose output is right.
dsp::Cost cost_of(const std::string& program, const std::string& profile, const Workload& workload,
                  const Data& data, const std::vector<Tensor>& expected) {
  const auto tools = dsp::find_tools();
  dsp::ProgramSession session({.emulator = tools.emulator,
                               .plugin = tools.plugin,
                               .program = tools.program.parent_path() / program,
                               .models_memory = true,
                               .profile = profile,
                               .limit = std::chrono::minutes(5)});
  auto call = dsp::find_kernel(workload.kernel)->make(session, workload, data.parameters);
  if (workload.kernel == "undistort") add_map(session, workload, call);
  for (std::size_t i = 0; i < data.inputs.size(); ++i) {
    dsp::copy_in(session, call.inputs[i], data.inputs[i].bytes());
  }
  const auto cost = dsp::run(session, call);
  auto outputs = make_tensors(workload.outputs);
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    dsp::copy_out(session, call.outputs[i], {outputs[i].data(), outputs[i].bytes().size()});
  }
  const Verdict verdict = workload.verify(outputs, expected);
  if (!verdict.ok) {
    throw_environment(fmt::format("{} of {} is wrong: {}", workload.name, program, verdict.detail));
  }
  return cost;
}

/// Goals of the project: packets a pixel at most.
std::optional<double> goal_of(const std::string& workload) {
  if (workload == "gaussian_blur") return 0.10;
  if (workload == "sobel") return 0.12;
  if (workload == "convolution") return 0.33;
  return std::nullopt;
}

/// "shift 0.0512": packets a pixel that its busiest resource takes.
std::string bound_of(const std::string& profile, double pixels) {
  const auto packets = bench::disassemble(dsp::find_tools().program.parent_path() / "pirt_dsp.elf");
  if (packets.empty()) return "no llvm-objdump-14";
  const auto [resource, needed] = bench::busiest(bench::usage_of_command(profile, packets));
  return fmt::format("{} {:.4f}", bench::kResourceNames[resource], needed / pixels);
}

void print_workload(const Workload& workload, const std::string& profile) {
  const auto images = generated_images(1);
  const Data data = workload.make_data({1, images.get()});
  const auto expected = workload.reference(data);
  const auto pixels = static_cast<double>(workload.inputs[0].count());
  const auto per_pixel = [&](const dsp::Cost& c) {
    return static_cast<double>(c.packets) / pixels;
  };
  const dsp::CostModel model;
  const auto hvx = cost_of("pirt_dsp.elf", profile, workload, data, expected);
  const auto scalar = cost_of("pirt_dsp_scalar.elf", "", workload, data, expected);
  const auto automatic = cost_of("pirt_dsp_automatic.elf", "", workload, data, expected);
  const auto goal = goal_of(workload.name);
  fmt::print(
      "{:<14} {:>8.4f} {:>5} {:>16} {:>8.2f} {:>6.1f}x {:>9.2f} {:>6.1f}x {:>8.3f} {:>8.3f} "
      "{:>9.2f}\n",
      workload.name, per_pixel(hvx), goal ? fmt::format("{:.2f}", *goal) : "-",
      bound_of(profile, pixels), per_pixel(scalar), per_pixel(scalar) / per_pixel(hvx),
      per_pixel(automatic), per_pixel(automatic) / per_pixel(hvx), to_ms(model.without_stalls(hvx)),
      to_ms(model.with_memory(hvx)), to_ms(model.without_stalls(scalar)));
  if (workload.name == "convolution") {
    // What the paper's figures of the DSP are: Table V's by the fit of platform snapdragon820.
    constexpr double kTable5Ms = 18.61;
    constexpr double kTable2OpsPerMs = 4e9 / 1e3;
    fmt::print(
        "{:<14} HVX {:.3f} ms (with the memory model {:.3f}), scalar {:.2f} ms, Table V {:.2f} ms, "
        "Table II's 4 GOPS/s {:.2f} ms: of Table V, scalar code would take {:.0f} %, HVX {:.1f} "
        "%\n",
        "", to_ms(model.without_stalls(hvx)), to_ms(model.with_memory(hvx)),
        to_ms(model.without_stalls(scalar)), kTable5Ms,
        static_cast<double>(workload.ops.value()) / kTable2OpsPerMs,
        100 * to_ms(model.without_stalls(scalar)) / kTable5Ms,
        100 * to_ms(model.without_stalls(hvx)) / kTable5Ms);
  }
  std::fflush(stdout);
}

int run(const std::string& filter) {
  const auto tools = dsp::find_tools();
  if (!tools.missing.empty()) throw_environment("backend dsp is unavailable: " + tools.missing);
  fmt::print(
      "Packets a pixel (an element of the first input) of a whole call, borders included; ms at "
      "500 "
      "MHz\n{:<14} {:>8} {:>5} {:>16} {:>8} {:>7} {:>9} {:>7} {:>8} {:>8} {:>9}\n",
      "workload", "HVX", "goal", "bound", "scalar", "", "automatic", "", "HVX ms", "+memory",
      "scalar ms");
  const std::string profile =
      fmt::format("{}/pirt-dsp-profile.{}", fs::temp_directory_path().string(), ::getpid());
  const NameFilter names(filter);
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  for (const Workload* workload : workloads_in_variant("int8")) all.push_back(workload);
  for (const Workload* workload : all) {
    const auto* const entry = dsp::find_kernel(workload->kernel);
    if (entry == nullptr || !entry->fault(*workload).empty()) continue;
    if (names.picks(workload->name)) print_workload(*workload, profile);
  }
  fs::remove(profile);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string filter;
  CLI::App app("Packets that the DSP's kernels take");
  app.add_option("--filter", filter, "names of workloads, a regular expression");
  CLI11_PARSE(app, argc, argv);
  try {
    return run(filter);
  } catch (const Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return exit_code(error.code());
  }
}
