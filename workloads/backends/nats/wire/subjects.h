// Subjects and streams: who says what where. A robot's name is a part of each subject that it uses,
// so that the server's permissions bind it to its own.
//
//     pirt.hello                        worker -> robots    what it knows; that it lives
//     pirt.offer.ROBOT                  robot -> workers    how many tasks wait there
//     pirt.claim.ROBOT                  worker -> robot     it wants one of them
//     pirt.task.ROBOT.WORKER            robot -> worker     a task, or an offer: there is none
//     pirt.answer.ROBOT                 worker -> robot     that it has it; what became of it
//     pirt.cancel.ROBOT                 robot -> workers    nobody wants it any more
//     pirt.blob.ROBOT.in.TASK.N         robot -> workers    stream PIRT_ROBOT, its own:
//     pirt.blob.ROBOT.par.DIGEST.N      robot -> workers    what is larger than a message
//     pirt.blob.ROBOT.out.TASK-SEND.N   worker -> robot
// Only the blobs are stored. WORKER is the instance of a worker in hexadecimal digits.
#pragma once

#include <fmt/core.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace pirt::cloud {

inline constexpr const char* kHelloSubject = "pirt.hello";

/// Letters, digits, _ and -, at most 64 of them: what a robot's name may be.
[[nodiscard]] bool is_robot_name(std::string_view name);
/// @throws Error{kBadInput} for another one.
void check_robot_name(std::string_view name);

/// @param what  offer, claim, answer, cancel.
[[nodiscard]] inline std::string subject(std::string_view what, std::string_view robot) {
  return fmt::format("pirt.{}.{}", what, robot);
}
[[nodiscard]] inline std::string task_subject(std::string_view robot, std::uint64_t worker) {
  return fmt::format("pirt.task.{}.{:x}", robot, worker);
}
[[nodiscard]] inline std::string blob_stream(std::string_view robot) {
  return "PIRT_" + std::string(robot);
}
/// Where the chunks of a blob lie; each adds "." and its number. @param what  in, par, out.
[[nodiscard]] inline std::string blob_subject(std::string_view robot, std::string_view what,
                                              std::string_view name) {
  return fmt::format("pirt.blob.{}.{}.{}", robot, what, name);
}
/// The third part of a subject.
[[nodiscard]] inline std::string robot_of(std::string_view subject) {
  for (int i = 0; i < 2; ++i)
    subject.remove_prefix(std::min(subject.find('.'), subject.size() - 1) + 1);
  return std::string(subject.substr(0, subject.find('.')));
}

}  // namespace pirt::cloud
