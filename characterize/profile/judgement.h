// What is held against a figure.
//
// A *reason* says that it is no figure of this workload on this unit: it is shown, and never used.
// A *doubt* says that its interval is wide: it is used, and marked wherever it is shown. Which
// words are which is documented in schema.sql.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pirt {

struct Judgement {
  std::vector<std::string> reasons, doubts;

  /// Adds a word to those that it is one of.
  void add(std::string word);
};

/// Whether a word is a doubt: imprecise, unstable, throttled, contended, few_samples, alone or with
/// ": TEXT" behind it.
[[nodiscard]] bool is_doubt(std::string_view word);
/// Of one list that all words stand in. What has no figure has a reason: no_samples, if no other.
[[nodiscard]] Judgement judgement_of(const std::vector<std::string>& words, bool has_figure);

/// Of rows and records, which have both lists: nothing says that it is no figure.
template <typename Row>
[[nodiscard]] bool is_used(const Row& row) {
  return row.reasons.empty();
}
/// @param strict  Neither does anything say that it is uncertain.
template <typename Row>
[[nodiscard]] bool is_used(const Row& row, bool strict) {
  return row.reasons.empty() && (!strict || row.doubts.empty());
}
template <typename Row>
[[nodiscard]] bool is_doubted(const Row& row) {
  return row.reasons.empty() && !row.doubts.empty();
}
/// Column `valid`: there is neither.
template <typename Row>
[[nodiscard]] bool is_valid(const Row& row) {
  return row.reasons.empty() && row.doubts.empty();
}
template <typename Row>
void hold_against(Row& row, Judgement found) {
  for (std::string& each : found.reasons) row.reasons.push_back(std::move(each));
  for (std::string& each : found.doubts) row.doubts.push_back(std::move(each));
}
/// Both lists.
template <typename Row>
[[nodiscard]] std::vector<std::string> held_against(const Row& row) {
  std::vector<std::string> words = row.reasons;
  words.insert(words.end(), row.doubts.begin(), row.doubts.end());
  return words;
}

/// An interval of a doubted figure that spans more than this factor tells nothing of the order of
/// units: `??`.
inline constexpr double kWildSpan = 4;

}  // namespace pirt
