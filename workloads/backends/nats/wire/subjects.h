// Streams, consumers and subjects: who says what where. A robot's name is a part of each subject
// that it uses, so that the server's permissions bind it to its own.
//
//     pirt.task.ROBOT                   robot -> workers    stream PIRT_TASKS, a work queue
//     pirt.withdraw.ROBOT               robot -> workers    stream PIRT_WITHDRAWN, a work queue
//     pirt.reply.ROBOT                  worker -> robot     stream PIRT_REPLIES, a work queue
//     pirt.in.ROBOT.TASK.N              robot -> workers    stream PIRT_BLOBS: large tasks,
//     pirt.par.ROBOT.DIGEST.N           robot -> workers    parameters,
//     pirt.out.ROBOT.TASK.N             worker -> robot     and large outputs
//     pirt.running.ROBOT                worker -> robot     not stored
//     pirt.hello                        worker -> robots    not stored
//     pirt.gone.ROBOT                   worker -> workers   not stored: what the robot withdrew
//     pirt.deliver.ROBOT                where the server delivers a robot's replies
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace pirt::cloud {

inline constexpr const char* kTaskStream = "PIRT_TASKS";
inline constexpr const char* kWithdrawStream = "PIRT_WITHDRAWN";
inline constexpr const char* kReplyStream = "PIRT_REPLIES";
inline constexpr const char* kBlobStream = "PIRT_BLOBS";
/// Of kTaskStream and kWithdrawStream: all workers share them.
inline constexpr const char* kWorkers = "workers";
inline constexpr const char* kHelloSubject = "pirt.hello";

/// Letters, digits, _ and -, at most 64 of them: what a robot's name may be.
[[nodiscard]] bool is_robot_name(std::string_view name);

[[nodiscard]] inline std::string task_subject(std::string_view robot) {
  return "pirt.task." + std::string(robot);
}
[[nodiscard]] inline std::string withdraw_subject(std::string_view robot) {
  return "pirt.withdraw." + std::string(robot);
}
[[nodiscard]] inline std::string reply_subject(std::string_view robot) {
  return "pirt.reply." + std::string(robot);
}
[[nodiscard]] inline std::string running_subject(std::string_view robot) {
  return "pirt.running." + std::string(robot);
}
[[nodiscard]] inline std::string gone_subject(std::string_view robot) {
  return "pirt.gone." + std::string(robot);
}
[[nodiscard]] inline std::string deliver_subject(std::string_view robot) {
  return "pirt.deliver." + std::string(robot);
}
[[nodiscard]] inline std::string robot_consumer(std::string_view robot) {
  return "robot-" + std::string(robot);
}
/// Where the chunks of a blob lie; each adds "." and its number.
[[nodiscard]] inline std::string chunks_subject(std::string_view kind, std::string_view robot,
                                                std::string_view name) {
  return "pirt." + std::string(kind) + "." + std::string(robot) + "." + std::string(name);
}
/// The last part of a subject.
[[nodiscard]] inline std::string robot_of(std::string_view subject) {
  return std::string(subject.substr(subject.rfind('.') + 1));
}

}  // namespace pirt::cloud
