#include "workloads/backends/nats/robot/robot_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kAskAgain = std::chrono::seconds(1);
constexpr Nanos kLongestWait = std::chrono::hours(1);
constexpr std::size_t kMostHello = 64 << 10;  ///< Of it 1024 are kept.
constexpr std::size_t kMostReply = std::numeric_limits<std::size_t>::max();  ///< With its outputs.

}  // namespace

template <typename Step>
void RobotLink::with_caller(Step step) {
  std::vector<std::function<void()>> told;
  {
    const std::lock_guard lock(mutex_);
    step(clock_.now());
    told.swap(told_);
  }
  changed_.notify_all();
  say_all();
  for (const auto& each : told) each();
}

/// In order, by whoever comes first, and without the lock: a server that does not read holds up
/// who publishes, and nobody who asks whether there is a link.
void RobotLink::say_all() {
  std::unique_lock lock(mutex_);
  if (std::exchange(saying_, true)) return;
  while (!said_.empty()) {
    const auto [to, frame] = std::move(said_.front());
    said_.pop_front();
    lock.unlock();
    connection_->publish(to, frame);
    lock.lock();
  }
  saying_ = false;
}

template <typename Said, typename Step>
void RobotLink::subscribe(const std::string& subject, std::size_t most_bytes, Step step) {
  connection_->subscribe(subject, [=, this](const Incoming& message) {
    if (message.data.size() > most_bytes) return connection_->note("a worker says too much");
    auto said = decode_as<Said>(message.data);
    if (said.value) return with_caller([&](Nanos now) { step(*std::move(said.value), now); });
    connection_->note("a worker says what cannot be read: " + said.problem);
  });
}

RobotLink::RobotLink(const RobotOptions& options)
    : options_(options),
      caller_(
          options.robot, run_, options.limits,
          [this](std::string to, Bytes message) {
            said_.emplace_back(std::move(to), std::move(message));
          },
          [this](std::function<void()> what) { told_.push_back(std::move(what)); }) {
  check_robot_name(options_.robot);
  options_.connection.name = "pirt robot " + options_.robot;
  options_.connection.inbox = "_INBOX_" + options_.robot;
  connection_ = std::make_unique<Connection>(options_.connection, [this](bool is_up) {
    with_caller([&](Nanos now) {
      ask_at_ = is_up ? now : Nanos::max();
      if (!is_up) caller_.link_down();
    });
  });
  subscribe<ClaimMessage>(subject("claim", options_.robot), kMostHello,
                          [this](const ClaimMessage& claim, Nanos now) {
                            // Else it is of another program of this robot's name.
                            if (claim.run == run_) caller_.claimed(claim.worker, now);
                          });
  subscribe<ReplyMessage>(
      subject("answer", options_.robot), kMostReply,
      [this](ReplyMessage&& reply, Nanos now) { caller_.replied(std::move(reply), now); });
  subscribe<HelloMessage>(kHelloSubject, kMostHello, [this](HelloMessage&& hello, Nanos now) {
    caller_.heard(std::move(hello), now);
  });
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

RobotLink::~RobotLink() {
  server_ = {};
  {
    const std::lock_guard lock(mutex_);
    caller_.cancel_all();
    told_.clear();
  }
  say_all();
}

void RobotLink::serve(const std::stop_token& stop) {
  name_thread("pirt-robot");
  while (!stop.stop_requested()) {
    try {
      bool asks = false;
      with_caller([&](Nanos now) {
        asks = ask_at_ <= now;
        if (asks) ask_at_ = now + kAskAgain;
        if (caller_.next_wake() <= now) caller_.wake(now);
      });
      if (asks) ask_for_stream();
      std::unique_lock lock(mutex_);
      const Nanos until = std::min(caller_.next_wake(), ask_at_), now = clock_.now();
      const Nanos left = std::min(until - std::min(until, now), kLongestWait);
      changed_.wait_for(lock, stop, left,
                        [&] { return std::min(caller_.next_wake(), ask_at_) < until; });
    } catch (const std::exception& error) {  // Such as no memory: it goes on.
      connection_->note(error.what());
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

/// Without a stream of its own nothing large would ever get to a worker.
void RobotLink::ask_for_stream() {
  const auto answer =
      connection_->request("$JS.API.STREAM.INFO." + blob_stream(options_.robot), "", kAskAgain);
  if (!answer.came && !connection_->is_up()) return;
  StreamAnswer stream = answer.came ? read_answer(answer) : StreamAnswer();
  if (!answer.came) {
    stream.why = fmt::format(
        "it does not say whether robot '{}' has a stream; may this user be that robot (pirt "
        "cloud-admin permissions)?",
        options_.robot);
  } else if (connection_->chunk_bytes() == 0) {
    stream.why = connection_->why_no_chunks();
  } else if (stream.error == kNoStream) {
    stream.why = fmt::format("no stream for robot '{}'; run `pirt cloud-admin setup --robots {}`",
                             options_.robot, options_.robot);
  }
  with_caller([&](Nanos now) {
    no_stream_ = stream.why;
    if (!no_stream_.empty() || !connection_->is_up()) return;  // It is asked again.
    stream_bytes_ = stream.json.at("config").value("max_bytes", std::int64_t{0});
    ask_at_ = Nanos::max();
    caller_.link_up(now);
  });
}

void RobotLink::submit(const TaskId& task, Submission submission) {
  submission.task.task = task;
  with_caller([&](Nanos now) { caller_.submit(std::move(submission), now); });
}

void RobotLink::cancel(const TaskId& task) {
  with_caller([&](Nanos) { caller_.cancel(task); });
}

void RobotLink::ready(const TaskId& task) {
  with_caller([&](Nanos now) { caller_.ready(task, now); });
}

bool RobotLink::wait_until_up(Nanos most) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, most, [this] { return caller_.is_up(clock_.now()); });
}

std::string RobotLink::why_down() const {
  const std::string server = "server " + public_url(options_.connection.server);
  if (!connection_->is_up()) return "no connection to " + server + ": " + connection_->why_down();
  const std::string problem = connection_->problem();
  const std::lock_guard lock(mutex_);
  if (caller_.is_up(clock_.now())) return "";
  if (!no_stream_.empty()) return server + ": " + no_stream_;
  if (!problem.empty() && caller_.is_alone()) {
    return "nothing was heard of a worker at " + server + " (" + problem + ")";
  }
  return "no worker is at " + server + "; start one (pirt cloud-worker --server " +
         public_url(options_.connection.server) + ")";
}

std::string RobotLink::why_too_large(const std::string& what, std::uint64_t bytes) const {
  const std::lock_guard lock(mutex_);
  if (stream_bytes_ <= 0 || std::cmp_less_equal(bytes, stream_bytes_)) return "";
  return fmt::format(
      "{} has {} MB to send, and robot {} may have {} MB on the server; give it more (pirt "
      "cloud-admin setup --robot-mb)",
      what, bytes >> 20, options_.robot, stream_bytes_ >> 20);
}

}  // namespace pirt::cloud
