#include "workloads/backends/nats/link/connection.h"

#include <fmt/core.h>
#include <nats/nats.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <utility>
#include <vector>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

constexpr std::size_t kStandardPayload = std::size_t{1} << 20;
constexpr std::size_t kHead = 4096;  ///< Of a message: subject, id, what a frame adds.
constexpr std::size_t kLargestChunk = std::size_t{512} << 10;
constexpr std::size_t kMostMessage = std::size_t{64} << 20;  ///< More no server takes.
/// For the library's threads to have seen the end.
constexpr Nanos kEnd = std::chrono::seconds(5);
/// Until a connection that the library has given up is made anew.
constexpr Nanos kAgain = std::chrono::seconds(1);

std::int64_t ms(Nanos time) {
  return std::max<std::int64_t>(
      1, std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
}

void throw_unless(natsStatus status, const std::string& what) {
  if (status == NATS_OK) return;
  const char* const last = nats_GetLastError(nullptr);
  throw_environment(fmt::format("{}: {}{}{}", what, natsStatus_GetText(status),
                                last != nullptr && *last != 0 ? ": " : "",
                                last != nullptr ? last : ""));
}

struct DestroyOptions {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
struct DestroyMessage {
  void operator()(natsMsg* message) const { natsMsg_Destroy(message); }
};
using MessagePtr = std::unique_ptr<natsMsg, DestroyMessage>;

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

}  // namespace

struct Connection::State {
  struct Subscription {
    std::weak_ptr<State> state;
    Handler handler;
  };

  ConnectionOptions options;
  Events events;
  std::string inbox;
  std::atomic<bool> up = false;

  std::mutex opening;  ///< Who makes a handle or a subscription; before the other one.
  std::mutex mutex;    ///< Of what follows.
  std::condition_variable_any changed;
  std::shared_ptr<natsConnection> handle;  ///< Null before the first one is there.
  std::string
      refusal;  ///< What the first try of the handle came to; the library keeps no later one.
  struct Wanted {
    std::string subject;
    Handler handler;
    std::int64_t most_bytes = 0;
  };
  std::vector<Wanted> wanted;                    ///< What is subscribed to,
  std::vector<natsSubscription*> subscriptions;  ///< and how, over the handle.
  bool closed = false;                           ///< The handle, by us or by the library.
  int dispatching = 0;  ///< Subscriptions whose last message may not have been handled.

  [[nodiscard]] std::shared_ptr<natsConnection> current() {
    const std::lock_guard lock(mutex);
    return handle;
  }

  // A handler of the library's gets a pointer to a shared one of its own.
  using Shared = std::shared_ptr<State>;
  static State& of(void* closure) { return **static_cast<Shared*>(closure); }

  static void on_up(natsConnection*, void* closure) {
    State& state = of(closure);
    {
      const std::lock_guard lock(state.mutex);
      state.up = true;
    }
    state.changed.notify_all();
    if (state.events.up) state.events.up();
  }
  static void on_down(natsConnection*, void* closure) {
    State& state = of(closure);
    state.up = false;
    if (state.events.down) state.events.down();
  }
  static void on_closed(natsConnection*, void* closure) {
    const std::unique_ptr<Shared> last(static_cast<Shared*>(closure));
    State& state = **last;
    const bool was_up = state.up.exchange(false);
    {
      const std::lock_guard lock(state.mutex);
      state.closed = true;
    }
    state.changed.notify_all();
    if (was_up && state.events.down) state.events.down();
  }
  static void on_error(natsConnection* connection, natsSubscription*, natsStatus status,
                       void* closure) {
    State& state = of(closure);
    if (!state.events.problem) return;
    const std::string last = last_error(connection);
    state.events.problem(natsStatus_GetText(status) + (last.empty() ? "" : ": " + last));
  }
  static std::string last_error(natsConnection* connection) {
    const char* last = nullptr;
    if (natsConnection_GetLastError(connection, &last) == NATS_OK || last == nullptr) return "";
    return last;
  }
  static void on_message(natsConnection*, natsSubscription*, natsMsg* raw, void* closure) {
    const MessagePtr message(raw);
    const auto& subscription = *static_cast<Subscription*>(closure);
    const char* const reply = natsMsg_GetReply(raw);
    // The library is C: nothing may be thrown through it.
    std::string problem;
    try {
      return subscription.handler(
          {natsMsg_GetSubject(raw), reply == nullptr ? "" : reply, data_of(raw), status_of(raw)});
    } catch (const std::exception& error) {
      problem = error.what();
    }
    const Shared state = subscription.state.lock();
    if (state && state->events.problem) state->events.problem("a message was dropped: " + problem);
  }
  static void on_complete(void* closure) {
    const auto* const subscription = static_cast<Subscription*>(closure);
    if (const Shared state = subscription->state.lock()) {
      const std::lock_guard lock(state->mutex);
      --state->dispatching;
      state->changed.notify_all();
    }
    delete subscription;
  }

  static void open(const Shared& state);
  static void subscribe(const Shared& state, const Wanted& wanted);
  static void keep_open(const std::stop_token& stop, const Shared& state);
  bool forget_handle(std::unique_lock<std::mutex>& lock);
};

namespace {

using Options = std::unique_ptr<natsOptions, DestroyOptions>;

Options make_options(const ConnectionOptions& options) {
  natsOptions* raw = nullptr;
  throw_unless(natsOptions_Create(&raw), "libnats");
  Options made(raw);
  const std::string what = "server '" + public_url(options.server) + "'";
  const auto set = [&](natsStatus status) { throw_unless(status, what); };
  const Url url = parse_url(options.server);
  set(natsOptions_SetURL(raw, options.server.c_str()));
  set(natsOptions_SetName(raw, options.name.c_str()));
  set(natsOptions_SetCustomInboxPrefix(raw, options.inbox.c_str()));
  set(natsOptions_SetMaxReconnect(raw, -1));
  set(natsOptions_SetReconnectWait(raw, ms(options.reconnect_wait)));
  set(natsOptions_SetReconnectJitter(raw, ms(options.reconnect_wait), ms(options.reconnect_wait)));
  set(natsOptions_SetTimeout(raw, 2000));
  set(natsOptions_SetWriteDeadline(raw, 5000));
  // A server that says nothing is gone after twice that.
  set(natsOptions_SetPingInterval(raw, 5000));
  set(natsOptions_SetMaxPingsOut(raw, 2));
  set(natsOptions_SetSendAsap(raw, true));
  // What is said while there is no link is said again by whoever said it.
  set(natsOptions_SetReconnectBufSize(raw, 256 << 10));
  set(natsOptions_SetFailRequestsOnDisconnect(raw, true));
  set(natsOptions_SetIgnoreDiscoveredServers(raw, true));  // nobody vouches for those
  if (url.scheme == "tls" || !options.ca.empty()) {
    set(natsOptions_SetSecure(raw, true));
    set(natsOptions_SkipServerVerification(raw, false));
    set(natsOptions_SetExpectedHostname(raw, url.host.c_str()));
    if (!options.ca.empty()) {
      throw_unless(natsOptions_LoadCATrustedCertificates(raw, options.ca.c_str()),
                   "the certificate authority '" + options.ca + "'");
    }
    if (!options.certificate.empty()) {
      throw_unless(
          natsOptions_LoadCertificatesChain(raw, options.certificate.c_str(), options.key.c_str()),
          "the certificate '" + options.certificate + "'");
    }
  }
  if (!options.nkey.empty()) {
    throw_unless(natsOptions_SetNKeyFromSeed(raw, options.nkey.c_str(), options.nkey_seed.c_str()),
                 "the NKey's seed '" + options.nkey_seed + "'");
  }
  return made;
}

/// What a try that the library does not repeat comes to: of those that it does it keeps nothing.
std::string why_refused(const ConnectionOptions& options) {
  const Options once = make_options(options);
  natsConnection* connection = nullptr;
  if (natsConnection_Connect(&connection, once.get()) == NATS_OK) {
    natsConnection_Destroy(connection);
    return "";
  }
  const char* const last = nats_GetLastError(nullptr);
  return last == nullptr ? "" : last;
}

}  // namespace

/// Makes a handle, with all subscriptions.
void Connection::State::open(const Shared& state) {
  const Options made = make_options(state->options);
  auto closure = std::make_unique<Shared>(state);
  natsOptions* const raw = made.get();
  const auto set = [](natsStatus status) { throw_unless(status, "libnats"); };
  set(natsOptions_SetRetryOnFailedConnect(raw, true, &State::on_up, closure.get()));
  set(natsOptions_SetReconnectedCB(raw, &State::on_up, closure.get()));
  set(natsOptions_SetDisconnectedCB(raw, &State::on_down, closure.get()));
  set(natsOptions_SetClosedCB(raw, &State::on_closed, closure.get()));
  set(natsOptions_SetErrorHandler(raw, &State::on_error, closure.get()));
  natsConnection* connection = nullptr;
  const natsStatus status = natsConnection_Connect(&connection, raw);
  if (status != NATS_OK && status != NATS_NOT_YET_CONNECTED) {
    throw_unless(status, "server '" + public_url(state->options.server) + "'");
  }
  const std::string refusal = status == NATS_OK ? "" : why_refused(state->options);
  void* const given = closure.release();
  std::vector<Wanted> wanted;
  {
    const std::lock_guard lock(state->mutex);
    state->handle.reset(connection, natsConnection_Destroy);
    state->refusal = refusal;
    wanted = state->wanted;
  }
  for (const Wanted& each : wanted) subscribe(state, each);
  if (status == NATS_OK) State::on_up(connection, given);
}

void Connection::State::subscribe(const Shared& state, const Wanted& wanted) {
  auto subscription = std::make_unique<Subscription>();
  subscription->state = state;
  subscription->handler = wanted.handler;
  const auto set = [&](natsStatus status) {
    throw_unless(status, "subscription to " + wanted.subject);
  };
  natsSubscription* made = nullptr;
  set(natsConnection_Subscribe(&made, state->current().get(), wanted.subject.c_str(),
                               &State::on_message, subscription.get()));
  set(natsSubscription_SetPendingLimits(made, -1, static_cast<int>(wanted.most_bytes)));
  {
    const std::lock_guard lock(state->mutex);
    ++state->dispatching;
  }
  set(natsSubscription_SetOnCompleteCB(made, &State::on_complete, subscription.get()));
  static_cast<void>(subscription.release());  // on_complete deletes it
  const std::lock_guard lock(state->mutex);
  state->subscriptions.push_back(made);
}

/// Forgets a handle that is closed. @return  False if something of the library's still runs, and
/// keeps what it needs.
bool Connection::State::forget_handle(std::unique_lock<std::mutex>& lock) {
  const bool quiet = changed.wait_for(lock, kEnd, [&] { return closed && dispatching == 0; });
  if (quiet) {
    for (natsSubscription* const each : subscriptions) natsSubscription_Destroy(each);
  } else if (handle != nullptr) {
    static_cast<void>(new std::shared_ptr<natsConnection>(handle));  // for good
    dispatching = 0;
  }
  subscriptions.clear();
  handle.reset();
  return quiet;
}

/// The library gives some connections up for good, such as one whose first handshake is cut off.
void Connection::State::keep_open(const std::stop_token& stop, const Shared& state) {
  name_thread("pirt-link");
  std::unique_lock lock(state->mutex);
  while (state->changed.wait(lock, stop, [&] { return state->closed; })) {
    state->changed.wait_for(lock, stop, kAgain, [] { return false; });
    if (stop.stop_requested()) return;
    lock.unlock();
    const std::lock_guard one_at_a_time(state->opening);
    lock.lock();
    static_cast<void>(state->forget_handle(lock));
    state->closed = false;
    lock.unlock();
    bool is_open = false;
    try {
      open(state);
      is_open = true;
    } catch (const std::exception& error) {
      if (state->events.problem) state->events.problem(error.what());
    }
    lock.lock();
    if (!is_open) state->closed = true;  // Once more.
  }
}

Connection::Connection(const ConnectionOptions& options, Events events)
    : state_(std::make_shared<State>()) {
  check_connection(options);
  state_->options = options;
  state_->events = std::move(events);
  natsInbox* inbox = nullptr;
  throw_unless(natsInbox_Create(&inbox), "libnats");
  state_->inbox = inbox;
  natsInbox_Destroy(inbox);
  // libnats takes its own prefix for that.
  state_->inbox = options.inbox + state_->inbox.substr(state_->inbox.find('.'));
  State::open(state_);
  keeper_ = start_thread(
      [state = state_](const std::stop_token& stop) { State::keep_open(stop, state); });
}

Connection::~Connection() {
  keeper_ = {};  // Asks it to stop, and waits.
  const auto handle = state_->current();
  if (handle == nullptr) return;
  natsConnection_Close(handle.get());
  std::unique_lock lock(state_->mutex);
  static_cast<void>(state_->forget_handle(lock));
}

bool Connection::wait_until_up(Nanos most) {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, most, [this] { return state_->up.load(); });
}

bool Connection::is_up() const { return state_->up; }

const std::string& Connection::inbox() const { return state_->inbox; }

std::string Connection::why_down() const {
  if (is_up()) return "";
  std::string said;
  {
    const std::lock_guard lock(state_->mutex);
    said = state_->refusal;
  }
  const auto says = [&](std::string_view what) {
    return std::ranges::search(said, what, [](char a, char b) {
             return std::tolower(static_cast<unsigned char>(a)) == b;
           }).begin() != said.end();
  };
  if (says("maximum connections")) {
    return "it has as many connections as it may have; raise max_connections there";
  }
  if (says("authorization") || says("authentication")) {
    return "it does not let this user in (" + said +
           "); check user and password, NKey or certificate";
  }
  return (said.empty() ? "" : said + "; ") + "start one (nats-server -js), or name another";
}

std::string Connection::why_no_chunks() const {
  return fmt::format("max_payload of the server is {} bytes; give it {} or more", most_payload(),
                     kLeastPayload);
}

void Connection::subscribe(const std::string& subject, Handler handler, std::int64_t most_bytes) {
  const std::lock_guard one_at_a_time(state_->opening);
  const State::Wanted wanted{subject, std::move(handler), most_bytes};
  {
    const std::lock_guard lock(state_->mutex);
    state_->wanted.push_back(wanted);
    if (state_->closed) return;  // With the next handle.
  }
  State::subscribe(state_, wanted);
}

bool Connection::publish(const std::string& subject, ByteView data, const std::string& reply) {
  const auto handle = state_->current();
  const auto size = static_cast<int>(std::min(data.size(), kMostMessage));
  if (handle == nullptr || data.size() > kMostMessage) return false;
  const auto* const bytes = reinterpret_cast<const char*>(data.data());
  return (reply.empty() ? natsConnection_Publish(handle.get(), subject.c_str(), bytes, size)
                        : natsConnection_PublishRequest(handle.get(), subject.c_str(),
                                                        reply.c_str(), bytes, size)) == NATS_OK;
}

Connection::Answer Connection::request(const std::string& subject, ByteView data, Nanos most) {
  const auto handle = state_->current();
  if (handle == nullptr || !is_up() || data.size() > kMostMessage) return {};
  natsMsg* answer = nullptr;
  const natsStatus status = natsConnection_Request(&answer, handle.get(), subject.c_str(),
                                                   reinterpret_cast<const char*>(data.data()),
                                                   static_cast<int>(data.size()), ms(most));
  if (status == NATS_NO_RESPONDERS) return {true, kNobody, {}};
  if (status != NATS_OK) return {};
  const MessagePtr came(answer);
  const ByteView bytes = data_of(answer);
  return {true, status_of(answer), Bytes(bytes.begin(), bytes.end())};
}

std::size_t Connection::most_payload() const {
  const auto handle = state_->current();
  const std::int64_t most = handle != nullptr ? natsConnection_GetMaxPayload(handle.get()) : 0;
  return most > 0 ? static_cast<std::size_t>(most) : kStandardPayload;
}

std::uint32_t Connection::chunk_bytes() const {
  const std::size_t most = most_payload();
  return most < kLeastPayload ? 0
                              : static_cast<std::uint32_t>(std::min(most - kHead, kLargestChunk));
}

std::string not_stored(const Connection::Answer& answer) {
  constexpr const char* kNoStreams = "the server has no JetStream; start it with -js";
  if (answer.status == kNobody) return kNoStreams;
  const auto json = try_parse_json(text_of(answer.data));
  if (!json || !json->is_object()) return "an answer that is none of JetStream's";
  if (!json->contains("error")) return json->contains("seq") ? "" : "an answer without a sequence";
  const Json& error = json->at("error");
  const bool told =
      error.is_object() && error.contains("description") && error.at("description").is_string();
  const std::string why = told ? error.at("description").get<std::string>() : "refused";
  if (why.find("not enabled") != std::string::npos) return why + "; " + kNoStreams;
  if (why.find("resources") != std::string::npos || why.find("maximum") != std::string::npos) {
    return why + "; give JetStream more room (max_file_store, the account's limits)";
  }
  return why;
}

}  // namespace pirt::cloud
