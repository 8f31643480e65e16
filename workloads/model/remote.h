// What a device is besides, if it computes elsewhere, over a way that may be lost and come back.
#pragma once

namespace pirt {

class Remote {
 public:
  /// Whether a call that is made now gets there and is computed. Any thread may ask.
  [[nodiscard]] virtual bool is_reachable() const = 0;

 protected:
  ~Remote() = default;
};

}  // namespace pirt
