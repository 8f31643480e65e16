// Whether the gate of two programs keeps what it promises on this machine: a program against
// itself, as it is and with a slowdown injected, and how often the answer was right.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/statistics/proportions.h"
#include "reports/document/document.h"
#include "reports/gate/duet_gate.h"

namespace pirt {

/// What one whole decision was about.
struct Trial {
  std::string_view name;      ///< "same", "execute +10 %".
  std::string_view injected;  ///< As parse_injection reads; empty = nothing.
  /// The rate of wrong answers that the gate promises to stay below; absent = none is promised.
  std::optional<double> promised;
};

/// All trials, `same` first.
[[nodiscard]] const std::vector<Trial>& self_test_trials();
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const Trial& find_trial(const std::string& name);

enum class TrialAnswer : std::uint8_t {
  kRight,         ///< Nothing found where nothing is; the slowdown found where it is.
  kWrong,         ///< A false alarm; a slowdown that was missed.
  kInconclusive,  ///< For an injected slowdown a miss as well.
};
[[nodiscard]] std::string_view to_string(TrialAnswer answer);

/// @param injected  The cell that was slowed down.
[[nodiscard]] TrialAnswer answer_of(const Trial& trial, const GateResult& result,
                                    const DuetCell& injected);

struct TrialCount {
  std::int64_t right = 0, wrong = 0, inconclusive = 0;
  double elapsed_s = 0;
  [[nodiscard]] std::int64_t decisions() const { return right + wrong + inconclusive; }
  /// Wrong ones; with an injected slowdown the inconclusive ones too.
  [[nodiscard]] std::int64_t misses(const Trial& trial) const;
};

/// What decisions there are, from a ledger's events {"decision": ...}.
class SelfTest {
 public:
  [[nodiscard]] static Ledger::Event event_of(const Trial& trial, TrialAnswer answer,
                                              double elapsed_s, std::string detail);
  /// @throws Error{kBadInput} if it is no such event.
  void apply(const Ledger::Event& event);
  [[nodiscard]] TrialCount count(const Trial& trial) const;

 private:
  std::map<std::string, TrialCount, std::less<>> counts_;
};

/// Whether the figures contradict what is promised: a lower bound of the rate is above it.
[[nodiscard]] bool breaks_promise(const SelfTest& test);
[[nodiscard]] Document self_test_document(const SelfTest& test);
[[nodiscard]] Json self_test_json(const SelfTest& test);

}  // namespace pirt
