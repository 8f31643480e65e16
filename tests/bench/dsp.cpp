// What the DSP's kernels take, in packets of one hardware thread: against their scalar twins,
// against what the compiler makes of these by itself, and against the bound of their busiest
// resource. Counts: there is no noise, and one run is all.
//
// Usage: dsp [--filter REGEX]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <optional>

#include "reports/document.h"
#include "reports/figures.h"
#include "workloads/base/error.h"
#include "workloads/base/name_filter.h"
#include "workloads/catalog.h"
#include "workloads/dsp/cost_model.h"
#include "workloads/dsp/kernels.h"
#include "workloads/dsp/tools.h"
#include "workloads/dsp/undistort_plan.h"
#include "workloads/vision/vision.h"

namespace {

using namespace pirt;  // NOLINT: a program

/// In place of the tiles of the vector kernel.
void add_map(dsp::Session& session, const Workload& workload, dsp::Call& call) {
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
dsp::Cost cost_of(const std::string& program, const Workload& workload, const Data& data,
                  const std::vector<Tensor>& expected) {
  const auto tools = dsp::find_tools();
  dsp::Session session({.emulator = tools.emulator,
                        .plugin = tools.plugin,
                        .program = tools.program.parent_path() / program,
                        .models_memory = true,
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

void print_workload(const Workload& workload) {
  const auto images = generated_images(1);
  const Data data = workload.make_data({1, images.get()});
  const auto expected = workload.reference(data);
  const auto pixels = static_cast<double>(workload.inputs[0].count());
  const auto cost = [&](const std::string& program) {
    return cost_of(program, workload, data, expected);
  };
  const auto per_pixel = [&](const dsp::Cost& c) {
    return static_cast<double>(c.packets) / pixels;
  };
  const dsp::CostModel model;
  const auto hvx = cost("pirt_dsp.elf");
  const auto scalar = cost("pirt_dsp_scalar.elf");
  const auto automatic = cost("pirt_dsp_automatic.elf");
  const auto goal = goal_of(workload.name);
  fmt::print(
      "{:<16} {:>8.4f} {:>6} {:>9.2f} {:>7.1f}x {:>9.2f} {:>7.1f}x {:>9.3f} {:>9.3f} {:>9.2f}\n",
      workload.name, per_pixel(hvx), goal ? fmt::format("{:.2f}", *goal) : "-", per_pixel(scalar),
      per_pixel(scalar) / per_pixel(hvx), per_pixel(automatic),
      per_pixel(automatic) / per_pixel(hvx), to_ms(model.without_stalls(hvx)),
      to_ms(model.with_memory(hvx)), to_ms(model.without_stalls(scalar)));
  std::fflush(stdout);
}

int run(const std::string& filter) {
  const auto tools = dsp::find_tools();
  if (!tools.missing.empty()) throw_environment("backend dsp is unavailable: " + tools.missing);
  fmt::print(
      "Packets a pixel (of the first input) of a whole call\n{:<16} {:>8} {:>6} {:>9} {:>8} {:>9} "
      "{:>8}\n",
      "workload", "HVX", "goal", "scalar", "", "automatic", "", "HVX ms", "+ memory", "scalar ms");
  const NameFilter names(filter);
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  for (const Workload* workload : workloads_in_variant("int8")) all.push_back(workload);
  for (const Workload* workload : all) {
    const auto* const entry = dsp::find_kernel(workload->kernel);
    if (entry == nullptr || !entry->fault(*workload).empty()) continue;
    if (names.picks(workload->name)) print_workload(*workload);
  }
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
