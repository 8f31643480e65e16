#include "characterize/duet/rule.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "characterize/statistics/rank_tests.h"

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
  for (double* effect : {&thresholds.suspicious_bound, &thresholds.suspicious_median,
                         &thresholds.futile_median, &thresholds.open_bound}) {
    *effect *= 2;
  }
  thresholds.first_futility = 12;
  return thresholds;
}

DuetRule::DuetRule(DuetThresholds thresholds) : thresholds_(std::move(thresholds)) {
  assert(!thresholds_.looks.empty() && !thresholds_.confirmations.empty());
}

void DuetRule::add_block(double log_ratio, std::size_t table) {
  if (verdict_ != DuetVerdict::kUndecided) return;
  if (confirming_) {
    confirmation_.push_back(log_ratio);
    if (is_look(thresholds_.confirmations, confirmation_.size())) look_again(table);
  } else {
    blocks_.push_back(log_ratio);
    if (is_look(thresholds_.looks, blocks_.size())) look();
  }
}

void DuetRule::add_canary(double log_ratio) {
  if (verdict_ == DuetVerdict::kUndecided) canaries_.push_back(log_ratio);
}

void DuetRule::give_up() {
  if (verdict_ == DuetVerdict::kUndecided) conclude(DuetVerdict::kInconclusive);
}

void DuetRule::look() {
  const auto& t = thresholds_;
  const auto lower = median_lower_bound(blocks_, t.bound_confidence);
  if (blocks_.size() >= t.first_suspicion && lower && *lower > t.suspicious_bound &&
      median_of(blocks_) > t.suspicious_median) {
    confirming_ = true;
    return;
  }
  clear(blocks_, t.looks.back());
}

void DuetRule::look_again(std::size_t table) {
  const auto& t = thresholds_;
  // Whoever corrects for the table takes back what is not sure enough among so many: before the
  // last look more blocks can still make it so.
  const bool last = confirmation_.size() >= t.confirmations.back();
  const double alpha = last ? t.alpha : t.alpha / static_cast<double>(table);
  if (median_of(confirmation_) > t.suspicious_median && sign_test_p(confirmation_, 0) < alpha) {
    return conclude(DuetVerdict::kSlower);
  }
  clear(confirmation_, t.confirmations.back());
}

/// Says "not slower" if that is clear, or if there is nothing to find; at the last look something.
void DuetRule::clear(const std::vector<double>& blocks, std::size_t last) {
  const auto& t = thresholds_;
  const auto upper = median_upper_bound(blocks, t.bound_confidence);
  const bool cleared = upper && *upper < t.suspicious_median;
  const bool futile = blocks.size() >= t.first_futility && median_of(blocks) < t.futile_median;
  if (cleared || futile) return conclude(DuetVerdict::kNotSlower);
  if (blocks.size() < last) return;
  const bool open = !upper || *upper > t.open_bound || median_of(blocks) > t.suspicious_median;
  conclude(open ? DuetVerdict::kInconclusive : DuetVerdict::kNotSlower);
}

void DuetRule::conclude(DuetVerdict verdict) {
  const auto& t = thresholds_;
  verdict_ = verdict;
  if (canaries_.empty() || std::abs(median_of(canaries_)) <= t.canary_median) return;
  const double p = std::min(sign_test_p(canaries_, 0), sign_test_p_below(canaries_, 0));
  if (2 * p <= t.canary_alpha) verdict_ = DuetVerdict::kRefused;
}

double DuetRule::effect() const {
  return median_of(confirmation_.empty() ? blocks_ : confirmation_);
}

double DuetRule::p_value() const {
  return verdict_ == DuetVerdict::kSlower ? sign_test_p(confirmation_, 0) : 1;
}

}  // namespace pirt
