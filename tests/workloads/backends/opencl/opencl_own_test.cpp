// Sources and functions of somebody else's on a device.
#include <gmock/gmock.h>

#include <numeric>

#include "tests/support/errors.h"
#include "tests/workloads/backends/opencl/opencl_support.h"
#include "workloads/backends/opencl/device/api.h"
#include "workloads/base/error.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/player.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kScale = R"(
__kernel void scale(__global const int* in, __global int* out, int factor, float share, uchar plus,
                    __global const int* table) {
  const size_t i = get_global_id(0);
  out[i] = in[i] * factor + convert_int(share * 4) + plus + table[0];
}
__kernel void add_up(__global const int* in, __global int* out, __global const int* sum,
                     __global int* next) {
  const size_t i = get_global_id(0);
  out[i] = next[i] = sum[i] + in[i];
}
)";

class OpenClOwn : public testing::Test {
 protected:
  void SetUp() override {
    device_ = test::open_first_device();
    if (!device_) GTEST_SKIP() << "skipped: no OpenCL device";
  }

  static Workload workload(std::shared_ptr<OwnOperation> operation) {
    operation->source = "/robot/own.yaml";
    operation->backends = {"opencl"};
    Workload made;
    made.name = "my.scale";
    made.kernel = kOwnKernel;
    made.operation = std::move(operation);
    made.inputs = {{"in", Element::kI32, {4}}};
    made.outputs = {{"out", Element::kI32, {4}}};
    made.parameters = {{"table", Element::kI32, {1}}};
    return made;
  }
  static OpenclSource scale() {
    return {.file = "/robot/scale.cl",
            .text = kScale,
            .kernel = "scale",
            .global = {4, 0, 0},
            .arguments = {{.tensor = "in"},
                          {.tensor = "out"},
                          {.element = Element::kI32, .value = 10},
                          {.element = Element::kF32, .value = 0.5},
                          {.element = Element::kU8, .value = 200},
                          {.tensor = "table"}}};
  }
  static Workload of(OpenclSource source) {
    auto operation = std::make_shared<OwnOperation>();
    operation->opencl = std::move(source);
    return workload(std::move(operation));
  }

  /// What it makes of 1, 2, 3, 4, with 5 as its table.
  std::vector<int> compute(const Workload& workload, int times = 1) {
    auto inputs = make_tensors(workload.inputs);
    auto outputs = make_tensors(workload.outputs);
    auto parameters = make_tensors(workload.parameters);
    const auto values = inputs[0].as<std::int32_t>();
    std::iota(values.begin(), values.end(), 1);
    if (!parameters.empty()) parameters[0].as<std::int32_t>()[0] = 5;
    const auto kernel = device_->prepare(workload, parameters);
    kernel->bind(inputs, outputs);
    std::vector<Tensor> current, next;
    if (workload.state) {
      current = make_tensors(workload.state->tensors);
      next = make_tensors(workload.state->tensors);
      kernel->bind_state(current, next);
      kernel->upload_state();
    }
    for (int i = 0; i < times; ++i) {
      kernel->upload();
      static_cast<void>(kernel->execute(1));
      kernel->download();
      kernel->commit_state();
      if (!workload.state) continue;
      std::swap(current, next);
      kernel->bind_state(current, next);
    }
    const auto made = outputs[0].as<std::int32_t>();
    return {made.begin(), made.end()};
  }
  std::string refusal(const Workload& workload) {
    try {
      static_cast<void>(compute(workload));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::unique_ptr<Device> device_;
};

TEST_F(OpenClOwn, ASourceGetsItsTensorsAndNumbers) {
  EXPECT_THAT(compute(of(scale())), ElementsAre(217, 227, 237, 247));
  OpenclSource in_groups = scale();
  in_groups.local = {2, 0, 0};
  EXPECT_THAT(compute(of(in_groups)), ElementsAre(217, 227, 237, 247));
}

TEST_F(OpenClOwn, AStateGoesFromCallToCall) {
  OpenclSource source = scale();
  source.kernel = "add_up";
  source.arguments = {
      {.tensor = "in"}, {.tensor = "out"}, {.tensor = "sum"}, {.tensor = "next sum"}};
  Workload summing = of(source);
  summing.parameters.clear();
  summing.state = StateSpec{.name = "sum", .tensors = {{"sum", Element::kI32, {4}}}};
  EXPECT_THAT(compute(summing, 3), ElementsAre(3, 6, 9, 12));
}

TEST_F(OpenClOwn, ASourceThatDoesNotFitIsNamed) {
  const auto refused = [&](const auto& spoil) {
    OpenclSource source = scale();
    spoil(source);
    return refusal(of(source));
  };
  EXPECT_THAT(refused([](OpenclSource& s) { s.kernel = "skale"; }),
              AllOf(HasSubstr("scale.cl"), HasSubstr("'skale' is not in it")));
  EXPECT_THAT(refused([](OpenclSource& s) { s.arguments.pop_back(); }),
              HasSubstr("takes 6 arguments, and 5 are given"));
  EXPECT_THAT(refused([](OpenclSource& s) { s.arguments[0].tensor = "inn"; }), HasSubstr("'inn'"));
  EXPECT_THAT(refused([](OpenclSource& s) { s.local = {3, 0, 0}; }), HasSubstr("no multiple"));
  EXPECT_THAT(
      refused([](OpenclSource& s) { s.arguments[3] = {.element = Element::kI32, .value = 1}; }),
      HasSubstr("takes float as argument 3 (counted from 0), and {i32: 1} is of i32"));
  // As large as what is given.
  EXPECT_THAT(refused([](OpenclSource& s) {
                s.text = "__kernel void scale(int2 in) {}";
                s.arguments = {OpenclArgument{.tensor = "in"}};
              }),
              HasSubstr("takes no the tensor 'in' as argument 0"));
  EXPECT_THAT(refused([](OpenclSource& s) {
                s.text = "__kernel void scale(__global double* in) {}";
                s.arguments = {OpenclArgument{.element = Element::kF64, .value = 3.5}};
              }),
              AnyOf(HasSubstr("takes no {f64: 3.5} as argument 0"), HasSubstr("does not build")));
  Workload other = of(scale());
  for (const Element element : {Element::kU8, Element::kF32}) {
    other.parameters = {{"table", element, {4}}};
    const auto table = make_tensors(other.parameters);
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(device_->prepare(other, table)); }),
                HasSubstr("and the tensor 'table' is of " + std::string(to_string(element))));
  }
  EXPECT_THAT(refused([](OpenclSource& s) { s.text += "!"; }),
              AllOf(HasSubstr("scale.cl"), HasSubstr("does not build")));
}

TEST_F(OpenClOwn, AFunctionEnqueuesAsItLikes) {
  auto operation = std::make_shared<OwnOperation>();
  operation->opencl_function = [](const OpenclUnit& unit) {
    EXPECT_EQ(unit.parameters.size(), 1U);
    return [unit] {
      auto* const queue = static_cast<cl_command_queue>(unit.queue);
      const cl_int status = clEnqueueCopyBuffer(queue, static_cast<cl_mem>(unit.inputs[0]),
                                                static_cast<cl_mem>(unit.outputs[0]), 0, 0,
                                                4 * sizeof(cl_int), 0, nullptr, nullptr);
      if (status != CL_SUCCESS) throw_environment("no copy");
    };
  };
  EXPECT_THAT(compute(workload(operation)), ElementsAre(1, 2, 3, 4));
  Workload copying = workload(operation);
  const auto inputs = make_tensors(copying.inputs);
  auto outputs = make_tensors(copying.outputs);
  const auto parameters = make_tensors(copying.parameters);
  const auto kernel = device_->prepare(copying, parameters);
  kernel->bind(inputs, outputs);
  kernel->upload();
  EXPECT_EQ(kernel->stamped_launch(), std::nullopt) << "nobody knows when its commands start";
  copying.variant = "map";
  const Support mapped = device_->supports(copying);
  EXPECT_FALSE(mapped.ok) << "its handles are those of the buffers of before";
  EXPECT_THAT(mapped.reason, HasSubstr("its functions keep the buffers"));
  operation = std::make_shared<OwnOperation>();
  operation->opencl_function = [](const OpenclUnit&) {
    return [] { throw_environment("no such luck"); };
  };
  EXPECT_THAT(refusal(workload(operation)), HasSubstr("no such luck"));
}

TEST_F(OpenClOwn, AFunctionGetsWholeBuffersThatItMayDivide) {
  auto operation = std::make_shared<OwnOperation>();
  int whole = 0;
  operation->opencl_function = [&whole](const OpenclUnit& unit) {
    for (const auto& tensors : {unit.inputs, unit.outputs}) {
      for (void* const tensor : tensors) {
        cl_mem parent = nullptr;
        const cl_int status =
            clGetMemObjectInfo(static_cast<cl_mem>(tensor), CL_MEM_ASSOCIATED_MEMOBJECT,
                               sizeof(parent), &parent, nullptr);
        if (status == CL_SUCCESS && parent == nullptr) ++whole;
      }
    }
    return [] {};
  };
  Workload several = workload(operation);
  several.inputs.push_back({"more", Element::kI32, {4}});
  several.outputs.push_back({"rest", Element::kI32, {4}});
  opencl::DeviceSession session = test::gpu_session(32);
  session.pinned = std::make_shared<opencl::PinnedPool>(session.queue);
  const auto parameters = make_tensors(several.parameters);
  static_cast<void>(opencl::make_kernel(session, several, parameters));
  EXPECT_EQ(whole, 4);
}

TEST_F(OpenClOwn, IsNotSupportedWithoutAKernelOfItsOwn) {
  auto operation = std::make_shared<OwnOperation>();
  Workload other = workload(operation);
  operation->backends = {"cpu"};
  const Support support = device_->supports(other);
  EXPECT_FALSE(support.ok);
  EXPECT_THAT(support.reason, AllOf(HasSubstr("own.yaml"), HasSubstr("cpu alone")));
}

}  // namespace
}  // namespace pirt
