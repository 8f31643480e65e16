// A connection to a NATS server that comes back by itself; its .cpp alone knows libnats.
//
// Handlers are called from the library's threads, and must not block for long: what is thrown there
// is said as a problem. None is called once the destructor has returned, unless it takes over 5 s.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

struct ConnectionOptions {
  std::string server = "nats://127.0.0.1:4222";  ///< tls:// for TLS.
  std::string name = "pirt";                     ///< For whoever looks at the server.
  std::string inbox = "_INBOX";                  ///< What answers come to begins with it.
  bool insecure = false;                         ///< Beyond loopback without TLS is not refused.
  // Files; empty = none.
  std::string ca = {};                     ///< That the server's certificate follows from.
  std::string certificate = {}, key = {};  ///< Of this client.
  std::string nkey_seed = {};              ///< Of this client, in place of a certificate.
  std::string nkey = {};                   ///< The public key of the seed.
  Nanos reconnect_wait = std::chrono::milliseconds(200);
};

/// Without a user and a password: for messages, profiles, reports.
[[nodiscard]] std::string public_url(const std::string& server);

/// @throws Error{kBadInput} for what is no URL of a server, for one beyond loopback without TLS
/// that is not said to be insecure, and for files that are not there or not complete.
void check_connection(const ConnectionOptions& options);

/// A status: nobody listens; of JetStream: it has not begun yet.
inline constexpr int kNobody = 503;

struct Incoming {
  std::string subject;
  ByteView data;  ///< As long as the handler runs.
};

/// Any thread may call it.
class Connection {
 public:
  using Handler = std::function<void(const Incoming&)>;
  using Listener = std::function<void(bool is_up)>;

  /// Returns at once, whether or not there is a server.
  /// @param listener  Is told when there is one, and when it is lost; may be empty.
  /// @throws As check_connection; Error{kEnvironment} if the library cannot begin.
  Connection(const ConnectionOptions& options, Listener listener);
  ~Connection();

  /// Until it is up, or @p most is over. @return  Whether it is.
  [[nodiscard]] bool wait_until_up(Nanos most);
  [[nodiscard]] bool is_up() const;
  /// Why it is not up, as the server or the library says it, with the remedy; empty if it is.
  [[nodiscard]] std::string why_down() const;
  /// What the server complained of last, or what was wrong with a message; empty = nothing. One
  /// line of printable characters, whoever wrote it.
  [[nodiscard]] std::string problem() const;
  void note(const std::string& problem);
  /// More than @p most_bytes that wait for the handler are not taken: no sender fills the memory.
  /// Nor are messages with headers.
  void subscribe(const std::string& subject, Handler handler,
                 std::int64_t most_bytes = std::int64_t{64} << 20);
  /// @return  Whether it is on its way.
  bool publish(const std::string& subject, ByteView data);

  struct Answer {
    bool came = false;  ///< Else: no connection, or nothing came in time.
    int status = 0;     ///< Of the server's own: 404, 408, 503; 0 = none.
    Bytes data = {};
  };
  /// How long the server may take to answer what it knows itself.
  static constexpr Nanos kAnswer = std::chrono::seconds(5);
  /// Blocks; not from a handler.
  [[nodiscard]] Answer request(const std::string& subject, ByteView data, Nanos most = kAnswer);
  /// Of a message's data that is certain to fit with its head; a standard server's before there was
  /// a connection, 0 where the server's max_payload is too small for robots and workers.
  [[nodiscard]] std::uint32_t chunk_bytes() const;
  /// The same of a blob's: some are under way at a time, and each has to be answered within kAnswer
  /// over a slow link too.
  [[nodiscard]] std::uint32_t blob_chunk_bytes() const {
    return std::min<std::uint32_t>(chunk_bytes(), 128 << 10);
  }
  /// What to say of that, with the remedy.
  [[nodiscard]] std::string why_no_chunks() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
  std::jthread keeper_;  ///< Makes another one where the library has given it up.
};

/// Random: of a run of a robot's program, or a start of a worker's.
[[nodiscard]] std::uint64_t new_id();

[[nodiscard]] inline std::string_view text_of(ByteView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace pirt::cloud
