// A module whose table is wrong in the one place that PIRT_TEST_SPOIL names, and right without it.
#include <pirt/module.h>

#include <cmath>
#include <cstdlib>
#include <deque>
#include <functional>
#include <map>
#include <string>

namespace {

int run(void*, const pirt_call*) { return 0; }

struct Table {
  pirt_tensor_spec input{PIRT_HEAD(pirt_tensor_spec), "in", PIRT_U8, 2, {-2, -1}, 0, 0, 0, 0};
  pirt_tensor_spec output{PIRT_HEAD(pirt_tensor_spec), "out", PIRT_U8, 2, {-2, -1}, 0, 0, 0, 0};
  pirt_cpu_kernel cpu{PIRT_HEAD(pirt_cpu_kernel), nullptr, run, nullptr};
  pirt_opencl_argument arguments[2]{{PIRT_HEAD(pirt_opencl_argument), "out", 0, 0},
                                    {PIRT_HEAD(pirt_opencl_argument), nullptr, PIRT_U8, 7}};
  pirt_opencl_kernel opencl{};
  pirt_workload workload{};
  const pirt_workload* workloads[2]{&workload, &workload};
  pirt_module module{PIRT_HEAD(pirt_module), workloads, 1};
  const pirt_module* returned = &module;

  Table() {
    opencl.size = sizeof opencl, opencl.version = PIRT_MODULE_VERSION;
    opencl.source = "__kernel void k(__global uchar* out, uchar v) { out[0] = v; }";
    opencl.kernel = "k";
    opencl.global[0] = PIRT_WIDTH;
    opencl.arguments = arguments, opencl.argument_count = 2;
    workload.size = sizeof workload, workload.version = PIRT_MODULE_VERSION;
    workload.name = "spoilt.not";
    workload.inputs = &input, workload.input_count = 1;
    workload.outputs = &output, workload.output_count = 1;
    workload.width = 64, workload.height = 48;
    workload.cpu = &cpu, workload.opencl = &opencl;
  }

  void spoil(const std::string& what) {
    const double kNan = std::nan("");
    const auto range = [this](double low, double high) {
      input.has_range = 1, input.low = low, input.high = high;
    };
    const std::map<std::string, std::function<void()>> all = {
        {"table null", [&] { returned = nullptr; }},
        {"module version", [&] { module.version = 2; }},
        {"module size", [&] { module.size = 4; }},
        {"workloads null", [&] { module.workloads = nullptr; }},
        {"workload null", [&] { workloads[0] = nullptr; }},
        {"workload count", [&] { module.workload_count = 0xFFFFFFFF; }},
        {"no workload", [&] { module.workload_count = 0; }},
        {"one name twice", [&] { module.workload_count = 2; }},
        {"workload version", [&] { workload.version = 0; }},
        {"workload size", [&] { workload.size = 16; }},
        {"workload huge", [&] { workload.size = 0xFFFFFFF8; }},
        {"name null", [&] { workload.name = nullptr; }},
        {"name empty", [&] { workload.name = ""; }},
        {"name blank", [&] { workload.name = "spoilt. x"; }},
        {"name control", [&] { workload.name = "spoilt.\x1b[2J"; }},
        {"name utf8", [&] { workload.name = "spoilt.\xff\xfe"; }},
        {"inputs null", [&] { workload.inputs = nullptr; }},
        {"input count", [&] { workload.input_count = 0xFFFFFFFF; }},
        {"tensor version", [&] { input.version = 7; }},
        {"tensor size", [&] { input.size = 8; }},
        {"tensor huge", [&] { input.size = 0xFFFFFFF8; }},
        {"tensor odd", [&] { input.size = sizeof input + 1; }},
        {"tensor name null", [&] { input.name = nullptr; }},
        {"tensor name blank", [&] { input.name = "next out"; }},
        {"tensor name twice", [&] { input.name = "out"; }},
        {"element", [&] { input.element = 77; }},
        {"element below", [&] { input.element = -1; }},
        {"dims none", [&] { input.dims = 0; }},
        {"dims many", [&] { input.dims = 7; }},
        {"dims below", [&] { input.dims = -1; }},
        {"extent none", [&] { input.shape[1] = 0; }},
        {"extent below", [&] { input.shape[1] = -3; }},
        {"extent least", [&] { input.shape[1] = INT64_MIN; }},
        {"extent large", [&] { input.shape[1] = INT64_C(1) << 40; }},
        {"size overflows",
         [&] {
           input.dims = 6;
           for (auto& extent : input.shape) extent = INT64_C(1) << 31;
         }},
        {"range nan", [&] { range(kNan, 1); }},
        {"range infinite", [&] { range(0, INFINITY); }},
        {"range turned", [&] { range(2, 1); }},
        {"range beyond", [&] { range(0, 256); }},
        {"no size", [&] { workload.width = workload.height = 0; }},
        {"half a size", [&] { workload.height = 0; }},
        {"size below", [&] { workload.width = -64; }},
        {"size large", [&] { workload.width = INT64_C(1) << 40; }},
        {"frames below", [&] { workload.frames = -1; }},
        {"frames many", [&] { workload.frames = 0x7FFFFFFF; }},
        {"sequence large",
         [&] { workload.frames = 10'000, workload.width = workload.height = 4096; }},
        {"slices below", [&] { workload.slices = -1; }},
        {"operations nan", [&] { workload.operations_per_element = kNan; }},
        {"operations below", [&] { workload.operations_per_element = -1; }},
        {"tolerance nan", [&] { workload.tolerance = kNan; }},
        {"tolerance large", [&] { workload.tolerance = 2; }},
        {"no output", [&] { workload.output_count = 0, opencl.argument_count = 0; }},
        {"no kernel", [&] { workload.cpu = nullptr, workload.opencl = nullptr; }},
        {"cpu version", [&] { cpu.version = 3; }},
        {"cpu without run", [&] { cpu.run = nullptr; }},
        {"opencl version", [&] { opencl.version = 3; }},
        {"opencl empty", [&] { opencl.source = nullptr; }},
        {"opencl without kernel", [&] { opencl.kernel = nullptr; }},
        {"global below", [&] { opencl.global[1] = -5; }},
        {"local below", [&] { opencl.local[0] = -1; }},
        {"arguments null", [&] { opencl.arguments = nullptr; }},
        {"argument count", [&] { opencl.argument_count = 0xFFFFFFFF; }},
        {"argument huge", [&] { arguments[0].size = 0xFFFFFFF8; }},
        {"argument unknown", [&] { arguments[0].tensor = "ouf"; }},
        {"argument element", [&] { arguments[1].element = 9; }},
        {"argument nan", [&] { arguments[1].value = kNan; }},
        {"argument beyond", [&] { arguments[1].value = 256; }},
        {"argument broken", [&] { arguments[1].value = 0.5; }},
    };
    if (what == "LIST") {
      for (const auto& each : all) names += each.first + "\n";
      workload.description = names.c_str();
    } else {
      all.at(what)();
    }
  }
  std::string names;
};

}  // namespace

const pirt_module* pirt_module_v1() {
  static std::deque<Table> tables;  // Stay to the end of the process.
  Table* const table = &tables.emplace_back();
  const char* const what = std::getenv("PIRT_TEST_SPOIL");
  if (what != nullptr) table->spoil(what);
  return table->returned;
}
