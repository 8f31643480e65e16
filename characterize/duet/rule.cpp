#include "characterize/duet/rule.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <utility>

#include "characterize/rank_tests.h"

namespace pirt {
namespace {

bool is_look(const std::vector<std::size_t>& looks, std::size_t count) {
  return std::ranges::find(looks, count) != looks.end();
}

}  // namespace

std::string_view to_string(DuetVerdict verdict) {
  switch (verdict) {
    case DuetVerdict::kUndecided:
      return "undecided";
    case DuetVerdict::kNotSlower:
      return "not slower";
    case DuetVerdict::kSlower:
      return "slower";
    case DuetVerdict::kInconclusive:
      return "inconclusive";
    case DuetVerdict::kRefused:
      return "refused";
  }
  return "";
}

DuetThresholds setup_thresholds() {
  DuetThresholds thresholds;
  thresholds.first_futility = 12;
  thresholds.puts_off = false;
  return thresholds;
}

DuetRule::DuetRule(DuetThresholds thresholds) : thresholds_(std::move(thresholds)) {
  assert(!thresholds_.looks.empty() && !thresholds_.confirmations.empty());
}

void DuetRule::add_block(double log_ratio) {
  if (verdict_ != DuetVerdict::kUndecided) return;
  if (confirming_) {
    confirmation_.push_back(log_ratio);
    if (is_look(thresholds_.confirmations, confirmation_.size())) look_again();
  } else {
    blocks_.push_back(log_ratio);
    if (is_look(thresholds_.looks, blocks_.size())) look();
  }
}

void DuetRule::add_canary(double log_ratio) {
  if (verdict_ == DuetVerdict::kUndecided) canaries_.push_back(log_ratio);
}

void DuetRule::look() {
  const auto& t = thresholds_;
  const std::size_t count = blocks_.size();
  const double median = median_of(blocks_);
  const auto lower = median_lower_bound(blocks_, t.bound_confidence);
  const auto upper = median_upper_bound(blocks_, t.bound_confidence);
  if (count >= t.first_suspicion && lower && *lower > t.suspicious_bound &&
      median > t.suspicious_median) {
    confirming_ = true;
    return;
  }
  const bool cleared = upper && *upper < t.suspicious_median;
  const bool futile = count >= t.first_futility && median < t.futile_median;
  const bool last = count >= t.looks.back();
  if (cleared || futile) return conclude(DuetVerdict::kNotSlower, last);
  if (!last) return;
  conclude(!upper || *upper > t.open_bound ? DuetVerdict::kInconclusive : DuetVerdict::kNotSlower,
           last);
}

void DuetRule::look_again() {
  const auto& t = thresholds_;
  const double median = median_of(confirmation_);
  const auto lower = median_lower_bound(confirmation_, t.confirmed_confidence);
  const bool last = confirmation_.size() >= t.confirmations.back();
  if (lower && *lower > 0 && median > t.suspicious_median) {
    return conclude(DuetVerdict::kSlower, last);
  }
  if (!last) return;
  const auto upper = median_upper_bound(confirmation_, t.bound_confidence);
  conclude(!upper || *upper > t.open_bound ? DuetVerdict::kInconclusive : DuetVerdict::kNotSlower,
           last);
}

void DuetRule::conclude(DuetVerdict verdict, bool last_look) {
  const auto& t = thresholds_;
  verdict_ = verdict;
  if (canaries_.empty() || std::abs(median_of(canaries_)) <= t.canary_median) return;
  if (canaries_.size() < t.canaries_needed) {
    if (t.puts_off) verdict_ = last_look ? DuetVerdict::kRefused : DuetVerdict::kUndecided;
    return;
  }
  std::vector<double> mirrored = canaries_;
  if (median_of(canaries_) < 0) {
    std::ranges::transform(mirrored, mirrored.begin(), std::negate<>());
  }
  if (sign_test_p(mirrored, 0) <= t.canary_alpha) verdict_ = DuetVerdict::kRefused;
}

double DuetRule::effect() const {
  return median_of(confirmation_.empty() ? blocks_ : confirmation_);
}

double DuetRule::p_value() const {
  return verdict_ == DuetVerdict::kSlower ? sign_test_p(confirmation_, 0) : 1;
}

}  // namespace pirt
