#include "characterize/energy/fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/characterize/support.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr auto kActive = EnergyParameter::kActive;
constexpr auto kOp = EnergyParameter::kOp;
constexpr auto kByte = EnergyParameter::kByte;
constexpr auto kCall = EnergyParameter::kCall;
const std::vector<EnergyParameter> kAll = {kActive, kOp, kByte, kCall};

/// The truth behind the made-up readings.
constexpr double kActiveW = 4, kOpPj = 12, kBytePj = 150, kCallJ = 0.002;

/// Cells as different as workloads are: sizes and speeds drawn apart, over two decades each.
std::vector<FitCell> cells(int count, double noise = 0, std::uint64_t seed = 7) {
  Random random(seed);
  const auto decades = [&random] {
    return std::pow(10, 2 * static_cast<double>(random.below(1'000'001)) / 1e6);
  };
  std::vector<FitCell> made;
  for (int i = 0; i < count; ++i) {
    FitCell cell;
    cell.workload = "w" + std::to_string(i);
    cell.seconds = 1e-4 * decades();
    cell.ops = static_cast<std::int64_t>(1e7 * decades());
    cell.bytes = static_cast<std::int64_t>(1e5 * decades());
    const double deviation = 2 * static_cast<double>(random.below(1'000'001)) / 1e6 - 1;
    cell.energy_j = (kActiveW * cell.seconds + kOpPj * 1e-12 * static_cast<double>(*cell.ops) +
                     kBytePj * 1e-12 * static_cast<double>(cell.bytes) + kCallJ) *
                    (1 + noise * deviation);
    made.push_back(cell);
  }
  return made;
}

std::vector<double> values(const EnergyFit& fit) {
  std::vector<double> result;
  for (const auto& each : fit.parameters) result.push_back(each.value);
  return result;
}

TEST(Fit, RecoversKnownParameters) {
  const auto fit = fit_energy(cells(20), kAll);
  ASSERT_EQ(fit.refusal, "");
  ASSERT_EQ(fit.parameters.size(), 4U);
  EXPECT_NEAR(fit.parameters[0].value, kActiveW, 1e-5 * kActiveW);
  EXPECT_NEAR(fit.parameters[1].value, kOpPj, 1e-5 * kOpPj);
  EXPECT_NEAR(fit.parameters[2].value, kBytePj, 1e-4 * kBytePj);
  EXPECT_NEAR(fit.parameters[3].value, kCallJ, 1e-5 * kCallJ);
  ASSERT_EQ(fit.residuals.size(), 20U);
  for (const auto& residual : fit.residuals) EXPECT_NEAR(residual.relative_error(), 0, 1e-6);
}

TEST(Fit, NoiseStaysWithinTheStandardErrors) {
  const auto fit = fit_energy(cells(60, 0.02), {kAll.data(), 2});  // wrong model: see below
  ASSERT_EQ(fit.refusal, "");
  const auto whole = fit_energy(cells(60, 0.02), kAll);
  ASSERT_EQ(whole.refusal, "");
  const std::vector<double> truth = {kActiveW, kOpPj, kBytePj, kCallJ};
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto& each = whole.parameters[i];
    ASSERT_TRUE(each.standard_error.has_value());
    EXPECT_GT(*each.standard_error, 0);
    EXPECT_NEAR(each.value, truth[i], 4 * *each.standard_error) << to_string(each.parameter);
  }
  // Without bytes and calls the model is wrong, and its errors say so.
  EXPECT_GT(*fit.parameters[0].standard_error, 5 * *whole.parameters[0].standard_error);
}

TEST(Fit, OneBadCellDoesNotPullTheRest) {
  auto made = cells(30);
  made[4].energy_j *= 2;
  const auto fit = fit_energy(made, kAll);
  ASSERT_EQ(fit.refusal, "");
  EXPECT_NEAR(fit.parameters[0].value, kActiveW, 0.05 * kActiveW);
  EXPECT_NEAR(fit.parameters[1].value, kOpPj, 0.05 * kOpPj);
  EXPECT_NEAR(fit.residuals[4].relative_error(), -0.5, 0.05);
}

TEST(Fit, RefusesParametersWhoseTermsKeepOneProportion) {
  auto made = cells(20);
  for (auto& cell : made) cell.ops = static_cast<std::int64_t>(cell.seconds * 1e11);  // one speed
  const auto fit = fit_energy(made, kAll);
  EXPECT_THAT(fit.parameters, IsEmpty());
  EXPECT_THAT(fit.collinear, ElementsAre(kActive, kOp));
  EXPECT_GT(fit.condition, 30);
  EXPECT_THAT(fit.refusal, HasSubstr("active_w, op_pj cannot be told apart by these 20 cells"));
  EXPECT_EQ(fit_energy(made, std::vector{kActive, kByte, kCall}).refusal, "");
}

TEST(Fit, RefusesAParameterWithoutEffect) {
  auto made = cells(20);
  for (auto& cell : made) cell.bytes = 0;
  EXPECT_THAT(fit_energy(made, kAll).refusal, HasSubstr("byte_pj has no effect"));
}

TEST(Fit, RefusesTooFewCells) {
  EXPECT_THAT(fit_energy(cells(5), kAll).refusal, HasSubstr("5 usable cells are too few"));
  EXPECT_EQ(fit_energy(cells(6), std::vector{kActive, kOp}).refusal, "");
  EXPECT_THAT(fit_energy({}, std::vector{kActive}).refusal, HasSubstr("too few"));
}

TEST(Fit, NothingBecomesNegative) {
  auto made = cells(30);
  for (auto& cell : made) {
    // Half of the time costs nothing: what a call "costs" beyond its time would be below 0.
    cell.energy_j = kActiveW * (cell.seconds - 0.5 * std::min(cell.seconds, 1e-3));
  }
  const auto fit = fit_energy(made, std::vector{kActive, kCall});
  ASSERT_EQ(fit.refusal, "");
  EXPECT_GT(fit.parameters[0].value, 0);
  EXPECT_EQ(fit.parameters[1].value, 0);
  EXPECT_EQ(fit.parameters[1].standard_error, std::nullopt);
}

TEST(Fit, CellsWithoutKnownOperationsServeTheOtherParametersOnly) {
  auto made = cells(20);
  made[3].ops.reset();
  const auto with_ops = fit_energy(made, kAll);
  EXPECT_THAT(with_ops.left_out, ElementsAre("w3"));
  EXPECT_EQ(with_ops.residuals.size(), 19U);
  EXPECT_EQ(fit_energy(made, std::vector{kActive}).residuals.size(), 20U);
}

TEST(Fit, LeavesOutWhatCannotBeToldApartAndSaysWhy) {
  auto made = cells(20);
  for (auto& cell : made) cell.ops = static_cast<std::int64_t>(cell.seconds * 1e11);
  std::vector<std::string> dropped;
  const auto fit = fit_energy_parameters(made, dropped);
  EXPECT_EQ(fit.refusal, "");
  ASSERT_EQ(fit.parameters.size(), 3U);
  EXPECT_EQ(fit.parameters[1].parameter, kByte);
  EXPECT_THAT(dropped, ElementsAre(HasSubstr("op_pj is not fitted: active_w, op_pj cannot")));
}

TEST(Fit, TakesOneParameterWhenThereIsLittle) {
  std::vector<std::string> dropped;
  EXPECT_THAT(values(fit_energy_parameters(cells(3), dropped)), testing::SizeIs(1));
  EXPECT_EQ(dropped.size(), 3U);
  dropped.clear();
  EXPECT_THAT(fit_energy_parameters(cells(1), dropped).refusal, HasSubstr("too few"));
}

TEST(Fit, ParameterNamesAreChecked) {
  EXPECT_THAT(parse_energy_parameters("byte_pj,active_w"), ElementsAre(kByte, kActive));
  const auto refusal = [](const std::string& text) {
    return test::error_of(ErrorCode::kBadInput, [&] { return parse_energy_parameters(text); });
  };
  EXPECT_THAT(refusal("activ_w"), HasSubstr("active_w"));
  EXPECT_THAT(refusal("op_pj,op_pj"), HasSubstr("twice"));
  EXPECT_THAT(refusal(""), HasSubstr("no parameter"));
}

}  // namespace
}  // namespace pirt
