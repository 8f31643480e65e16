#include "workloads/backends/nats/link/connection.h"

#include <fmt/core.h>
#include <nats/nats.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <filesystem>
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
  std::shared_ptr<natsConnection> handle;               ///< Null before the first one is there.
  std::vector<std::pair<std::string, Handler>> wanted;  ///< What is subscribed to,
  std::vector<natsSubscription*> subscriptions;         ///< and how, over the handle.
  bool closed = false;                                  ///< The handle, by us or by the library.
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
    const char* last = nullptr;
    std::string text = natsStatus_GetText(status);
    if (natsConnection_GetLastError(connection, &last) != NATS_OK && last != nullptr &&
        *last != 0) {
      text += ": " + std::string(last);
    }
    state.events.problem(text);
  }
  static void on_message(natsConnection*, natsSubscription*, natsMsg* raw, void* closure) {
    const MessagePtr message(raw);
    const auto& subscription = *static_cast<Subscription*>(closure);
    const char* const reply = natsMsg_GetReply(raw);
    subscription.handler(
        {natsMsg_GetSubject(raw), reply == nullptr ? "" : reply, data_of(raw), status_of(raw)});
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
  static void subscribe(const Shared& state, const std::string& subject, const Handler& handler);
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
  void* const given = closure.release();
  std::vector<std::pair<std::string, Handler>> wanted;
  {
    const std::lock_guard lock(state->mutex);
    state->handle.reset(connection, natsConnection_Destroy);
    wanted = state->wanted;
  }
  for (const auto& [subject, handler] : wanted) subscribe(state, subject, handler);
  if (status == NATS_OK) State::on_up(connection, given);
}

void Connection::State::subscribe(const Shared& state, const std::string& subject,
                                  const Handler& handler) {
  auto subscription = std::make_unique<Subscription>();
  subscription->state = state;
  subscription->handler = handler;
  natsSubscription* made = nullptr;
  throw_unless(natsConnection_Subscribe(&made, state->current().get(), subject.c_str(),
                                        &State::on_message, subscription.get()),
               "subscription to " + subject);
  throw_unless(natsSubscription_SetPendingLimits(made, -1, -1), "subscription to " + subject);
  {
    const std::lock_guard lock(state->mutex);
    ++state->dispatching;
  }
  throw_unless(natsSubscription_SetOnCompleteCB(made, &State::on_complete, subscription.get()),
               "subscription to " + subject);
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

void Connection::subscribe(const std::string& subject, Handler handler) {
  const std::lock_guard one_at_a_time(state_->opening);
  {
    const std::lock_guard lock(state_->mutex);
    state_->wanted.emplace_back(subject, handler);
    if (state_->closed) return;  // With the next handle.
  }
  State::subscribe(state_, subject, handler);
}

bool Connection::publish(const std::string& subject, ByteView data, const std::string& reply,
                         const std::string& id) {
  natsMsg* raw = nullptr;
  if (natsMsg_Create(&raw, subject.c_str(), reply.empty() ? nullptr : reply.c_str(),
                     reinterpret_cast<const char*>(data.data()),
                     static_cast<int>(data.size())) != NATS_OK) {
    return false;
  }
  const MessagePtr message(raw);
  if (!id.empty() && natsMsgHeader_Set(raw, "Nats-Msg-Id", id.c_str()) != NATS_OK) return false;
  const auto handle = state_->current();
  return handle != nullptr && natsConnection_PublishMsg(handle.get(), raw) == NATS_OK;
}

bool Connection::publish(const std::string& subject, std::string_view text,
                         const std::string& reply) {
  return publish(subject, std::as_bytes(std::span(text)), reply, "");
}

Connection::Answer Connection::request(const std::string& subject, ByteView data, Nanos most,
                                       const std::string& id) {
  natsMsg* raw = nullptr;
  if (!is_up() ||
      natsMsg_Create(&raw, subject.c_str(), nullptr, reinterpret_cast<const char*>(data.data()),
                     static_cast<int>(data.size())) != NATS_OK) {
    return {};
  }
  const MessagePtr message(raw);
  if (!id.empty() && natsMsgHeader_Set(raw, "Nats-Msg-Id", id.c_str()) != NATS_OK) return {};
  const auto handle = state_->current();
  if (handle == nullptr) return {};
  natsMsg* answer = nullptr;
  const natsStatus status = natsConnection_RequestMsg(&answer, handle.get(), raw, ms(most));
  if (status == NATS_NO_RESPONDERS) return {true, kNobody, {}};
  if (status != NATS_OK) return {};
  const MessagePtr came(answer);
  const ByteView bytes = data_of(answer);
  return {true, status_of(answer), Bytes(bytes.begin(), bytes.end())};
}

Connection::Answer Connection::request(const std::string& subject, std::string_view text,
                                       Nanos most) {
  return request(subject, std::as_bytes(std::span(text)), most, "");
}

std::size_t Connection::most_payload() const {
  const auto handle = state_->current();
  const std::int64_t most = handle != nullptr ? natsConnection_GetMaxPayload(handle.get()) : 0;
  return most > 0 ? static_cast<std::size_t>(most) : kStandardPayload;
}

std::size_t Connection::chunk_bytes() const {
  const std::size_t most = most_payload();
  const std::size_t fits = most > 2 * kHead ? most - kHead : most / 2;
  return std::clamp(fits, std::size_t{kLeastChunkBytes}, kLargestChunk);
}

Stored read_stored(int status, ByteView data) {
  if (status == kNobody) return {.problem = "JetStream is not there; start the server with -js"};
  const auto answer = try_parse_json(text_of(data));
  if (!answer || !answer->is_object()) {
    return {.problem = "an answer that is none of JetStream's"};
  }
  if (answer->contains("error")) {
    const Json& error = answer->at("error");
    const bool told =
        error.is_object() && error.contains("description") && error.at("description").is_string();
    return {.problem = told ? error.at("description").get<std::string>() : "refused"};
  }
  if (!answer->contains("seq") || !answer->at("seq").is_number_unsigned()) {
    return {.problem = "an answer without a sequence"};
  }
  const bool duplicate = answer->contains("duplicate") && answer->at("duplicate") == true;
  return {.ok = true, .sequence = answer->at("seq").get<std::uint64_t>(), .duplicate = duplicate};
}

}  // namespace pirt::cloud
