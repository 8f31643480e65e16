#include "workloads/backends/nats/nats_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/nats_settings.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/base/error.h"
#include "workloads/base/text/yaml.h"
#include "workloads/model/remote.h"

namespace pirt::cloud {
namespace {

using namespace std::chrono_literals;

/// How long opening waits for a server and a worker.
constexpr Nanos kOpening = 3s;
constexpr Nanos kLook = 100ms;

Support support_of(const Workload& workload) {
  if (workload.state) return {false, "stateful workloads: unsupported in the cloud"};
  return {true, ""};
}

/// A kernel's call on its way; the link's threads tell what becomes of it.
struct Flight {
  std::mutex mutex;
  std::condition_variable changed;
  std::atomic<bool> unwanted = false;  ///< Nobody waits for the end of the call that is bound.
  std::optional<TaskId> task = {};     ///< Changed by the thread that uses the kernel.
  bool taken = false, missing = false;
  std::optional<ReplyMessage> end = {};

  void begin(std::optional<TaskId> next) {
    const std::lock_guard lock(mutex);
    task = next;
    taken = missing = false;
    end.reset();
  }
  /// What is said of a task that it has no more changes nothing.
  template <typename Change>
  void tell(const TaskId& of, Change change) {
    const std::lock_guard lock(mutex);
    if (task != of) return;
    change(*this);
    changed.notify_all();
  }
};

/// As they travel. Kernels with the same content share the bytes.
struct Parameters {
  std::shared_ptr<const Bytes> bytes = {};
  Digest digest = {};
};

class CloudKernel : public Kernel {
 public:
  CloudKernel(RobotLink& link, const Workload& workload, Parameters parameters, Nanos patience)
      : link_(link),
        workload_(workload),
        patience_(patience),
        parameters_(std::move(parameters)),
        most_bytes_(encoded_bytes(workload.outputs)) {
    Kind kind = kind_of(workload);
    call_.task.workload = std::move(kind.name);
    call_.task.sizes = std::move(kind.sizes);
    call_.task.spec = spec_digest(workload);
    call_.known_by = kind.known_by;
  }
  ~CloudKernel() override { withdraw(); }

  /// From any thread: whoever waits for the call that is bound does so no longer.
  void give_up() {
    const std::lock_guard lock(flight_->mutex);
    flight_->unwanted = true;
    flight_->changed.notify_all();
  }

  /// Of the call that is bound.
  void expires_in(Nanos time_left) { expires_at_ = clock_.now() + time_left; }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    flight_->unwanted = false;
    expires_at_.reset();
    inputs_ = inputs;
    outputs_ = outputs;
  }

  void unbind() override {
    withdraw();
    inputs_ = {};
    outputs_ = {};
  }

  /// Until a worker has the task.
  void upload() override {
    withdraw();
    sent_ = encode_tensors(inputs_);
    submit();
    wait([](const Flight& flight) { return flight.taken; });
  }

  /// Until the reply comes; what the worker did not compute is the queue.
  std::optional<Nanos> execute(int repeats) override {
    Nanos queue{0};
    for (int i = 0; i < repeats; ++i) {
      if (!flight_->task) submit();
      const Nanos begin = clock_.now();
      wait([](const Flight&) { return false; });
      last_ = *std::move(flight_->end);
      queue += std::max(Nanos::zero(), clock_.now() - begin - last_.execute);
      flight_->begin({});
      if (i + 1 < repeats) remove_blobs();
    }
    return queue;
  }

  /// Reads what did not come with the reply.
  void download() override {
    const auto refuse = [&](const std::string& why) {
      throw_environment(fmt::format("worker {} replied to {} with something else: {}", last_.worker,
                                    workload_.name, why));
    };
    if (const auto blob = last_.outputs.blob) {
      if (blob->size_bytes > most_bytes_) refuse(fmt::format("{} bytes", blob->size_bytes));
      auto answer = fetch_blob(
          link_.connection(), outputs_at(), *blob, [this] { return flight_->unwanted.load(); },
          patience_);
      if (!answer.came && !link_.is_up()) {
        throw_environment("the outputs of " + workload_.name +
                          " were not read: " + link_.why_down());
      }
      if (!answer.came || answer.status != 0) refuse("its outputs are not on the server");
      remove_blobs();
      last_.outputs.bytes = std::move(answer.data);
    }
    const std::string problem = decode_tensors_into(last_.outputs.bytes, outputs_);
    if (!problem.empty()) refuse(problem);
  }

 private:
  [[nodiscard]] std::string blob_at(std::string_view what, const std::string& name) const {
    return blob_subject(link_.robot(), what, name);
  }
  [[nodiscard]] std::string inputs_at() const { return blob_at("in", task_.hex()); }
  [[nodiscard]] std::string outputs_at() const {
    return blob_at("out", fmt::format("{}-{}", task_.hex(), last_.send));
  }
  /// Nothing that is still to be sent helps.
  [[nodiscard]] bool is_over() {
    const std::lock_guard lock(flight_->mutex);
    return flight_->unwanted || flight_->end;
  }

  /// What is larger than a message first: who finds the task finds all of it.
  void submit() {
    task_ = link_.next_task();
    missed_ = 0;
    const auto most_inline = link_.connection().chunk_bytes();
    const auto chunk = link_.connection().blob_chunk_bytes();
    const std::uint64_t weights = parameters_.bytes == nullptr ? 0 : parameters_.bytes->size();
    const bool is_large = sent_.size() > most_inline;
    // What a worker answers lies on the stream when what was asked does no more.
    const std::uint64_t moved = std::max<std::uint64_t>(
        is_large ? sent_.size() : 0, most_bytes_ > most_inline ? most_bytes_ : 0);
    const std::string problem = link_.why_too_large(workload_.name, weights + moved);
    if (!problem.empty()) throw_environment(problem);
    if (weights > 0) call_.task.parameters = Blob{parameters_.digest, weights, chunk};
    if (is_large) {
      call_.task.inputs = {{}, Blob{digest_of(sent_), sent_.size(), chunk}};
      put_inputs();
    } else {
      call_.task.inputs = {sent_, {}};
    }
    flight_->begin(task_);
    call_.task.time_left.reset();
    if (expires_at_) call_.task.time_left = std::max(*expires_at_ - clock_.now(), Nanos::zero());
    const auto tell = [flight = flight_, task = task_](auto change) { flight->tell(task, change); };
    call_.taken = [tell] { tell([](Flight& of) { of.taken = true; }); };
    call_.missing = [tell] { tell([](Flight& of) { of.missing = true; }); };
    call_.ended = [tell](ReplyMessage end) { tell([&](Flight& of) { of.end = std::move(end); }); };
    link_.submit(task_, call_);
  }

  void put_inputs() { put(inputs_at(), *call_.task.inputs.blob, sent_); }
  void put(const std::string& at, const Blob& blob, ByteView bytes) {
    const Nanos begin = clock_.now();
    const std::string problem = put_blob(
        link_.connection(), at, blob, bytes, [this] { return is_over(); }, patience_);
    if (is_over() && !flight_->unwanted) return;  // Another worker has answered meanwhile.
    if (!problem.empty()) throw_environment(workload_.name + " was not sent: " + problem);
    link_.measure(clock_.now() - begin, bytes.size());
  }

  /// A worker did not find something: parameters, if it is the first or they were there too long
  /// ago; else what was sent.
  void put_what_is_missing() {
    if (parameters_.bytes != nullptr && missed_++ % 2 == 0) {
      put(blob_at("par", parameters_.digest.hex()), *call_.task.parameters, *parameters_.bytes);
    } else if (call_.task.inputs.blob) {
      put_inputs();
    }
    link_.ready(task_);
  }

  /// @throws Error{kEnvironment} once the task has ended without a result, or neither server nor
  /// worker was there for too long.
  template <typename Until>
  void wait(Until until) {
    Nanos lost{0};
    const auto end = [this](const std::string& why) {
      withdraw();
      throw_environment(workload_.name + why);
    };
    std::unique_lock lock(flight_->mutex);
    while (!until(*flight_) && !flight_->end) {
      const bool unwanted = flight_->unwanted, missing = std::exchange(flight_->missing, false);
      if (!unwanted && !missing &&
          flight_->changed.wait_for(lock, kLook) == std::cv_status::no_timeout) {
        continue;
      }
      lock.unlock();
      if (unwanted) end(" was withdrawn");
      if (missing) put_what_is_missing();
      if (link_.is_up()) {
        lost = Nanos::zero();
      } else if (lost == Nanos::zero()) {
        lost = clock_.now();
      } else if (clock_.now() - lost >= patience_) {
        end(" was not answered: " + link_.why_down());
      }
      lock.lock();
    }
    if (!flight_->end || flight_->end->problem.empty()) return;
    const std::string problem = flight_->end->problem;
    lock.unlock();
    withdraw();
    throw_environment(problem);
  }

  void withdraw() {
    if (flight_->task) link_.cancel(task_);
    flight_->begin({});
    remove_blobs();
  }

  void remove_blobs() {
    if (std::exchange(call_.task.inputs.blob, {})) remove_blob(link_.connection(), inputs_at());
    if (std::exchange(last_.outputs.blob, {})) remove_blob(link_.connection(), outputs_at());
  }

  RobotLink& link_;
  const Workload& workload_;
  Nanos patience_;
  MachineClock clock_;
  Parameters parameters_;
  std::uint64_t most_bytes_;  ///< Of outputs.
  Submission call_;           ///< As it is submitted.
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::optional<Nanos> expires_at_;
  Bytes sent_;
  int missed_ = 0;
  TaskId task_;
  ReplyMessage last_;  ///< To the call before.
  const std::shared_ptr<Flight> flight_ = std::make_shared<Flight>();
};

DeviceInfo device_info(const std::string& server) {
  return {.name = "workers at " + server,
          .platform = "NATS",
          .version = "protocol " + std::to_string(kProtocol)};
}

/// "p95", or "20ms".
void read_hedge(const YamlNode& node, CallerLimits& limits) {
  const std::string text = node.text();
  limits.hedge_p95 = text == "p95";
  if (text.ends_with("ms")) {
    limits.hedge_after =
        milliseconds(std::string_view(text).substr(0, text.size() - 2), kNanosecondMs, 1e7).value;
  }
  if (!limits.hedge_p95 && !limits.hedge_after) {
    node.fail("a second worker is asked after p95, or after a time such as 20ms");
  }
}

RobotOptions read_request(const UnitRequest& request) {
  RobotOptions options;
  if (request.script.empty()) return options;
  const YamlNode settings = parse_yaml("unit " + request.unit, request.script);
  settings.check_keys(nats_settings());
  ConnectionOptions& connection = options.connection;
  const auto text = [&](const char* key, std::string& to) {
    if (settings.has(key)) to = settings.at(key).text();
  };
  text("server", connection.server);
  text("robot", options.robot);
  text("ca", connection.ca);
  text("certificate", connection.certificate);
  text("key", connection.key);
  text("nkey", connection.nkey);
  text("nkey_seed", connection.nkey_seed);
  if (settings.has("insecure")) connection.insecure = settings.at("insecure").boolean();
  if (settings.has("hedge")) read_hedge(settings.at("hedge"), options.limits);
  return options;
}

class CloudDevice : public Device, public Remote {
 public:
  CloudDevice(const RobotOptions& options, Nanos patience)
      : server_(public_url(options.connection.server)), patience_(patience), link_(options) {
    // Who is not there yet may come.
    static_cast<void>(link_.wait_until_up(kOpening));
  }

  [[nodiscard]] DeviceInfo info() const override {
    DeviceInfo info = device_info(server_);
    info.remark = link_.why_down();
    return info;
  }
  [[nodiscard]] bool is_reachable() const override { return link_.is_up(); }
  [[nodiscard]] LinkEstimate link() const override { return link_.estimate(); }
  [[nodiscard]] std::uint64_t heard() const override { return link_.counts().others; }
  [[nodiscard]] Nanos patience() const override { return patience_; }
  void expires_in(Kernel& kernel, Nanos time_left) override {
    dynamic_cast<CloudKernel&>(kernel).expires_in(time_left);
  }
  void withdraw(Kernel& kernel) override { dynamic_cast<CloudKernel&>(kernel).give_up(); }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    const Support support = support_of(workload);
    if (!support.ok) return support;
    const std::string why = link_.why_not(workload);
    return {why.empty(), why};
  }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    if (!link_.wait_until_up(std::min(kOpening, patience_))) throw_environment(link_.why_down());
    return std::make_unique<CloudKernel>(link_, workload, shared(parameters), patience_);
  }
  Parameters shared(std::span<const Tensor> tensors) {
    if (tensors.empty()) return {};
    auto bytes = std::make_shared<const Bytes>(encode_tensors(tensors));
    const Digest digest = digest_of(*bytes);
    const std::lock_guard lock(mutex_);
    std::erase_if(parameters_, [](const auto& each) { return each.second.expired(); });
    auto& known = parameters_[digest];
    if (known.expired()) known = bytes;
    return {known.lock(), digest};
  }

  std::string server_;
  Nanos patience_;
  std::mutex mutex_;
  std::map<Digest, std::weak_ptr<const Bytes>> parameters_;  ///< That kernels have.
  RobotLink link_;
};

class NatsBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "nats"; }
  [[nodiscard]] std::string_view description() const override {
    return "the cloud: workers elsewhere (pirt cloud-worker), over NATS";
  }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override {
    return {true, "", {device_info("the unit's server")}};
  }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(workload);
  }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    return std::make_unique<CloudDevice>(read_request(request),
                                         from_s(request.option(nats_options()[0])));
  }
};

}  // namespace
}  // namespace pirt::cloud

namespace pirt {

std::unique_ptr<const Backend> make_nats_backend() {
  return std::make_unique<cloud::NatsBackend>();
}

}  // namespace pirt
