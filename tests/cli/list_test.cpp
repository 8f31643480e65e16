// pirt list: what it says of platforms whose devices are not here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;

nlohmann::json platform_named(const nlohmann::json& listing, const std::string& name) {
  for (const auto& row : listing["platforms"]) {
    if (row["name"] == name) return row;
  }
  return {};
}

// cli/demo.sh goes by that line.
TEST(List, SaysWhetherHostGpuHasItsDevice) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto outcome = pirt({"list", "platforms", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto gpu = platform_named(outcome.json(), "host-gpu");
  const auto text = pirt({"list", "platforms"}).out;
  EXPECT_EQ(platform_named(outcome.json(), "host")["available"], true);
  EXPECT_THAT(text, ContainsRegex("\nhost +yes "));
  if (gpu["available"] == true) {
    EXPECT_THAT(text, ContainsRegex("\nhost-gpu +yes "));
  } else {
    EXPECT_THAT(text, ContainsRegex("\nhost-gpu +no "));
    EXPECT_THAT(text, HasSubstr("host-gpu, gpu: unavailable: "));
    EXPECT_THAT(gpu["reason"].dump(), HasSubstr("unavailable: "));
  }
}

TEST(List, SaysWhyHostGpuIsNotAvailableWithoutADriver) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto outcome = pirt({"list", "platforms", "--json", "-"},
                            "OCL_ICD_VENDORS=/nonexistent OPENCL_VENDOR_PATH=/nonexistent");
  EXPECT_THAT(platform_named(outcome.json(), "host-gpu")["reason"].dump(), HasSubstr("install"));
}

TEST(List, APlatformWithoutAnyOfItsUnitsIsNotAvailable) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto listing = pirt({"list", "platforms", "--json", "-"},
                            "OCL_ICD_VENDORS=/nonexistent OPENCL_VENDOR_PATH=/nonexistent")
                           .json();
  const auto opencl = platform_named(listing, "host-opencl");
  EXPECT_EQ(opencl["available"], false);
  EXPECT_THAT(opencl["reason"].dump(), HasSubstr("opencl: unavailable: "));
  EXPECT_EQ(platform_named(listing, "host")["available"], true);        // It has a cpu beside.
  EXPECT_EQ(platform_named(listing, "jetson-tx1")["available"], true);  // All is in the file.
}

TEST(List, SaysWhichDeviceAUnitMeansAsItIsOpened) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const Scratch scratch;
  const auto device_of = [&](const std::string& device) {
    const auto file = scratch.write(
        "p.yaml", "platform: p\nunits: {gpu: {backend: opencl, device: \"" + device + "\"}}\n");
    return pirt({"list", "units", "--platform", file, "--json", "-"}).json()["units"][0];
  };
  if (device_of("")["available"] == false) GTEST_SKIP() << "skipped: no OpenCL device";
  EXPECT_EQ(device_of("0")["device"], device_of("")["device"]);
  EXPECT_EQ(device_of("99")["available"], false);
  EXPECT_THAT(device_of("99")["device"].dump(),
              HasSubstr("no device has number 99; there are: 0:"));
}

}  // namespace
}  // namespace pirt::test
