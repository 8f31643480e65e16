#include "characterize/profile/judgement.h"

#include <algorithm>
#include <array>

namespace pirt {
namespace {

constexpr std::array kDoubts = {std::string_view("imprecise"),   std::string_view("unstable"),
                                std::string_view("throttled"),   std::string_view("contended"),
                                std::string_view("few_samples"), std::string_view("odd_stamps")};

}  // namespace

bool is_doubt(std::string_view word) {
  return std::ranges::find(kDoubts, word.substr(0, word.find(':'))) != kDoubts.end();
}

void Judgement::add(std::string word) {
  (is_doubt(word) ? doubts : reasons).push_back(std::move(word));
}

Judgement judgement_of(const std::vector<std::string>& words, bool has_figure) {
  Judgement found;
  for (const std::string& each : words) found.add(each);
  if (has_figure) return found;
  std::erase(found.doubts, "few_samples");
  if (found.reasons.empty()) found.reasons.emplace_back("no_samples");
  return found;
}

}  // namespace pirt
