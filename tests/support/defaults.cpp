// Linked into every test program: the tests' devices have their default parameters, whatever the
// user who runs them has tuned. Programs that tests start inherit it.
#include <cstdlib>

namespace {

[[maybe_unused]] const int kUntuned = ::setenv("PIRT_TUNING", "none", 1);

}  // namespace
