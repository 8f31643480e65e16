// The one exception type of pirt and the exit code that each kind of error has.
#pragma once

#include <stdexcept>
#include <string>

namespace pirt {

enum class ErrorCode {
  kBadInput,     ///< Usage, or a file that cannot be used as it is: exit 2.
  kEnvironment,  ///< This machine cannot do it (no such device, no permission): exit 4.
};

/// A user or environment error. The message is what, the value, and the remedy, in one line.
/// Programmer errors are assertions and never this.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

/// Exit codes of every command (0 good).
inline constexpr int kExitCheckFailed = 1;
inline constexpr int kExitBadInput = 2;
inline constexpr int kExitInconclusive = 3;
inline constexpr int kExitEnvironment = 4;

[[nodiscard]] constexpr int exit_code(ErrorCode code) {
  return code == ErrorCode::kEnvironment ? kExitEnvironment : kExitBadInput;
}

[[noreturn]] inline void throw_bad_input(const std::string& message) {
  throw Error(ErrorCode::kBadInput, message);
}
[[noreturn]] inline void throw_environment(const std::string& message) {
  throw Error(ErrorCode::kEnvironment, message);
}

}  // namespace pirt
