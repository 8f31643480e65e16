// Building OpenCL programs, and the translation of the library's errors.
#include <gmock/gmock.h>

#include "tests/workloads/backends/opencl/opencl_support.h"
#include "workloads/backends/opencl/opencl_device.h"
#include "workloads/base/error.h"

namespace pirt::opencl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(OpenClProgram, ThatDoesNotBuildIsAnErrorWithTheFirstLinesOfTheLog) {
  if (!make_opencl_backend()->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
  const DeviceSession session = open_session(test::unit_request());
  try {
    static_cast<void>(build_program(
        session, "broken.cl", "__kernel void k(__global int* p) { p[0] = undeclared_name; }"));
    FAIL() << "it built";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), AllOf(HasSubstr("broken.cl"), HasSubstr("undeclared_name"),
                                    HasSubstr("CL_BUILD_PROGRAM_FAILURE"), Not(HasSubstr("\n"))));
  }
}

TEST(OpenClProgram, HasTheEmbeddedFilesThatItIncludes) {
  if (!make_opencl_backend()->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
  const DeviceSession session = open_session(test::unit_request());
  EXPECT_NO_THROW(static_cast<void>(build_program(
      session, "including.cl",
      "#include \"border.cl\"\n__kernel void k(__global int* p) { p[0] = reflect(-1, 4); }")));
  EXPECT_THROW(static_cast<void>(build_program(session, "including.cl", "#include \"none.cl\"\n")),
               std::logic_error);
}

TEST(OpenClErrors, KeepTheirNamesAndGainARemedy) {
  EXPECT_EQ(error_name(CL_INVALID_KERNEL_ARGS), "CL_INVALID_KERNEL_ARGS");
  EXPECT_EQ(error_name(-9999), "error -9999");
  EXPECT_THAT(describe(cl::Error(CL_MEM_OBJECT_ALLOCATION_FAILURE, "clCreateBuffer")),
              AllOf(HasSubstr("clCreateBuffer: CL_MEM_OBJECT_ALLOCATION_FAILURE"),
                    HasSubstr("free device memory")));
  for (const cl_int code : {CL_OUT_OF_RESOURCES, -9999}) {
    const std::string text = describe(cl::Error(code, "clFinish"));
    EXPECT_THAT(text, HasSubstr("beyond its buffers"));
    EXPECT_EQ(text.find("; "), text.rfind("; ")) << "with a lost device the remedy is cut off";
  }
}

TEST(OpenClErrors, BecomeEnvironmentErrorsWithWhatWasDone) {
  try {
    translated("doing this", [] { throw cl::Error(CL_INVALID_VALUE, "clSomething"); });
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_STREQ(error.what(), "opencl: doing this: clSomething: CL_INVALID_VALUE");
  }
}

TEST(OpenClErrors, LeaveOtherErrorsAlone) {
  EXPECT_THROW(translated("doing this", [] { throw_bad_input("mine"); }), Error);
  EXPECT_EQ(translated("doing this", [] { return 7; }), 7);
}

}  // namespace
}  // namespace pirt::opencl
