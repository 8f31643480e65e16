// The derivation of weights, worked by hand.
#include "scheduler/policies/weights.h"

#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Weights of one workload on units with the given stages (after `units:` and `workloads:
/// convolution:`).
std::vector<int> weights_of(WeightRule rule, const std::string& units, const std::string& stages) {
  const auto platform = platform_of("platform: p\nunits: {" + units +
                                    "}\nworkloads:\n  convolution: {" + stages + "}\n");
  return derive_weights(rule, platform,
                        resolve_services(platform, nullptr, {"convolution"}, {}))[0];
}

TEST(ShareWeights, Give5And1And2OnTheFakePlatform) {
  // convolution on fake: gpu 0.2+0.1+1+0.2 = 1.5 ms, dsp 12 ms, cpu 3 ms: 1/s as 8 : 1 : 4, shares
  // .6154, .0769, .3077. Sums of squared errors of the best candidates: 5+1+3 of 9: .0598^2 +
  // .0342^2 + .0256^2 = .00540; 5+1+2 of 8: .0096^2 + .0481^2 + .0577^2 = .00573; 4+1+2 of 7:
  // .0440^2 + .0659^2 + .0220^2 = .00676; 6+1+2 of 9: .0513^2 + .0342^2 + .0855^2 = .01110. So 5,
  // 1, 3, and the CPU's else is one of its three.
  const auto platform = load_platform("fake");
  const auto services = resolve_services(platform, nullptr, {"convolution"}, {});
  EXPECT_THAT(derive_weights(WeightRule::kShare, platform, services)[0],
              ElementsAre(2, 5, 1, 0));  // cpu gpu dsp cloud
}

TEST(ShareWeights, CountTheElseForTheOnlyUnit) {
  // Share 1: a cycle of one task, which is the else.
  EXPECT_THAT(weights_of(WeightRule::kShare, "cpu: {}", "cpu: [{on: cpu, ms: 5}]"), ElementsAre(0));
}

TEST(ShareWeights, LeaveOutOnlyWhatIsBelowATwentieth) {
  // Shares 30/31 and 1/31 = .032 < 1/20: the GPU may get 0, but here it is the CPU that is slow,
  // and the else keeps it at 1: gpu 8, cpu 1 of 9 (error .078 each) is the closest.
  EXPECT_THAT(weights_of(WeightRule::kShare, "gpu: {}, cpu: {}",
                         "gpu: [{on: gpu, ms: 1}], cpu: [{on: cpu, ms: 30}]"),
              ElementsAre(8, 0));
  // The DSP at 1/31.. of three: gpu .4918, cpu .4918, dsp .0164: gpu 1, cpu 1, dsp 0 of 2 is closer
  // than any with a DSP.
  EXPECT_THAT(
      weights_of(WeightRule::kShare, "gpu: {}, dsp: {}, cpu: {}",
                 "gpu: [{on: gpu, ms: 1}], dsp: [{on: dsp, ms: 30}], cpu: [{on: cpu, ms: 1}]"),
      ElementsAre(1, 0, 0));
  // At .0526 (1/s as 9 : 1 : 9) it is above: 4 + 1 + 4 of 9.
  EXPECT_THAT(
      weights_of(WeightRule::kShare, "gpu: {}, dsp: {}, cpu: {}",
                 "gpu: [{on: gpu, ms: 1}], dsp: [{on: dsp, ms: 9}], cpu: [{on: cpu, ms: 1}]"),
      ElementsAre(4, 1, 3));
}

TEST(QueueWeights, AreWhatKeepsTheUnitBusy) {
  // Table V's platform: gpu s 7.105, b 2.605: ceil(2.73) = 3. cpu 4 servers, s = b: 4. dsp 1, and
  // one more for its one slot. Rates: cpu 4/6.84 = .585, gpu .384, dsp .0537 = .092 of the fastest:
  // nothing in Algorithm 2.
  const auto platform = load_platform("snapdragon820");
  const auto services = resolve_services(platform, nullptr, {"convolution"}, {});
  EXPECT_THAT(derive_weights(WeightRule::kQueue, platform, services)[0], ElementsAre(4, 3, 2));
  EXPECT_THAT(derive_weights(WeightRule::kFastQueue, platform, services)[0], ElementsAre(4, 3, 0));
  EXPECT_EQ(in_flight_for({.workload = 0, .eligible = kAll}, platform, services), 9);
}

TEST(QueueWeights, DoNotRoundUpWhatIsWhole) {
  // servers * s / b = 3 * 4 / 3 = 4 exactly.
  EXPECT_THAT(
      weights_of(WeightRule::kQueue, "gpu: {servers: 3}", "gpu: [{on: gpu, ms: 3}, {delay_ms: 1}]"),
      ElementsAre(4));
}

TEST(QueueWeights, DefineUnitsWithoutTime) {
  EXPECT_THAT(weights_of(WeightRule::kQueue, "gpu: {}, cpu: {}",
                         "gpu: [{on: gpu, ms: 0}], cpu: [{on: cpu, ms: 1}]"),
              ElementsAre(1, 1));
}

TEST(DerivedWeights, LeaveTheCloudAndUnitsWithoutServiceAtZero) {
  EXPECT_THAT(weights_of(WeightRule::kQueue, "gpu: {}, cloud: {}, dsp: {}",
                         "gpu: [{on: gpu, ms: 1}], cloud: [{delay_ms: 1}]"),
              ElementsAre(1, 0, 0));
}

class GivenWeights : public testing::Test {
 protected:
  WeightTable given(const std::map<std::string, int>& weights) {
    return given_weights(weights, platform_, services_, "--weights");
  }
  std::string refused(const std::map<std::string, int>& weights) {
    return bad_input([&] { static_cast<void>(given(weights)); });
  }
  Platform platform_ = load_platform("fake");
  ServiceTable services_ = resolve_services(platform_, nullptr, {"convolution", "alexnet"}, {});
};

TEST_F(GivenWeights, HoldForEveryWorkloadAndAreZeroWhereNotNamed) {
  EXPECT_THAT(given({{"gpu", 4}, {"cpu", 3}}),
              ElementsAre(ElementsAre(3, 4, 0, 0), ElementsAre(3, 4, 0, 0)));
}

TEST_F(GivenWeights, RefuseWhatMakesNoSense) {
  EXPECT_THAT(refused({{"gpu", -1}, {"cpu", 3}}), HasSubstr("the weight of gpu is -1"));
  EXPECT_THAT(refused({{"gpu", 0}}), HasSubstr("all weights are 0"));
  EXPECT_THAT(refused({{"gpuu", 1}}),
              testing::AllOf(HasSubstr("'gpuu'"), HasSubstr("did you mean gpu")));
  EXPECT_THAT(refused({{"cloud", 1}}), HasSubstr("cloud"));
}

}  // namespace
}  // namespace pirt::test
