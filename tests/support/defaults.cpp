// Linked into every test program: the tests' devices have their default parameters, whatever the
// user who runs them has tuned, unless PIRT_TEST_TUNING has another PIRT_TUNING for them, no board
// of this machine is a meter, and signals do what they do by default, also under nohup and in a
// shell's background. Programs that tests start inherit both. testing::TempDir() is a folder of the
// process's own, since tests run side by side.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <string>

namespace {

[[maybe_unused]] const int kTuned = [] {
  const char* const tuning = std::getenv("PIRT_TEST_TUNING");
  return ::setenv("PIRT_TUNING", tuning == nullptr ? "none" : tuning, 1);
}();
[[maybe_unused]] const int kNoBoards = ::setenv("PIRT_NVML", "none", 1);
[[maybe_unused]] const bool kHeard = [] {
  for (const int signal : {SIGINT, SIGHUP, SIGPIPE}) std::signal(signal, SIG_DFL);
  return true;
}();

class OwnFolder {
 public:
  OwnFolder() {
    if (::mkdtemp(path_.data()) == nullptr) std::abort();
    ::setenv("TEST_TMPDIR", path_.c_str(), 1);
  }
  ~OwnFolder() {
    std::error_code unheard;
    if (::getpid() == owner_) std::filesystem::remove_all(path_, unheard);
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;

 private:
  std::string path_ = (std::filesystem::temp_directory_path() / "pirt-tests-XXXXXX").string();
  pid_t owner_ = ::getpid();
};
const OwnFolder kFolder;

}  // namespace
