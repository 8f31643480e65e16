// What the slots of a worker do: a task's body, its parameters and its outputs.
#include <fmt/core.h>

#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/backends/nats/worker/worker_link.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

std::string one_line(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  }
  return text.substr(0, 500);
}

ReplyMessage reply_to(const TaskMessage& task, ReplyKind kind, std::string problem = "") {
  return {.task = task.task, .send = task.send, .kind = kind, .problem = std::move(problem)};
}

}  // namespace

void WorkerLink::compute(std::size_t slot) {
  name_thread(fmt::format("pirt-slot-{}", slot));
  std::unique_ptr<Computer> computer;
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
    if (stopping_) return;
    const Job job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    Made made;
    try {
      if (computer == nullptr) computer = options_.make_computer();
      made = make(*computer, job);
    } catch (const std::exception& error) {
      made.reply = reply_to(job.message, ReplyKind::kFailedTry, one_line(error.what()));
    }
    if (made.reply) made.reply->held = mailbox_.now() - job.taken;
    lock.lock();
    if (made.missing) ++counts_.missed_parameters;
    if (made.reply && made.reply->kind == ReplyKind::kRefused) ++counts_.refused;
    if (made.reply && made.reply->kind == ReplyKind::kFailedTry) ++counts_.failed;
    if (made.reply && made.reply->kind == ReplyKind::kExpired) ++counts_.expired;
    lock.unlock();
    if (stopping_) return;
    mailbox_.post([this, key = job.key, message = job.message, made = std::move(made)]() mutable {
      if (made.missing) {
        connection_->publish(reply_subject(key.robot),
                             encode(reply_to(message, ReplyKind::kNeedsParameters)));
      }
      with_attendant([&](Nanos now, AttendantActions& out) {
        if (made.reply) {
          attendant_.finished(key, std::move(*made.reply), now, out);
        } else {
          attendant_.postponed(key, out);
        }
      });
    });
  }
}

WorkerLink::Made WorkerLink::make(Computer& computer, const Job& job) {
  const TaskMessage& message = job.message;
  const auto is_over = [&] {
    return message.time_left && *message.time_left <= job.aged + mailbox_.now() - job.taken;
  };
  if (is_over()) return {reply_to(message, ReplyKind::kExpired)};
  Bytes fetched;
  if (const auto* const blob = std::get_if<Blob>(&message.body)) {
    auto found = fetch_blob(*connection_, chunks_subject("in", job.key.robot, message.task.hex()),
                            *blob, [this] { return stopping_.load(); });
    if (found.how == Fetched::How::kNoAnswer) return {};
    if (found.how != Fetched::How::kWhole) return {.reply = {}, .missing = true};
    fetched = std::move(found.bytes);
  }
  const auto* const inside = std::get_if<Bytes>(&message.body);
  const auto admitted = admission_.admit(inside != nullptr ? ByteView(*inside) : ByteView(fetched));
  if (!admitted.value) return {reply_to(message, ReplyKind::kRefused, one_line(admitted.problem))};
  const Workload& workload = *admitted.value->workload;
  SharedTensors given;
  Digest content;
  if (admitted.value->parameters) {
    std::string problem;
    given = parameters(workload, job.key.robot, *admitted.value->parameters, problem);
    if (given == nullptr && !problem.empty()) {
      return {reply_to(message, ReplyKind::kRefused, one_line(problem))};
    }
    if (given == nullptr) return {.reply = {}, .missing = true};
    content = admitted.value->parameters->digest;
  }
  if (is_over()) return {reply_to(message, ReplyKind::kExpired)};  // Reading it took its time.
  ReplyMessage reply = reply_to(message, ReplyKind::kDone);
  const auto made =
      computer.compute(workload, given, content, admitted.value->inputs, reply.execute);
  reply.outputs = outputs(job.key, encode_tensors(made));
  return {std::move(reply)};
}

SharedTensors WorkerLink::parameters(const Workload& workload, const std::string& robot,
                                     const Blob& blob, std::string& problem) {
  {
    const std::lock_guard lock(mutex_);
    for (auto at = cache_.entries.begin(); at != cache_.entries.end(); ++at) {
      if (at->digest != blob.digest) continue;
      cache_.entries.splice(cache_.entries.begin(), cache_.entries, at);
      return at->tensors;
    }
  }
  const auto found = fetch_blob(*connection_, chunks_subject("par", robot, blob.digest.hex()), blob,
                                [this] { return stopping_.load(); });
  if (found.how != Fetched::How::kWhole) return nullptr;
  auto decoded = decode_tensors(found.bytes, workload.parameters);
  if (!decoded.value) {
    problem = workload.name + ": parameters: " + decoded.problem;
    return nullptr;
  }
  auto tensors = std::make_shared<const std::vector<Tensor>>(std::move(*decoded.value));
  const std::lock_guard lock(mutex_);
  cache_.entries.push_front({blob.digest, tensors, blob.size_bytes});
  cache_.bytes += blob.size_bytes;
  while (cache_.bytes > options_.cache_bytes && cache_.entries.size() > 1) {
    cache_.bytes -= cache_.entries.back().bytes;
    cache_.entries.pop_back();
  }
  return tensors;
}

/// Within the reply where they fit.
Payload WorkerLink::outputs(const TaskKey& key, Bytes bytes) {
  const std::size_t chunk = connection_->chunk_bytes();
  if (bytes.size() <= chunk) return bytes;
  const Blob blob{digest_of(bytes), bytes.size(), static_cast<std::uint32_t>(chunk)};
  const std::string problem =
      put_blob(*connection_, chunks_subject("out", key.robot, key.task.hex()), bytes,
               blob.chunk_bytes, [this] { return stopping_.load(); })
          .problem;
  if (!problem.empty()) throw_environment("its outputs could not be stored: " + problem);
  return blob;
}

}  // namespace pirt::cloud
