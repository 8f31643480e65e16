#include "workloads/backends/nats/nats_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "workloads/backends/nats/nats_settings.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/wire/own_sizes.h"
#include "workloads/base/error.h"
#include "workloads/base/text/yaml.h"
#include "workloads/model/remote.h"

namespace pirt {
namespace {

using namespace std::chrono_literals;

/// How long opening waits for a server and a worker.
constexpr Nanos kOpening = 3s;
constexpr Nanos kLook = 100ms;

Support support_of(const Workload& workload) {
  if (workload.state) return {false, "stateful workloads: unsupported in the cloud"};
  return {true, ""};
}

/// One call on its way; the link's threads tell it what becomes of it.
struct Flight {
  std::mutex mutex;
  std::condition_variable changed;
  bool unwanted = false;  ///< Nobody waits for its end.
  bool stored = false, arrived = false;
  bool large = false;  ///< Its outputs have to be read after that.
  Nanos execute{0};
  std::optional<cloud::TaskEnd> end;
};

/// Parameters that kernels have, once each: those of the same content share their bytes.
class SharedParameters {
 public:
  cloud::Parameters of(std::span<const Tensor> tensors, std::uint32_t chunk_bytes) {
    auto bytes = std::make_shared<const cloud::Bytes>(cloud::encode_tensors(tensors));
    const cloud::Digest digest = cloud::digest_of(*bytes);
    const std::lock_guard lock(mutex_);
    std::erase_if(known_, [](const auto& entry) { return entry.second.expired(); });
    auto& known = known_[digest];
    if (auto there = known.lock()) {
      bytes = std::move(there);
    } else {
      known = bytes;
    }
    return {.blob = {digest, bytes->size(), chunk_bytes}, .bytes = std::move(bytes)};
  }

 private:
  std::mutex mutex_;
  std::map<cloud::Digest, std::weak_ptr<const cloud::Bytes>> known_;
};

class CloudKernel : public Kernel {
 public:
  CloudKernel(cloud::RobotLink& link, const Workload& workload,
              std::optional<cloud::Parameters> parameters, Nanos patience)
      : link_(link), workload_(workload), patience_(patience), parameters_(std::move(parameters)) {
    cloud::Kind kind = cloud::kind_of(workload);
    body_.workload = std::move(kind.name);
    body_.sizes = std::move(kind.sizes);
    body_.spec = cloud::spec_digest(workload);
    if (parameters_) body_.parameters = parameters_->blob;
  }
  ~CloudKernel() override { withdraw(); }

  /// From any thread: whoever waits for the call that is bound does so no longer.
  void give_up() {
    const std::lock_guard lock(mutex_);
    unwanted_ = true;
    if (flight_ == nullptr) return;
    const std::lock_guard flight_lock(flight_->mutex);
    flight_->unwanted = true;
    flight_->changed.notify_all();
  }

  /// Of the call that is bound.
  void expires_in(Nanos time_left) { expires_at_ = clock_.now() + time_left; }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    {
      const std::lock_guard lock(mutex_);
      unwanted_ = false;
    }
    expires_at_.reset();
    inputs_ = inputs;
    outputs_ = outputs;
  }

  void unbind() override {
    withdraw();
    inputs_ = {};
    outputs_ = {};
  }

  /// Until the server has the task.
  void upload() override {
    withdraw();
    const cloud::Bytes tensors = cloud::encode_tensors(inputs_);
    body_.tensors = tensors;
    bytes_ = std::make_shared<const cloud::Bytes>(encode(body_));
    body_.tensors = {};
    submit();
    wait([](const Flight& flight) { return flight.stored || flight.arrived; });
  }

  /// Until the reply comes; what the worker did not compute is the queue.
  std::optional<Nanos> execute(int repeats) override {
    Nanos queue{0};
    for (int i = 0; i < repeats; ++i) {
      if (flight_ == nullptr) submit();
      const Nanos begin = clock_.now();
      wait([](const Flight& flight) { return flight.arrived && flight.large; });
      const Nanos waited = clock_.now() - begin;
      queue += std::max(Nanos::zero(), waited - flight_->execute);
      if (!flight_->large || i + 1 < repeats) finish();
    }
    return queue;
  }

  /// Reads what did not come with the reply.
  void download() override {
    if (flight_ != nullptr) finish();
    const std::string problem = cloud::decode_tensors_into(last_.outputs, outputs_);
    if (!problem.empty()) {
      throw_environment(fmt::format("worker {} replied to {} with something else: {}", last_.worker,
                                    workload_.name, problem));
    }
  }

 private:
  void submit() {
    {
      const std::lock_guard lock(mutex_);
      flight_ = std::make_shared<Flight>();
      flight_->unwanted = unwanted_;
    }
    cloud::Submission submission{.body = bytes_, .parameters = parameters_};
    if (expires_at_) submission.time_left = *expires_at_ - clock_.now();
    submission.stored = [flight = flight_] {
      const std::lock_guard lock(flight->mutex);
      flight->stored = true;
      flight->changed.notify_all();
    };
    submission.arrived = [flight = flight_](const cloud::ReplyMessage& reply) {
      if (reply.kind != cloud::ReplyKind::kDone) return;
      const std::lock_guard lock(flight->mutex);
      flight->arrived = true;
      flight->execute = reply.execute;
      flight->large = std::holds_alternative<cloud::Blob>(reply.outputs);
      flight->changed.notify_all();
    };
    submission.ended = [flight = flight_](cloud::TaskEnd end) {
      const std::lock_guard lock(flight->mutex);
      flight->end = std::move(end);
      flight->changed.notify_all();
    };
    task_ = link_.submit(std::move(submission));
  }

  /// @throws Error{kEnvironment} once the task has ended without a result, or neither server nor
  /// worker was there for too long.
  template <typename Until>
  void wait(Until until) {
    Nanos lost{0};
    std::unique_lock lock(flight_->mutex);
    while (!until(*flight_) && !flight_->end) {
      if (flight_->unwanted) {
        lock.unlock();
        withdraw();
        throw_environment(workload_.name + " was withdrawn");
      }
      if (flight_->changed.wait_for(lock, kLook) == std::cv_status::no_timeout) continue;
      if (link_.availability() != cloud::Availability::kDown) {
        lost = Nanos::zero();
        continue;
      }
      if (lost == Nanos::zero()) lost = clock_.now();
      if (clock_.now() - lost < patience_) continue;
      lock.unlock();
      const std::string why = link_.why_down();
      withdraw();
      throw_environment(workload_.name + " was not answered: " + why);
    }
    if (!flight_->end || flight_->end->how == cloud::CallEndKind::kDone) return;
    const std::string problem = flight_->end->problem;
    lock.unlock();
    forget_flight();
    throw_environment(problem);
  }

  void finish() {
    wait([](const Flight&) { return false; });
    last_ = *std::move(flight_->end);
    forget_flight();
  }

  void withdraw() {
    if (flight_ == nullptr) return;
    link_.cancel(task_);
    forget_flight();
  }

  void forget_flight() {
    const std::lock_guard lock(mutex_);
    flight_.reset();
  }

  cloud::RobotLink& link_;
  const Workload& workload_;
  Nanos patience_;
  MachineClock clock_;
  cloud::TaskBody body_;
  std::optional<cloud::Parameters> parameters_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::optional<Nanos> expires_at_;
  std::shared_ptr<const cloud::Bytes> bytes_;
  cloud::TaskId task_;
  cloud::TaskEnd last_;
  std::mutex mutex_;                ///< Of what other threads look at: they read flight_ alone.
  std::shared_ptr<Flight> flight_;  ///< Changed by the thread that uses the kernel.
  bool unwanted_ = false;           ///< What is bound.
};

DeviceInfo device_info(const std::string& server) {
  return {.name = "workers at " + server,
          .platform = "NATS JetStream",
          .version = "protocol " + std::to_string(cloud::kProtocol)};
}

struct CloudUnit {
  cloud::RobotOptions options;
  Nanos patience{0};
};

CloudUnit read_request(const UnitRequest& request) {
  CloudUnit unit;
  const auto specs = nats_options();
  unit.options.outbox_bytes =
      static_cast<std::uint64_t>(std::llround(1e6 * request.option(specs[0])));
  unit.patience = from_s(request.option(specs[1]));
  if (request.script.empty()) return unit;
  const YamlNode settings = parse_yaml("unit " + request.unit, request.script);
  settings.check_keys(nats_settings());
  cloud::ConnectionOptions& connection = unit.options.connection;
  const auto text = [&](const char* key, std::string& to) {
    if (settings.has(key)) to = settings.at(key).text();
  };
  text("server", connection.server);
  text("robot", unit.options.robot);
  text("ca", connection.ca);
  text("certificate", connection.certificate);
  text("key", connection.key);
  text("nkey", connection.nkey);
  text("nkey_seed", connection.nkey_seed);
  if (settings.has("insecure")) connection.insecure = settings.at("insecure").boolean();
  std::string outbox;
  text("outbox", outbox);
  unit.options.outbox = outbox;
  return unit;
}

class CloudDevice : public Device, public Remote {
 public:
  explicit CloudDevice(const CloudUnit& unit)
      : server_(cloud::public_url(unit.options.connection.server)),
        patience_(unit.patience),
        link_(unit.options) {
    // Who is not there yet may come.
    static_cast<void>(link_.wait_until_up(kOpening));
  }

  [[nodiscard]] DeviceInfo info() const override {
    DeviceInfo info = device_info(server_);
    info.remark = link_.why_down();
    return info;
  }
  [[nodiscard]] bool is_reachable() const override {
    return link_.availability() == cloud::Availability::kUp;
  }
  [[nodiscard]] LinkEstimate link() const override { return link_.estimate(); }
  [[nodiscard]] std::uint64_t heard() const override { return link_.heard(); }
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
    constexpr std::uint32_t kChunk = 256 << 10;  // a part of any server's limit
    std::optional<cloud::Parameters> given;
    if (!parameters.empty()) given = parameters_.of(parameters, kChunk);
    return std::make_unique<CloudKernel>(link_, workload, std::move(given), patience_);
  }

  std::string server_;
  Nanos patience_;
  SharedParameters parameters_;
  cloud::RobotLink link_;
};

class NatsBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "nats"; }
  [[nodiscard]] std::string_view description() const override {
    return "the cloud: workers elsewhere (pirt cloud-worker), over NATS JetStream";
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
    const CloudUnit unit = read_request(request);
    return std::make_unique<CloudDevice>(unit);
  }
};

}  // namespace

std::unique_ptr<const Backend> make_nats_backend() { return std::make_unique<NatsBackend>(); }

}  // namespace pirt
