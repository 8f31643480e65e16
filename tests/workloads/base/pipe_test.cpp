// What processes share: pipes and memory.
#include "workloads/base/system/pipe.h"

#include <gtest/gtest.h>

#include "workloads/base/system/shared_memory.h"

namespace pirt {
namespace {

bool is_pending(int signal) {
  sigset_t pending;
  sigpending(&pending);
  return sigismember(&pending, signal) == 1;
}

TEST(Pipe, WithoutReaderIsAnErrorAndNoSignal) {
  Pipe pipe = make_pipe();
  pipe.read.close();
  const WithoutSigpipe guard;
  EXPECT_LT(::write(pipe.write.get(), "x", 1), 0);
  EXPECT_EQ(errno, EPIPE);
}

TEST(Pipe, LeavesASignalThatWasPendingBefore) {
  sigset_t signals, before;
  sigemptyset(&signals);
  sigaddset(&signals, SIGPIPE);
  ::pthread_sigmask(SIG_BLOCK, &signals, &before);
  Pipe pipe = make_pipe();
  pipe.read.close();
  const auto write_quietly = [&pipe] {
    const WithoutSigpipe guard;
    EXPECT_LT(::write(pipe.write.get(), "x", 1), 0);
  };
  write_quietly();
  EXPECT_FALSE(is_pending(SIGPIPE));
  ::raise(SIGPIPE);
  write_quietly();
  EXPECT_TRUE(is_pending(SIGPIPE));
  const timespec now{};
  EXPECT_EQ(::sigtimedwait(&signals, nullptr, &now), SIGPIPE);
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

TEST(SharedMemory, KeepsItsSizeWhateverOthersDo) {
  const SharedMemory memory("test", 5000);
  memory.data()[4999] = std::byte{7};
  EXPECT_NE(::ftruncate(memory.fd(), 0), 0);
  std::byte last{};
  EXPECT_EQ(::pread(memory.fd(), &last, 1, 4999), 1);
  EXPECT_EQ(last, std::byte{7});
}

}  // namespace
}  // namespace pirt
