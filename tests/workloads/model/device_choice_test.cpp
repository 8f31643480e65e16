// What `device:` of a platform file means on machines with several devices, and with several
// drivers.
#include "workloads/model/device_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/base/error.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

DeviceInfo card(const std::string& name, const std::string& platform, const std::string& pci) {
  DeviceInfo info{.name = name, .platform = platform, .version = "1"};
  info.pci = pci;
  info.own_memory = true;
  return info;
}
DeviceInfo host_cores(const std::string& name, const std::string& platform) {
  return {.name = name, .platform = platform, .version = "1", .is_cpu = true};
}

/// Two cards of one name, a GPU within the processor, and the host's cores.
const std::vector<DeviceInfo> kTwoCards = {
    {.name = "UHD 630", .platform = "Intel OpenCL", .version = "1"},
    card("NVIDIA H100", "NVIDIA CUDA", "0000:01:00.0"),
    card("NVIDIA H100", "NVIDIA CUDA", "0000:41:00.0"),
    host_cores("cpu-EPYC", "Portable Computing Language")};
/// One card and the host's cores, each by two drivers.
const std::vector<DeviceInfo> kTwoDrivers = {
    card("NVIDIA T4", "NVIDIA CUDA", "0000:01:00.0"), card("NV164", "rusticl", "0000:01:00.0"),
    host_cores("cpu-EPYC", "Portable Computing Language"), host_cores("llvmpipe", "rusticl")};

std::size_t index_of(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  return choose_device(devices, wanted).index;
}
std::string remark_of(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  return choose_device(devices, wanted).remark;
}
std::string refusal_of(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  try {
    static_cast<void>(choose_device(devices, wanted));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(DeviceChoice, IsTheFirstWhereNobodyNamesOne) {
  EXPECT_EQ(index_of(kTwoCards, ""), 0U);
  EXPECT_EQ(remark_of(kTwoCards, ""), "");
}

TEST(DeviceChoice, GoesByPartOfANameOrPlatformInAnyCase) {
  EXPECT_EQ(index_of(kTwoCards, "epyc"), 3U);
  EXPECT_EQ(index_of(kTwoCards, "INTEL"), 0U);
  EXPECT_EQ(index_of(kTwoCards, "630"), 0U) << "three digits are no number of a device";
  EXPECT_EQ(remark_of(kTwoDrivers, "T4"), "") << "it was named";
}

TEST(DeviceChoice, OfTwoThatMatchAsksForANumberOrAPlace) {
  EXPECT_EQ(refusal_of(kTwoCards, "nvidia"),
            "2 devices match \"nvidia\": 1: \"NVIDIA H100\" (NVIDIA CUDA, 0000:01:00.0), 2: "
            "\"NVIDIA H100\" (NVIDIA CUDA, 0000:41:00.0); choose one by its number (device: 1) or "
            "its PCI id");
  EXPECT_THAT(refusal_of(kTwoDrivers, "NV"),
              AllOf(HasSubstr("0: "), HasSubstr("1: "), Not(HasSubstr("llvmpipe"))));
}

TEST(DeviceChoice, GoesByNumber) {
  for (const char* number : {"0", "1", "2", "3"}) {
    EXPECT_EQ(index_of(kTwoCards, number), std::stoul(number));
    EXPECT_EQ(remark_of(kTwoDrivers, number), "");
  }
  EXPECT_THAT(refusal_of(kTwoCards, "4"),
              AllOf(HasSubstr("no device has number 4"), HasSubstr("3: \"cpu-EPYC\"")));
}

TEST(DeviceChoice, GoesByPlaceOnTheBus) {
  for (const char* pci : {"0000:41:00.0", "41:00.0", "00000000:41:00.0"}) {
    EXPECT_EQ(index_of(kTwoCards, pci), 2U) << pci;
  }
  EXPECT_THAT(refusal_of(kTwoCards, "1:00.0"), HasSubstr("no device matches"));
  auto domains = kTwoCards;
  domains[2].pci = "0001:01:00.0";
  EXPECT_THAT(refusal_of(domains, "01:00.0"), HasSubstr("2 devices match"));
  EXPECT_EQ(index_of(domains, "0001:01:00.0"), 2U);
}

TEST(DeviceChoice, SaysByWhichOtherDriverADeviceIsThereThatNobodyNamed) {
  EXPECT_EQ(index_of(kTwoDrivers, ""), 0U);
  for (const char* wanted : {"", "own_memory", "01:00.0"}) {
    EXPECT_THAT(remark_of(kTwoDrivers, wanted),
                AllOf(HasSubstr("\"NVIDIA T4\" of NVIDIA CUDA"), HasSubstr("1: \"NV164\" (rusticl"),
                      HasSubstr("device: 1")));
  }
  const std::vector<DeviceInfo> cores = {kTwoDrivers[2], kTwoDrivers[3]};
  EXPECT_THAT(remark_of(cores, ""), HasSubstr("llvmpipe"));
  auto placeless = kTwoDrivers;
  placeless[1].pci = "";
  EXPECT_EQ(remark_of(placeless, ""), "") << "another name: it may be another card";
  placeless[1].name = placeless[0].name;
  EXPECT_THAT(remark_of(placeless, ""), HasSubstr("device: 1"));
}

TEST(DeviceChoice, OfOwnMemoryIsNeitherTheHostsCoresNorAGpuInItsProcessor) {
  EXPECT_EQ(index_of(kTwoCards, "own_memory"), 1U);
  EXPECT_THAT(refusal_of({kTwoCards[0], kTwoCards[3]}, "own_memory"),
              AllOf(HasSubstr("no device has memory of its own"), HasSubstr("0: \"UHD 630\"")));
}

TEST(DeviceChoice, SaysWhatAnotherDeviceHas) {
  DeviceInfo now = kTwoCards[1];
  now.remark = "out of reach";
  EXPECT_EQ(other_device(kTwoCards[1], now), "");
  now.version = "2";
  now.pci = "";
  EXPECT_EQ(other_device(kTwoCards[1], now),
            "version '2' in place of '1', PCI id '' in place of '0000:01:00.0'");
  now = kTwoCards[1];
  now.tuning = "fc_rows=2";
  EXPECT_EQ(other_device(kTwoCards[1], now), "tuning 'fc_rows=2' in place of ''");
  EXPECT_EQ(other_device(kTwoDrivers[0], kTwoDrivers[1]),
            "device 'NV164' in place of 'NVIDIA T4', driver 'rusticl' in place of 'NVIDIA CUDA'");
}

}  // namespace
}  // namespace pirt
