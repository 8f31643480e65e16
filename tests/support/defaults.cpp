// Linked into every test program: the tests' devices have their default parameters, whatever the
// user who runs them has tuned, and signals do what they do by default, also under nohup and in a
// shell's background. Programs that tests start inherit both.
#include <csignal>
#include <cstdlib>
#include <initializer_list>

namespace {

[[maybe_unused]] const int kUntuned = ::setenv("PIRT_TUNING", "none", 1);
[[maybe_unused]] const bool kHeard = [] {
  for (const int signal : {SIGINT, SIGHUP, SIGPIPE}) std::signal(signal, SIG_DFL);
  return true;
}();

}  // namespace
