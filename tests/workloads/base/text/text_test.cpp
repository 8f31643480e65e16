// Opening what the user names: files and pipes to their end, nothing that has none, and no wait
// that does not hear signals.
#include "workloads/base/text/text.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "tests/support/errors.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(Text, WordsStandBetweenBlanksOfAnyKind) {
  EXPECT_THAT(words_in("\ta  b\r\n c"), testing::ElementsAre("a", "b", "c"));
  EXPECT_THAT(words_in(" \t"), testing::IsEmpty());
}

/// Whether the process has a handler of its own, without which the signal would end it.
bool handles(pid_t process, int signal) {
  std::ifstream in("/proc/" + std::to_string(process) + "/status");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("SigCgt:")) {
      return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1U) != 0;
    }
  }
  return false;
}

class ReadFile : public testing::Test {
 protected:
  ReadFile() {
    std::string name = (std::filesystem::temp_directory_path() / "pirt-text-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    folder_ = name;
  }
  ~ReadFile() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path write(const std::string& text) const {
    std::ofstream(folder_ / "file", std::ios::binary) << text;
    return folder_ / "file";
  }
  [[nodiscard]] std::filesystem::path fifo() const {
    EXPECT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
    return folder_ / "fifo";
  }
  static std::string refused(const std::filesystem::path& path, std::size_t max_bytes) {
    return bad_input([&] { static_cast<void>(read_file(path, max_bytes)); });
  }

  std::filesystem::path folder_;
};

TEST_F(ReadFile, GivesEveryByte) {
  const std::string bytes = std::string("a\0b\n\xff", 5) + std::string(100'000, 'x');
  EXPECT_EQ(read_file(write(bytes)), bytes);
  EXPECT_EQ(read_file(write("")), "");
}

TEST_F(ReadFile, TakesTextAsOtherSystemsWriteIt) {
  const auto text_of = [this](const std::string& bytes) { return read_text(write(bytes)); };
  EXPECT_EQ(text_of("\xef\xbb\xbf"
                    "a\r\nb\r\n"),
            "a\nb\n");
  EXPECT_EQ(text_of("a\rb\r"), "a\rb\r") << "no end of a line";
  EXPECT_EQ(text_of(""), "");
  EXPECT_EQ(text_of("\xef\xbb\xbf"), "");
  EXPECT_THAT(bad_input([&] {
                text_of(
                    std::string("\xff\xfe"
                                "a\0",
                                4));
              }),
              HasSubstr("UTF-16"));
  EXPECT_THAT(bad_input([&] { text_of("version https://git-lfs.github.com/spec/v1\noid x\n"); }),
              AllOf(HasSubstr("Git LFS"), HasSubstr("git lfs pull")));
  EXPECT_THAT(bad_input([&] { text_of("/annex/objects/MD5E-s12--ab.db3\n"); }),
              HasSubstr("git annex get"));
  EXPECT_THAT(bad_input([&] { text_of("<!DOCTYPE html>\n<html>404</html>"); }),
              HasSubstr("a web page"));
  EXPECT_EQ(text_of("<!doctype ht"), "<!doctype ht");
}

TEST_F(ReadFile, TakesAsMuchAsTheLimitAndNotAByteMore) {
  const std::size_t limit = std::size_t{1} << 20;
  EXPECT_EQ(read_file(write(std::string(limit, 'x')), limit).size(), limit);
  EXPECT_THAT(refused(write(std::string(limit + 1, 'x')), limit),
              AllOf(HasSubstr("file'"), HasSubstr("longer than the 1 MiB")));
  EXPECT_EQ(read_file(write(std::string(limit + 1, 'x')), kAnySize).size(), limit + 1);
}

TEST_F(ReadFile, RefusesWhatIsNoFile) {
  EXPECT_THAT(refused(folder_, kAnySize), HasSubstr("Is a directory"));
  EXPECT_THAT(refused(folder_ / "none", kAnySize), HasSubstr("No such file"));
  EXPECT_THAT(refused("/dev/zero", kAnySize), HasSubstr("device"));
  EXPECT_THAT(refused("/dev/null", kAnySize), HasSubstr("device"));
}

TEST_F(ReadFile, ReadsAPipeToItsEndHoweverSlowItsWriter) {
  const auto path = fifo();
  std::thread writer([&] {
    std::ofstream out(path);
    for (int i = 0; i < 100; ++i) out << std::string(1000, 'y') << std::flush;
  });
  EXPECT_EQ(read_file(path), std::string(100'000, 'y'));
  writer.join();
}

TEST_F(ReadFile, EndsAPipeThatHasNoEndAtTheLimit) {
  const auto path = fifo();
  const pid_t writer = ::fork();
  if (writer == 0) {
    std::signal(SIGPIPE, SIG_DFL);
    std::ofstream out(path);
    while (true) out << std::string(4096, 'z');
  }
  EXPECT_THAT(refused(path, std::size_t{1} << 20), HasSubstr("longer than the 1 MiB"));
  int status = 0;
  EXPECT_EQ(::waitpid(writer, &status, 0), writer);
}

TEST_F(ReadFile, StopsWaitingForAPipeAtASignalThatTheProgramHandles) {
  const auto path = fifo();
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGTERM, [](int) {});  // restarts system calls
    try {
      static_cast<void>(read_file(path));
    } catch (const Error& error) {
      ::_exit(error.code() == ErrorCode::kEnvironment ? 0 : 1);
    }
    ::_exit(2);
  }
  int status = 0;
  // The first signals may come before the wait; one of them will not.
  while (::waitpid(child, &status, WNOHANG) == 0) {
    if (handles(child, SIGTERM)) ::kill(child, SIGTERM);
    ::usleep(10'000);
  }
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace pirt::test
