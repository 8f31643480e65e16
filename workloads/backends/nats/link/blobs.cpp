#include "workloads/backends/nats/link/blobs.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

constexpr std::uint32_t kWindow = 4;  ///< Chunks under way.
constexpr int kNoMessage = 404;       ///< As JetStream says it.

/// Calls @p work with each number below @p count, some at a time, until one says no.
/// @param work  bool(std::uint32_t)
/// @return  Whether all said yes.
template <typename Work>
bool in_window(std::uint32_t count, const Work& work) {
  std::atomic<std::uint32_t> next = 0, done = 0;
  const auto run = [&] {
    for (std::uint32_t number = next++; number < count; number = next++) {
      work(number) ? ++done : next = count;
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::uint32_t i = 1; i < std::min(kWindow, count); ++i) {
      others.push_back(start_thread(run));
    }
    run();
  }
  return done == count;
}

/// Asks until there is an answer, as long as that may help.
Connection::Answer ask(Connection& connection, const std::string& subject, ByteView data,
                       const std::function<bool()>& stop, Nanos no_step) {
  const MachineClock clock;
  for (const Nanos begin = clock.now(); !stop();) {
    auto answer = connection.request(subject, data);
    if (answer.came || clock.now() - begin >= no_step) return answer;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return {};
}

template <typename Byte>
std::span<Byte> part(std::span<Byte> bytes, std::uint32_t chunk_bytes, std::uint32_t number) {
  const std::size_t from = std::size_t{number} * chunk_bytes;
  return bytes.subspan(from, std::min<std::size_t>(chunk_bytes, bytes.size() - from));
}

}  // namespace

std::string put_blob(Connection& connection, const std::string& prefix, const Blob& blob,
                     ByteView bytes, const std::function<bool()>& stop, Nanos no_step) {
  if (blob.chunk_bytes < kLeastChunkBytes || blob.chunk_bytes > connection.chunk_bytes()) {
    return connection.why_no_chunks();
  }
  std::mutex mutex;
  std::string problem;
  const bool all = in_window(blob.chunks(), [&](std::uint32_t number) {
    const auto answer = ask(connection, prefix + "." + std::to_string(number),
                            part(bytes, blob.chunk_bytes, number), stop, no_step);
    const std::string why =
        answer.came ? read_answer(answer).why
                    : fmt::format(
                          "nothing said within {:.3g} s that it stored what was sent to "
                          "{}.N; is the server there, the link fast enough, and may this "
                          "user say that (pirt cloud-admin permissions)?",
                          to_s(no_step), prefix);
    if (why.empty()) return true;
    const std::lock_guard lock(mutex);
    if (problem.empty()) problem = why;
    return false;
  });
  return all || !problem.empty() ? problem : "no memory was left to send it";
}

Connection::Answer fetch_blob(Connection& connection, const std::string& prefix, const Blob& blob,
                              const std::function<bool()>& stop, Nanos no_step) {
  Bytes bytes(static_cast<std::size_t>(blob.size_bytes));
  const std::string direct =
      fmt::format("$JS.API.DIRECT.GET.{}.{}.", blob_stream(robot_of(prefix)), prefix);
  std::atomic<bool> answered = true;
  const bool all = in_window(blob.chunks(), [&](std::uint32_t number) {
    const auto answer = ask(connection, direct + std::to_string(number), {}, stop, no_step);
    const auto to = part(std::span(bytes), blob.chunk_bytes, number);
    if (!answer.came || answer.status == kNobody) answered = false;
    if (!answer.came || answer.status != 0 || answer.data.size() != to.size()) return false;
    std::memcpy(to.data(), answer.data.data(), to.size());
    return true;
  });
  if (!answered) return {};
  if (!all || digest_of(bytes) != blob.digest) return {.came = true, .status = kNoMessage};
  return {.came = true, .data = std::move(bytes)};
}

void remove_blob(Connection& connection, const std::string& prefix) {
  const std::string text = json_text(Json::object({{"filter", prefix + ".>"}}));
  connection.publish("$JS.API.STREAM.PURGE." + blob_stream(robot_of(prefix)),
                     std::as_bytes(std::span(text)));
}

}  // namespace pirt::cloud
