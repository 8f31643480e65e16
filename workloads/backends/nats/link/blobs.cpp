#include "workloads/backends/nats/link/blobs.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

constexpr std::uint32_t kWindow = 4;  ///< Chunks under way.

/// Calls @p work with each number below @p count, some at a time, until one says no.
/// @param work  bool(std::uint32_t)
template <typename Work>
void in_window(std::uint32_t count, const Work& work) {
  std::atomic<std::uint32_t> next = 0;
  std::atomic<bool> goes_on = true;
  const auto run = [&] {
    while (goes_on) {
      const std::uint32_t number = next++;
      if (number >= count) return;
      if (!work(number)) goes_on = false;
    }
  };
  std::vector<std::jthread> others;
  for (std::uint32_t i = 1; i < std::min(kWindow, count); ++i) others.push_back(start_thread(run));
  run();
}

}  // namespace

Put put_blob(Connection& connection, const std::string& prefix, ByteView bytes,
             std::uint32_t chunk_bytes, const std::function<bool()>& stop, std::uint32_t first) {
  const auto chunks = static_cast<std::uint32_t>((bytes.size() + chunk_bytes - 1) / chunk_bytes);
  if (first >= chunks) first = 0;
  std::mutex mutex;
  Put put;
  std::vector<bool> stored(chunks, false);
  const auto fail = [&](std::string problem) {
    const std::lock_guard lock(mutex);
    if (put.problem.empty()) put.problem = std::move(problem);
    return false;
  };
  in_window(chunks - first, [&](std::uint32_t behind) {
    const std::uint32_t number = first + behind;
    const std::size_t from = std::size_t{number} * chunk_bytes;
    const ByteView chunk =
        bytes.subspan(from, std::min<std::size_t>(chunk_bytes, bytes.size() - from));
    while (true) {
      if (stop()) return fail("stopped");
      const auto answer =
          connection.request(prefix + "." + std::to_string(number), chunk, Connection::kAnswer);
      if (!answer.came) {  // Goes on where it was once there is a link.
        static_cast<void>(connection.wait_until_up(std::chrono::milliseconds(100)));
        continue;
      }
      const Stored taken = read_stored(answer.status, answer.data);
      if (!taken.ok) return fail("stream " + std::string(kBlobStream) + ": " + taken.problem);
      const std::lock_guard lock(mutex);
      stored[number] = true;
      return true;
    }
  });
  put.stored = first;
  while (put.stored < chunks && stored[put.stored]) ++put.stored;
  return put;
}

Fetched fetch_blob(Connection& connection, const std::string& prefix, const Blob& blob,
                   const std::function<bool()>& stop) {
  Fetched fetched;
  const std::string direct = "$JS.API.DIRECT.GET." + std::string(kBlobStream) + "." + prefix + ".";
  for (std::uint32_t first = 0; first < blob.chunks(); first += kWindow) {
    if (stop()) return {};
    std::array<Connection::Answer, kWindow> answers;
    const std::uint32_t count = std::min(kWindow, blob.chunks() - first);
    in_window(count, [&](std::uint32_t i) {
      answers[i] = connection.request(direct + std::to_string(first + i), "", Connection::kAnswer);
      return answers[i].came && answers[i].status == 0;
    });
    for (std::uint32_t i = 0; i < count; ++i) {
      const Connection::Answer& answer = answers[i];
      if (!answer.came || answer.status == kNobody) return {};
      const std::uint64_t left = blob.size_bytes - fetched.bytes.size();
      if (answer.status != 0) return {Fetched::How::kMissing, {}};
      if (answer.data.size() != std::min<std::uint64_t>(left, blob.chunk_bytes)) {
        return {Fetched::How::kDamaged, {}};
      }
      fetched.bytes.insert(fetched.bytes.end(), answer.data.begin(), answer.data.end());
    }
  }
  const bool same = digest_of(fetched.bytes) == blob.digest;
  if (!same) return {Fetched::How::kDamaged, {}};
  fetched.how = Fetched::How::kWhole;
  return fetched;
}

void remove_blob(Connection& connection, const std::string& prefix) {
  connection.publish("$JS.API.STREAM.PURGE." + std::string(kBlobStream),
                     json_text(Json::object({{"filter", prefix + ".>"}})),
                     connection.inbox() + ".purged");
}

}  // namespace pirt::cloud
