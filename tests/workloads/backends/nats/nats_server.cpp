#include "tests/workloads/backends/nats/nats_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "workloads/backends/nats/nats_backend.h"
#include "workloads/model/own_operation.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// A socket that listens on a port that was free.
int listen_anywhere(int& port) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = loopback(0);
  if (::bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener, 64) != 0) {
    throw std::runtime_error("no free port on loopback");
  }
  socklen_t size = sizeof address;
  ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
  port = ntohs(address.sin_port);
  return listener;
}

int connect_to(int port) {
  const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = loopback(port);
  if (::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    const int on = 1;
    ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return client;
  }
  ::close(client);
  return -1;
}

/// Starts @p arguments, with standard output and error in @p log; it ends with this thread's
/// process.
pid_t start_process(std::vector<std::string> arguments, const std::string& log,
                    const std::vector<std::string>& environment = {}) {
  std::vector<char*> raw;
  for (std::string& each : arguments) raw.push_back(each.data());
  raw.push_back(nullptr);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child != 0) return child;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(out, STDERR_FILENO);
  for (const std::string& each : environment) ::putenv(const_cast<char*>(each.c_str()));
  ::execv(raw[0], raw.data());
  ::_exit(127);
}

}  // namespace

void end_process(pid_t& process) {
  if (process <= 0) return;
  ::kill(process, SIGKILL);
  ::waitpid(process, nullptr, 0);
  process = -1;
}

std::string nats_server_program() {
  for (const char* each :
       {"/usr/sbin/nats-server", "/usr/bin/nats-server", "/usr/local/bin/nats-server"}) {
    if (::access(each, X_OK) == 0) return each;
  }
  return "";
}

NatsServer::NatsServer(const std::string& config, bool jetstream, const std::string& store) {
  std::string folder = (std::filesystem::temp_directory_path() / "pirt-nats-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) throw std::runtime_error("no folder for a server");
  folder_ = folder;
  ::close(listen_anywhere(port_));
  std::ofstream file(folder_ / "server.conf");
  file << "listen: 127.0.0.1:" << port_ << "\n" << config;
  if (jetstream) file << "jetstream { store_dir: \"" << folder << "/store\"\n" << store << "}\n";
}

NatsServer::~NatsServer() {
  end_process(process_);
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

bool NatsServer::start(const std::vector<std::string>& environment) {
  process_ = start_process({nats_server_program(), "-c", (folder_ / "server.conf").string()},
                           (folder_ / "log").string(), environment);
  for (int i = 0; i < 300; ++i) {
    const int client = connect_to(port_);
    if (client >= 0) {
      ::close(client);
      return true;
    }
    if (::waitpid(process_, nullptr, WNOHANG) == process_) {
      process_ = -1;
      return false;
    }
    std::this_thread::sleep_for(20ms);
  }
  return false;
}

void NatsServer::kill() { end_process(process_); }

std::string NatsServer::log() const {
  std::ostringstream text;
  text << std::ifstream(folder_ / "log").rdbuf();
  return text.str();
}

RawClient::RawClient(int port, const std::string& user, const std::string& password)
    : socket_(connect_to(port)) {
  const std::string who =
      user.empty() ? "" : fmt::format(R"(,"user":"{}","pass":"{}")", user, password);
  send(fmt::format("CONNECT {{\"verbose\":false,\"headers\":true{}}}\r\n", who));
  flush();
}

RawClient::~RawClient() { ::close(socket_); }

bool RawClient::send(std::string_view text) const {
  while (!text.empty()) {
    const auto sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

bool RawClient::publish(const std::string& subject, ByteView data, const std::string& reply) const {
  return send(fmt::format("PUB {} {} {}\r\n{}\r\n", subject, reply, data.size(), text_of(data)));
}

void RawClient::flush() const {
  send("PING\r\n");
  std::string heard(4096, ' ');
  while (heard.find("PONG") == std::string::npos) {
    heard.resize(4096);
    const auto got = ::recv(socket_, heard.data(), heard.size(), 0);
    if (got <= 0) return;
    heard.resize(static_cast<std::size_t>(got));
  }
}

MuteServer::MuteServer() : listener_(listen_anywhere(port_)) {}

MuteServer::~MuteServer() {
  if (client_ >= 0) ::close(client_);
  ::close(listener_);
}

void MuteServer::greet() {
  client_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  constexpr std::string_view kInfo =
      R"(INFO {"server_id":"mute","version":"2.9.10","proto":1,"headers":true,"max_payload":1048576})"
      "\r\n";
  if (::send(client_, kInfo.data(), kInfo.size(), MSG_NOSIGNAL) < 0) {
    throw std::runtime_error("nobody to greet");
  }
}

Wire::Wire(int to_port) : to_port_(to_port) {
  listener_ = listen_anywhere(port_);
  acceptor_ = std::jthread([this] { accept_all(); });
}

Wire::~Wire() {
  stopping_ = true;
  acceptor_.join();
  ::close(listener_);
}

void Wire::cut(bool is_cut) { cut_ = is_cut; }

void Wire::accept_all() {
  while (!stopping_) {
    pollfd ready{listener_, POLLIN, 0};
    if (::poll(&ready, 1, 20) <= 0) continue;
    const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) continue;
    if (cut_) {
      ::close(client);
      continue;
    }
    const std::lock_guard lock(mutex_);
    forwarders_.emplace_back([this, client] { forward(client); });
  }
  const std::lock_guard lock(mutex_);
  forwarders_.clear();
}

void Wire::forward(int client) {
  const int server = connect_to(to_port_);
  const int on = 1;
  ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  std::vector<char> buffer(1 << 16);
  const auto move = [&](int from, int to) {
    const auto got = ::recv(from, buffer.data(), buffer.size(), 0);
    for (ssize_t sent = 0; sent < got;) {
      const auto now =
          ::send(to, buffer.data() + sent, static_cast<std::size_t>(got - sent), MSG_NOSIGNAL);
      if (now <= 0) return false;
      sent += now;
    }
    return got > 0;
  };
  for (bool open = server >= 0; open && !cut_ && !stopping_;) {
    if (held_) {
      std::this_thread::sleep_for(5ms);
      continue;
    }
    pollfd ready[2] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
    if (::poll(ready, 2, 20) <= 0) continue;
    if (ready[0].revents != 0) open = move(client, server);
    if (open && ready[1].revents != 0) open = move(server, client);
  }
  ::close(client);
  if (server >= 0) ::close(server);
}

Workload adding(const std::string& name, std::int64_t size, std::int64_t parameters) {
  Workload workload;
  workload.name = name;
  workload.kernel = "adding";
  workload.inputs = {{"x", Element::kU8, {size}}};
  workload.outputs = {{"y", Element::kU8, {size}}};
  if (parameters > 0) workload.parameters = {{"p", Element::kU8, {parameters}}};
  return workload;
}

namespace {

class AddingComputer : public Computer {
 public:
  ReplyMessage compute(const Call& call) override {
    const auto inputs = decode_tensors(call.task.inputs.bytes, call.workload->inputs);
    int more = 1;
    if (call.task.parameters) {
      auto& known = parameters_[{call.task.spec, call.task.parameters->digest}];
      if (known.empty()) known.assign(call.parameters.begin(), call.parameters.end());
      if (known.empty()) return {.kind = ReplyKind::kMissing};
      const auto tensors = decode_tensors(known, call.workload->parameters);
      more += tensors.at(0).as<std::uint8_t>()[0];
    }
    const auto in = inputs.at(0).as<std::uint8_t>();
    const Nanos pause = in[1] * 10ms;
    if (pause > 0ms) std::this_thread::sleep_for(pause);
    if (in[0] == static_cast<std::uint8_t>(Ask::kThrow)) throw std::runtime_error("boom");
    if (in[0] == static_cast<std::uint8_t>(Ask::kDie)) ::kill(::getpid(), SIGKILL);
    if (in[0] == static_cast<std::uint8_t>(Ask::kLoseDevice)) throw ProcessGone("it is lost");
    if (in[0] == static_cast<std::uint8_t>(Ask::kFail)) throw CallFailed("no plan");
    auto outputs = make_tensors(call.workload->outputs);
    const auto out = outputs[0].as<std::uint8_t>();
    for (std::size_t i = 0; i < in.size(); ++i) out[i] = static_cast<std::uint8_t>(in[i] + more);
    return {.execute = pause, .outputs = {encode_tensors(outputs), {}}};
  }

 private:
  std::map<std::pair<Digest, Digest>, Bytes> parameters_;
};

}  // namespace

std::unique_ptr<Computer> make_adding_computer() { return std::make_unique<AddingComputer>(); }

std::vector<Tensor> adding_inputs(const Workload& workload, const AddingTask& task) {
  std::vector<Tensor> inputs = make_tensors(workload.inputs);
  const auto x = inputs[0].as<std::uint8_t>();
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<std::uint8_t>(task.value + i * 7);
  x[0] = static_cast<std::uint8_t>(task.ask);
  x[1] = task.tens_of_ms;
  return inputs;
}

TaskMessage make_message(const Workload& workload, const AddingTask& task) {
  TaskMessage message;
  message.kind.name = workload.name;
  message.spec = spec_digest(workload);
  message.inputs.bytes = encode_tensors(adding_inputs(workload, task));
  return message;
}

Submitted::Submitted(RobotLink& robot, TaskMessage task) : robot_(&robot), id_(robot.next_task()) {
  task.task = id_;
  robot.step([&](Caller& caller, Nanos now) { progress_ = caller.submit(std::move(task), now); });
}

ReplyMessage Submitted::end(Nanos most) const {
  const bool ends = robot_->wait(most, [this] { return progress_->end.has_value(); });
  return ends ? *progress_->end : ReplyMessage{.problem = "no end"};
}

std::string check_outputs(const Workload& workload, const AddingTask& task, const Tensor& output,
                          std::uint8_t parameter) {
  const auto expected = adding_inputs(workload, task);
  const auto x = expected[0].as<std::uint8_t>(), y = output.as<std::uint8_t>();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto right = static_cast<std::uint8_t>(x[i] + 1 + parameter);
    if (y[i] != right) return fmt::format("at {}: {} where {} is right", i, y[i], right);
  }
  return "";
}

std::string check_outputs(const Workload& workload, const AddingTask& task,
                          const ReplyMessage& reply) {
  try {
    return check_outputs(workload, task,
                         decode_tensors(reply.outputs.bytes, workload.outputs).at(0));
  } catch (const Error& error) {
    return error.what();
  }
}

std::string call_and_check(Kernel& kernel, const Workload& workload, const AddingTask& task,
                           std::uint8_t parameter) {
  const auto inputs = adding_inputs(workload, task);
  auto outputs = make_tensors(workload.outputs);
  kernel.bind(inputs, outputs);
  std::string problem;
  try {
    kernel.upload();
    static_cast<void>(kernel.execute(1));
    kernel.download();
    problem = check_outputs(workload, task, outputs[0], parameter);
  } catch (const std::exception& error) {
    problem = error.what();
  }
  kernel.unbind();
  return problem;
}

std::vector<Tensor> parameters_of(const Workload& workload, std::uint8_t value) {
  auto parameters = make_tensors(workload.parameters);
  for (Tensor& tensor : parameters) {
    for (auto& each : tensor.as<std::uint8_t>()) each = value;
  }
  return parameters;
}

std::unique_ptr<Device> open_unit(const std::string& url, const std::string& settings,
                                  double patience_s) {
  return make_nats_backend()->open({.unit = "cloud",
                                    .cores = {},
                                    .device = {},
                                    .script = "server: " + url + "\n" + settings,
                                    .options = {{"patience_s", patience_s}}});
}

double resident_mb(const std::string& process) {
  std::ifstream statm("/proc/" + process + "/statm");
  std::uint64_t total = 0, resident = 0;
  statm >> total >> resident;
  return static_cast<double>(resident) * 4096e-6;
}

WorkerOptions worker_options(const std::string& url) {
  WorkerOptions options;
  options.connection.server = url;
  options.connection.reconnect_wait = 50ms;
  options.hello = 300ms;
  options.make_computer = make_adding_computer;
  return options;
}

RobotOptions robot_options(const std::string& url) {
  RobotOptions options;
  options.connection.server = url;
  options.connection.reconnect_wait = 50ms;
  options.limits.confirm = 1s;
  options.limits.silence = 3s;
  options.limits.worker = 2s;
  return options;
}

void run_worker_process() {
  const Workload small = adding("small", 1000), large = adding("large", 3'000'000);
  const std::vector<const Workload*> all = {&small, &large};
  WorkerOptions options = worker_options(std::getenv("PIRT_TEST_CLOUD"));
  options.name = "process-" + std::to_string(::getpid());
  options.limits.slots = std::atoi(std::getenv("PIRT_TEST_SLOTS"));
  const WorkerLink worker(options, all);
  while (true) std::this_thread::sleep_for(1s);
}

pid_t start_worker_process(const std::string& url, int slots) {
  return start_process({"/proc/self/exe", "--gtest_filter=CloudProcess.IsAWorker"}, "/dev/null",
                       {"PIRT_TEST_CLOUD=" + url, "PIRT_TEST_SLOTS=" + std::to_string(slots)});
}

void run_robot_process() {
  const Workload small = adding("small", 1000), large = adding("large", 3'000'000),
                 weighed = adding("weighed", 100, 1'500'000);
  const auto device = open_unit(std::getenv("PIRT_TEST_ROBOT"));
  std::vector<std::jthread> threads;
  for (const Workload* each : {&small, &large, &weighed}) {
    threads.emplace_back([&, each] {
      const std::uint8_t parameter = each->parameters.empty() ? 0 : 2;
      const auto kernel = device->prepare(*each, parameters_of(*each, parameter));
      const AddingTask task{.tens_of_ms = 1, .value = 5};
      while (true) static_cast<void>(call_and_check(*kernel, *each, task, parameter));
    });
  }
}

pid_t start_robot_process(const std::string& url) {
  return start_process({"/proc/self/exe", "--gtest_filter=CloudProcess.IsARobot"}, "/dev/null",
                       {"PIRT_TEST_ROBOT=" + url});
}

}  // namespace pirt::cloud::test
