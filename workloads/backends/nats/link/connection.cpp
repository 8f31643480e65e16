#include "workloads/backends/nats/link/connection.h"

#include <fmt/core.h>
#include <nats/nats.h>

#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <list>
#include <mutex>
#include <optional>
#include <random>
#include <regex>
#include <utility>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr std::size_t kStandardPayload = std::size_t{1} << 20;
constexpr std::size_t kLeastPayload = std::size_t{64} << 10;
constexpr std::size_t kHead = 4096;  ///< Of a message: subject, id, what a frame adds.
constexpr std::size_t kLargestChunk = std::size_t{512} << 10;
constexpr std::size_t kMostMessage = std::size_t{64} << 20;  ///< More no server takes.
constexpr Nanos kEnd = std::chrono::seconds(5);  ///< For the library's threads to see the end.
constexpr Nanos kTry = std::chrono::seconds(2);  ///< To connect, as the library counts it.

/// @throws Error{kBadInput} for what is no URL of a server.
std::string host_of(const std::string& server) {
  static const std::regex kUrl(
      R"((nats|tls)://([^/?#\s]*@)?(\[([^\]/?#\s@]+)\]|[^\[\]:/?#\s@]+)(:([1-9][0-9]{0,4}))?)");
  std::smatch parts;
  if (server.size() <= 1024 && std::regex_match(server, parts, kUrl) &&
      (!parts[6].matched || std::stoi(parts[6]) <= 65535)) {
    return parts[4].matched ? parts[4] : parts[3];
  }
  throw_bad_input("server '" + public_url(server) +
                  "' is none; a server is nats://HOST:PORT, or tls://HOST:PORT");
}

bool uses_tls(const ConnectionOptions& options) {
  return options.server.starts_with("tls:") || !options.ca.empty() || !options.certificate.empty();
}

void throw_unless(natsStatus status, const std::string& what) {
  if (status == NATS_OK) return;
  const char* const last = nats_GetLastError(nullptr);
  std::string_view why = last != nullptr && *last != 0 ? last : natsStatus_GetText(status);
  // "(conn.c:2088): ..." is a place in the library.
  if (const auto place = why.find("): "); why.starts_with('(') && place != why.npos) {
    why.remove_prefix(place + 3);
  }
  throw_environment(what + std::string(why));
}

using MessagePtr = std::unique_ptr<natsMsg, decltype([](natsMsg* m) { natsMsg_Destroy(m); })>;

ByteView data_of(natsMsg* message) {
  return {reinterpret_cast<const std::byte*>(natsMsg_GetData(message)),
          static_cast<std::size_t>(std::max(0, natsMsg_GetDataLength(message)))};
}

int status_of(natsMsg* message) {
  if (natsMsg_GetDataLength(message) > 0) return 0;
  const char* text = nullptr;
  if (natsMsgHeader_Get(message, "Status", &text) != NATS_OK || text == nullptr) return 0;
  return std::atoi(text);
}

/// No robot's and no worker's message has any. The server's own have: who asks it for what is
/// stored names the subject of the answer, and no permission binds that.
bool has_headers(natsMsg* message) {
  const char** keys = nullptr;
  int count = 0;
  const bool any = natsMsgHeader_Keys(message, &keys, &count) == NATS_OK;
  std::free(keys);
  return any;
}

using Options = std::unique_ptr<natsOptions, decltype([](auto* o) { natsOptions_Destroy(o); })>;

Options make_options(const ConnectionOptions& options) {
  natsOptions* raw = nullptr;
  throw_unless(natsOptions_Create(&raw), "libnats: ");
  Options made(raw);
  const std::string what = "server '" + public_url(options.server) + "': ";
  const auto set = [&](natsStatus status) { throw_unless(status, what); };
  set(natsOptions_SetURL(raw, options.server.c_str()));
  set(natsOptions_SetName(raw, options.name.c_str()));
  set(natsOptions_SetCustomInboxPrefix(raw, options.inbox.c_str()));
  set(natsOptions_SetAllowReconnect(raw, false));  // keep_open does: it says why there is none
  set(natsOptions_SetTimeout(raw, kTry / std::chrono::milliseconds(1)));
  set(natsOptions_SetWriteDeadline(raw, 5000));
  // A server that says nothing is gone after twice that.
  set(natsOptions_SetPingInterval(raw, 5000));
  set(natsOptions_SetMaxPingsOut(raw, 2));
  set(natsOptions_SetSendAsap(raw, true));
  set(natsOptions_SetFailRequestsOnDisconnect(raw, true));
  set(natsOptions_SetIgnoreDiscoveredServers(raw, true));  // nobody vouches for those
  if (uses_tls(options)) {
    set(natsOptions_SetSecure(raw, true));
    set(natsOptions_SkipServerVerification(raw, false));
    set(natsOptions_SetExpectedHostname(raw, host_of(options.server).c_str()));
    if (!options.ca.empty()) {
      throw_unless(natsOptions_LoadCATrustedCertificates(raw, options.ca.c_str()),
                   "the certificate authority '" + options.ca + "': ");
    }
    if (!options.certificate.empty()) {
      throw_unless(
          natsOptions_LoadCertificatesChain(raw, options.certificate.c_str(), options.key.c_str()),
          "the certificate '" + options.certificate + "': ");
    }
  }
  if (!options.nkey.empty()) {
    throw_unless(natsOptions_SetNKeyFromSeed(raw, options.nkey.c_str(), options.nkey_seed.c_str()),
                 "the NKey's seed '" + options.nkey_seed + "': ");
  }
  return made;
}

}  // namespace

struct Connection::State {
  struct Subscription {
    State* state;
    std::string subject;
    Handler handler;
    std::int64_t most_bytes;
  };

  ConnectionOptions options;
  Listener listener;
  std::atomic<bool> up = false;
  std::atomic<std::size_t> most_payload = kStandardPayload;  ///< Of the last connection.

  std::mutex mutex;  ///< Of what follows.
  std::condition_variable_any changed;
  std::shared_ptr<natsConnection> handle;        ///< Null while there is none.
  std::string why_down, problem;                 ///< What the last try came to; as problem().
  std::list<Subscription> wanted;                ///< What is subscribed to,
  std::vector<natsSubscription*> subscriptions;  ///< and how, over the handle.
  natsConnection* lost = nullptr;                ///< Whose end was told last.
  int dispatching = 0;  ///< Subscriptions whose last message may not have been handled.
  std::optional<Nanos> trying_since;  ///< To connect: the library may never come back from there.
  std::weak_ptr<State> self;
  MachineClock clock;

  [[nodiscard]] std::shared_ptr<natsConnection> current() {
    const std::lock_guard lock(mutex);
    return handle;
  }
  void note(std::string_view what) {
    const std::lock_guard lock(mutex);
    problem = what.substr(0, 500);
    std::ranges::replace_if(
        problem, [](char c) { return c < ' ' || c > '~'; }, ' ');
  }

  static void on_closed(natsConnection* connection, void* closure) {
    auto& state = *static_cast<State*>(closure);
    const std::lock_guard lock(state.mutex);
    state.lost = connection;
    state.changed.notify_all();
  }
  static void on_error(natsConnection* connection, natsSubscription*, natsStatus status,
                       void* closure) {
    const char* last = nullptr;
    const bool none = natsConnection_GetLastError(connection, &last) == NATS_OK || last == nullptr;
    static_cast<State*>(closure)->note(
        fmt::format("{}{}{}", natsStatus_GetText(status), none ? "" : ": ", none ? "" : last));
  }
  static void on_message(natsConnection*, natsSubscription*, natsMsg* raw, void* closure) {
    const MessagePtr message(raw);
    if (has_headers(raw)) return;
    const auto& subscription = *static_cast<Subscription*>(closure);
    try {  // The library is C: nothing may be thrown through it.
      subscription.handler({natsMsg_GetSubject(raw), data_of(raw)});
    } catch (const std::exception& error) {
      subscription.state->note(std::string("a message was dropped: ") + error.what());
    }
  }
  static void on_complete(void* closure) {
    auto& state = *static_cast<Subscription*>(closure)->state;
    const std::lock_guard lock(state.mutex);
    --state.dispatching;
    state.changed.notify_all();
  }

  void keep_open(const std::stop_token& stop) {
    name_thread("pirt-link");
    std::minstd_rand random(std::random_device{}());
    while (!stop.stop_requested()) {
      try {
        open(stop);
        if (listener) listener(true);
        std::unique_lock lock(mutex);
        changed.wait(lock, stop, [&] { return lost == handle.get(); });
        up = false;
        lock.unlock();
        if (listener) listener(false);
      } catch (const std::exception& error) {
        const std::lock_guard lock(mutex);
        up = false;
        why_down = error.what();
      }
      close();
      // Not all robots at once.
      const double jitter = std::uniform_real_distribution<double>(1, 2)(random);
      std::unique_lock lock(mutex);
      changed.wait_for(lock, stop, scaled(options.reconnect_wait, jitter), [] { return false; });
    }
  }

  /// @throws Error{kEnvironment} if there is no server, it refuses, or nobody wants it any more.
  void open(const std::stop_token& stop) {
    const Options made = make_options(options);
    throw_unless(natsOptions_SetClosedCB(made.get(), &State::on_closed, this), "libnats: ");
    throw_unless(natsOptions_SetErrorHandler(made.get(), &State::on_error, this), "libnats: ");
    natsConnection* connection = nullptr;
    std::unique_lock lock(mutex);
    if (stop.stop_requested()) throw_environment("it ends");
    lost = nullptr;
    trying_since = clock.now();
    lock.unlock();
    const natsStatus status = natsConnection_Connect(&connection, made.get());
    lock.lock();
    trying_since.reset();
    changed.notify_all();
    throw_unless(status, "");
    handle.reset(connection, natsConnection_Destroy);
    if (stop.stop_requested()) throw_environment("it ends");
    if (const std::int64_t most = natsConnection_GetMaxPayload(connection); most > 0) {
      most_payload = static_cast<std::size_t>(most);
    }
    for (Subscription& each : wanted) subscribe(each);
    why_down.clear();
    up = true;
  }

  /// With the lock.
  void subscribe(Subscription& to) {
    const auto set = [&](natsStatus status) {
      throw_unless(status, "subscription to " + to.subject + ": ");
    };
    natsSubscription* made = nullptr;
    set(natsConnection_Subscribe(&made, handle.get(), to.subject.c_str(), &State::on_message, &to));
    set(natsSubscription_SetPendingLimits(made, -1, static_cast<int>(to.most_bytes)));
    set(natsSubscription_SetOnCompleteCB(made, &State::on_complete, &to));
    ++dispatching;
    subscriptions.push_back(made);
  }

  /// Nothing is heard of the handle after that, unless the library takes longer than kEnd: then
  /// what it needs is kept.
  void close() {
    const auto old = current();
    if (old == nullptr) return;
    natsConnection_Close(old.get());
    std::unique_lock lock(mutex);
    if (changed.wait_for(lock, kEnd, [&] { return lost == old.get() && dispatching == 0; })) {
      for (natsSubscription* const each : subscriptions) natsSubscription_Destroy(each);
    } else {
      static_cast<void>(new std::pair(self.lock(), old));
    }
    subscriptions.clear();
    handle.reset();
  }
};

std::string public_url(const std::string& server) {
  const auto scheme = server.find("://"), at = server.rfind('@');
  if (at == std::string::npos) return server;
  return server.substr(0, scheme < at ? scheme + 3 : 0) + server.substr(at + 1);
}

void check_connection(const ConnectionOptions& options) {
  const std::string host = host_of(options.server);
  for (const auto& [what, file] : {std::pair("the certificate authority", &options.ca),
                                   std::pair("the certificate", &options.certificate),
                                   std::pair("the certificate's key", &options.key),
                                   std::pair("the NKey's seed", &options.nkey_seed)}) {
    std::error_code error;
    if (file->empty() || std::filesystem::is_regular_file(*file, error)) continue;
    throw_bad_input(fmt::format("{} '{}' is no file that can be read", what, *file));
  }
  if (options.certificate.empty() != options.key.empty()) {
    throw_bad_input("a certificate and its key belong together; give both, or neither");
  }
  if (options.nkey_seed.empty() != options.nkey.empty()) {
    throw_bad_input("an NKey and the file with its seed belong together; give both, or neither");
  }
  static const std::regex kLoopback(R"(localhost|::1|127\.[0-9.]*)");
  if (!uses_tls(options) && !options.insecure && !std::regex_match(host, kLoopback)) {
    throw_bad_input("server '" + public_url(options.server) +
                    "' is beyond this machine and would be spoken to without TLS: anybody on the "
                    "way could read and change tasks; use tls://, or allow it (--insecure; of a "
                    "unit, insecure: true)");
  }
}

Connection::Connection(const ConnectionOptions& options, Listener listener)
    : state_(std::make_shared<State>()) {
  check_connection(options);
  state_->self = state_;
  state_->options = options;
  state_->listener = std::move(listener);
  keeper_ = start_thread([state = state_](const std::stop_token& stop) { state->keep_open(stop); });
}

Connection::~Connection() {
  keeper_.request_stop();
  std::unique_lock lock(state_->mutex);
  const Nanos now = state_->clock.now(), since = state_->trying_since.value_or(now);
  if (!state_->changed.wait_for(lock, since + kEnd - now, [&] { return !state_->trying_since; })) {
    keeper_.detach();  // It keeps its state, and does nothing more if it ever comes back.
    return;
  }
  lock.unlock();
  keeper_.join();
  state_->close();  // Where it had ended early.
}

bool Connection::wait_until_up(Nanos most) {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, most, [this] { return state_->up.load(); });
}

bool Connection::is_up() const { return state_->up; }

std::string Connection::why_down() const {
  if (is_up()) return "";
  const std::lock_guard lock(state_->mutex);
  const auto since = state_->trying_since;
  const bool silent = since && state_->clock.now() - *since > 2 * kTry;
  const std::string said = silent ? natsStatus_GetText(NATS_TIMEOUT) : state_->why_down;
  constexpr const char* kFull =
      "it has as many connections as it may have; raise max_connections there";
  constexpr const char* kWho = "it lets this user not in; check its password, NKey or certificate";
  static constexpr std::pair<const char*, const char*> kKnown[] = {
      // What it says, and the remedy.
      {"maximum connections", kFull},
      {"expected 'pong', got ''", kFull},  // It says why, and hangs up: that may be lost.
      {"authorization", kWho},
      {"authentication", kWho},
      {"secure connection not available",
       "it speaks no TLS; ask for nats://, or give it a certificate (tls: { cert_file, key_file "
       "})"},
      {"ssl",
       "no TLS with it; its certificate has to follow from `ca` and be of its name, and it "
       "may ask for this one's `certificate`"},
      {"timeout", "it does not answer; is it stopped, or something else there?"},
      {"", "start one (nats-server -js), or name another"}};
  const auto* const known = std::ranges::find_if(
      kKnown, [&](const auto& each) { return ::strcasestr(said.c_str(), each.first) != nullptr; });
  return (said.empty() ? "" : said + "; ") + known->second;
}

std::string Connection::problem() const {
  const std::lock_guard lock(state_->mutex);
  return state_->problem;
}

void Connection::note(const std::string& problem) { state_->note(problem); }

std::string Connection::why_no_chunks() const {
  return fmt::format("max_payload of the server is {} bytes; give it {} or more",
                     state_->most_payload.load(), kLeastPayload);
}

void Connection::subscribe(const std::string& subject, Handler handler, std::int64_t most_bytes) {
  const std::lock_guard lock(state_->mutex);
  state_->wanted.push_back({state_.get(), subject, std::move(handler), most_bytes});
  if (state_->up) state_->subscribe(state_->wanted.back());
}

bool Connection::publish(const std::string& subject, ByteView data) {
  const auto handle = state_->current();
  return handle != nullptr && data.size() <= kMostMessage &&
         natsConnection_Publish(handle.get(), subject.c_str(), data.data(),
                                static_cast<int>(data.size())) == NATS_OK;
}

Connection::Answer Connection::request(const std::string& subject, ByteView data, Nanos most) {
  const auto handle = state_->current();
  if (handle == nullptr || !is_up() || data.size() > kMostMessage) return {};
  natsMsg* answer = nullptr;
  const natsStatus status = natsConnection_Request(
      &answer, handle.get(), subject.c_str(), reinterpret_cast<const char*>(data.data()),
      static_cast<int>(data.size()),
      std::max<std::int64_t>(1, most / std::chrono::milliseconds(1)));
  if (status == NATS_NO_RESPONDERS) return {true, kNobody, {}};
  if (status != NATS_OK) return {};
  const MessagePtr came(answer);
  const ByteView bytes = data_of(answer);
  return {true, status_of(answer), Bytes(bytes.begin(), bytes.end())};
}

std::uint32_t Connection::chunk_bytes() const {
  const std::size_t most = state_->most_payload;
  return most < kLeastPayload ? 0
                              : static_cast<std::uint32_t>(std::min(most - kHead, kLargestChunk));
}

std::uint64_t new_id() {
  std::random_device device;
  return (std::uint64_t{device()} << 32) | device();
}

}  // namespace pirt::cloud
