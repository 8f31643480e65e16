// A file of what happened, a JSON document a line, so that an interrupted comparison goes on where
// it stopped.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "workloads/base/text/json.h"

namespace pirt {

/// Written line by line: what append() returned from is there whatever happens next. One process
/// has it at a time.
class Ledger {
 public:
  using Event = Json;

  /// Keeps nothing.
  Ledger() = default;
  /// Opens a ledger or makes one. Half a line at its end, of a process that died writing it, is cut
  /// off.
  /// @param key     What the ledger is about: fields and their values. One that is there has to be
  ///                about the same.
  /// @param replay  Gets each event that is there, in order; what it throws comes with the place.
  /// @throws Error{kBadInput}: the file is no ledger, is damaged, is about something else (the
  /// first field that differs), is in use, or cannot be opened.
  Ledger(std::filesystem::path path, const Event& key,
         const std::function<void(const Event&)>& replay);
  ~Ledger();
  Ledger(Ledger&& other) noexcept;
  Ledger& operator=(Ledger&& other) noexcept;

  /// @throws Error{kEnvironment} if it cannot be written; nothing of the event is there then.
  void append(const Event& event);
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  void open();
  void read(const Event& key, const std::function<void(const Event&)>& replay);

  std::filesystem::path path_;
  int fd_ = -1;
};

}  // namespace pirt
