#include "workloads/backends/nats/nats_backend.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "workloads/backends/nats/link/stream.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/base/error.h"
#include "workloads/base/text/yaml.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/remote.h"

namespace pirt::cloud {
namespace {

using namespace std::chrono_literals;

constexpr Nanos kOpening = 3s;  ///< How long opening waits for a server and a worker.
constexpr Nanos kLook = 100ms;

Support support_of(const Workload& workload) {
  if (workload.state) return {false, "stateful workloads: unsupported in the cloud"};
  return {true, ""};
}

class CloudKernel : public Kernel {
 public:
  CloudKernel(RobotLink& link, const Workload& workload, std::span<const Tensor> parameters,
              Nanos patience)
      : link_(link),
        workload_(workload),
        patience_(patience),
        most_bytes_(encoded_bytes(workload.outputs)) {
    task_.kind = kind_of(workload);
    task_.spec = spec_digest(workload);
    if (parameters.empty()) return;
    for (const Tensor& each : parameters) parameters_.push_back(each.share());
    const Bytes bytes = encode_tensors(parameters_);
    task_.parameters = Blob{digest_of(bytes), bytes.size(), 0};
  }
  ~CloudKernel() override { withdraw(); }

  /// From any thread: whoever waits for the call that is bound does so no longer.
  void give_up() {
    unwanted_ = true;
    link_.step([](Caller&, Nanos) {});  // Whoever waits looks again.
  }

  /// Of the call that is bound.
  void expires_in(Nanos time_left) { expires_at_ = later_by(clock_.now(), time_left); }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    unwanted_ = false;
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
    wait(false);
  }

  /// Until the reply comes; what the worker did not compute is the queue.
  std::optional<Nanos> execute(int repeats) override {
    Nanos queue{0};
    for (int i = 0; i < repeats; ++i) {
      if (!progress_) submit();
      const Nanos begin = clock_.now();
      wait(true);
      last_ = *std::move(progress_->end);
      queue += std::max(Nanos::zero(), clock_.now() - begin - last_.execute);
      progress_.reset();
      if (!last_.outputs.blob) remove_blobs();
    }
    return queue;
  }

  /// Reads what did not come with the reply.
  void download() override {
    const auto refuse = [&](const std::string& why) {
      throw_environment(fmt::format("the outputs of {} on worker {} cannot be read: {}",
                                    workload_.name, last_.worker, why));
    };
    if (const auto blob = last_.outputs.blob) {
      if (blob->size_bytes > most_bytes_) refuse(fmt::format("{} bytes", blob->size_bytes));
      auto answer = fetch_blob(
          link_.connection(), outputs_at(), *blob, [this] { return unwanted_.load(); }, patience_);
      if (!answer.came && !link_.is_up()) refuse(link_.why_down());
      if (!answer.came || answer.status != 0) refuse("they are no longer on the server");
      remove_blobs();
      last_.outputs.bytes = std::move(answer.data);
    }
    try {
      decode_tensors_into(last_.outputs.bytes, outputs_);
    } catch (const Error& error) {
      refuse(error.what());
    }
  }

 private:
  [[nodiscard]] std::string blob_at(std::string_view what, const std::string& name) const {
    return blob_subject(link_.robot(), what, name);
  }
  [[nodiscard]] std::string inputs_at() const { return blob_at("in", task_.task.hex()); }
  [[nodiscard]] std::string outputs_at() const {
    return blob_at("out", fmt::format("{}-{}", task_.task.hex(), last_.send));
  }
  /// What is larger than a message first: who finds the task finds all of it.
  void submit() {
    remove_blobs();
    task_.task = link_.next_task();
    const auto most_inline = link_.connection().chunk_bytes();
    const auto chunk = link_.connection().blob_chunk_bytes();
    auto& parameters = task_.parameters;
    const std::uint64_t weights = parameters ? parameters->size_bytes : 0;
    const std::uint64_t in = sent_.size() > most_inline ? sent_.size() : 0;
    const std::uint64_t out = most_bytes_ > most_inline ? most_bytes_ : 0;
    // What a worker answers lies on the stream when what was asked does no more.
    std::string problem = link_.why_too_large(workload_.name, weights + std::max(in, out));
    const std::uint64_t room = in + out + (missed_ > 0 ? weights : 0);
    const auto has_room = [&] { return unwanted_ || link_.take_room(room, room_); };
    for (bool up = true; problem.empty() && !link_.wait(up ? kLook : patience_, has_room);) {
      if (!std::exchange(up, link_.is_up()) && !up) problem = link_.why_down();
    }
    if (!problem.empty()) throw_environment(problem);
    if (!unwanted_) missed_ = 0;
    if (parameters) parameters->chunk_bytes = chunk;
    task_.inputs =
        in == 0 ? Payload{sent_, {}} : Payload{{}, Blob{digest_of(sent_), sent_.size(), chunk}};
    if (in > 0) put_inputs();
    task_.time_left.reset();
    if (expires_at_) task_.time_left = std::max(*expires_at_ - clock_.now(), Nanos::zero());
    link_.step([&](Caller& caller, Nanos now) { progress_ = caller.submit(task_, now); });
  }

  void put_inputs() { put(inputs_at(), *task_.inputs.blob, sent_); }
  void put(const std::string& at, const Blob& blob, ByteView bytes) {
    const Nanos begin = clock_.now();
    const auto has_ended = [this] { return unwanted_ || (progress_ && progress_->end); };
    // Then nothing that is still to be sent helps.
    const auto is_over = [&] { return link_.wait(Nanos::zero(), has_ended); };
    const std::string problem = put_blob(link_.connection(), at, blob, bytes, is_over, patience_);
    if (is_over() && !unwanted_) return;  // Another worker has answered meanwhile.
    if (!problem.empty()) {
      link_.look_for_stream();
      throw_environment(workload_.name + " was not sent: " + problem);
    }
    link_.step([&](Caller& caller, Nanos now) { caller.measure(now - begin, bytes.size()); });
  }

  /// A worker did not find something: parameters, if it is the first or they were there too long
  /// ago; else what was sent.
  void put_what_is_missing() {
    if (const auto& blob = task_.parameters; blob && missed_++ % 2 == 0) {
      put(blob_at("par", blob->digest.hex()), *blob, encode_tensors(parameters_));
    } else if (task_.inputs.blob) {
      put_inputs();
    }
    link_.step([&](Caller& caller, Nanos now) { caller.ready(task_.task, now); });
  }

  /// @throws CallFailed, and Error{kEnvironment} once the task has ended without a result, or
  /// neither server nor worker was there for too long.
  void wait(bool for_its_end) {
    bool failed = false;
    const auto end = [&](const std::string& why) {
      withdraw();
      if (failed) throw CallFailed(why);
      throw_environment(why);
    };
    std::optional<Nanos> lost;
    std::string problem;
    while (true) {
      bool over = false, missing = false;
      link_.wait(kLook, [&] {
        const auto& how = progress_->end;
        if (how) problem = how->problem, failed = how->kind == ReplyKind::kCallFailed;
        over = how || (progress_->taken && !for_its_end);
        missing = !over && std::exchange(progress_->missing, false);
        return over || missing || unwanted_;
      });
      if (over) break;
      if (unwanted_) end(workload_.name + " was withdrawn");
      if (missing) put_what_is_missing();
      if (link_.is_up()) {
        lost.reset();
      } else if (!lost) {
        lost = clock_.now();
      } else if (clock_.now() - *lost >= patience_) {
        end(workload_.name + " was not answered: " + link_.why_down());
      }
    }
    if (!problem.empty()) end(problem);
  }

  void withdraw() {
    if (std::exchange(progress_, nullptr)) {
      link_.step([&](Caller& caller, Nanos) { caller.cancel(task_.task); });
    }
    remove_blobs();
  }

  void remove_blobs() {
    if (std::exchange(task_.inputs.blob, {})) remove_blob(link_.connection(), inputs_at());
    if (std::exchange(last_.outputs.blob, {})) remove_blob(link_.connection(), outputs_at());
    if (room_ > 0) link_.give_room(std::exchange(room_, 0));
  }

  RobotLink& link_;
  const Workload& workload_;
  Nanos patience_;
  MachineClock clock_;
  std::vector<Tensor> parameters_;
  std::uint64_t most_bytes_;            ///< Of outputs.
  std::uint64_t room_ = 0;              ///< That the call has on the robot's stream.
  TaskMessage task_ = {};               ///< As it is submitted,
  std::shared_ptr<Progress> progress_;  ///< and while it is.
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::optional<Nanos> expires_at_;
  Bytes sent_;
  int missed_ = 1;                      ///< Parameters, of the last call; at first they may be.
  ReplyMessage last_;                   ///< To the call before.
  std::atomic<bool> unwanted_ = false;  ///< Nobody waits for the end of the call that is bound.
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
  for (const auto& [key, to] :
       {std::pair("server", &connection.server), std::pair("robot", &options.robot),
        std::pair("ca", &connection.ca), std::pair("certificate", &connection.certificate),
        std::pair("key", &connection.key), std::pair("nkey", &connection.nkey),
        std::pair("nkey_seed", &connection.nkey_seed)}) {
    if (settings.has(key)) *to = settings.at(key).text();
  }
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
  [[nodiscard]] LinkEstimate link() const override { return link_.ask(&Caller::estimate); }
  [[nodiscard]] std::uint64_t heard() const override { return link_.ask(&Caller::counts).others; }
  [[nodiscard]] Nanos patience() const override { return patience_; }
  void expires_in(Kernel& kernel, Nanos time_left) override {
    dynamic_cast<CloudKernel&>(kernel).expires_in(time_left);
  }
  void withdraw(Kernel& kernel) override { dynamic_cast<CloudKernel&>(kernel).give_up(); }
  [[nodiscard]] Support supports(const Workload& workload) const override {
    if (workload.state) return support_of(workload);
    const std::string why = link_.ask(&Caller::why_not, kind_of(workload));
    return {why.empty(), why};
  }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    if (!link_.wait_until_up(std::min(kOpening, patience_))) throw_environment(link_.why_down());
    return std::make_unique<CloudKernel>(link_, workload, parameters, patience_);
  }

  std::string server_;
  Nanos patience_;
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

std::unique_ptr<const pirt::Backend> pirt::make_nats_backend() {
  return std::make_unique<cloud::NatsBackend>();
}
