// Strict reading of YAML: an unknown key, a wrong type or broken syntax is an Error with file:line
// and the remedy.
//
// Wraps yaml-cpp; nothing outside this file and its users' .cpp sees YAML::Exception.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workloads/base/text/numbers.h"
#include "workloads/base/time.h"

namespace YAML {
class Node;
}

namespace pirt {

/// A node with the file that it came from, so that every message can say file:line.
class YamlNode {
 public:
  YamlNode(std::string file, const YAML::Node& node, std::string path);

  [[nodiscard]] bool is_map() const;
  [[nodiscard]] bool is_sequence() const;
  [[nodiscard]] bool is_scalar() const;
  [[nodiscard]] const std::string& path() const { return path_; }

  /// Throws unless this is a map whose keys are all in @p allowed and unique.
  void check_keys(const std::vector<std::string>& allowed) const;
  /// Throws unless this is a map with unique keys; returns them in file order.
  [[nodiscard]] std::vector<std::string> keys() const;
  [[nodiscard]] bool has(std::string_view key) const;
  /// @throws if there is no such key.
  [[nodiscard]] YamlNode at(std::string_view key) const;
  [[nodiscard]] std::vector<YamlNode> items() const;

  /// One printable line.
  [[nodiscard]] std::string text() const;
  /// One of the @p known texts.
  [[nodiscard]] std::string one_of(const std::vector<std::string>& known) const;
  /// Text that may have several lines in the file, as one.
  [[nodiscard]] std::string paragraph() const;
  /// Numbers are what base/numbers.h reads, within [low, high].
  [[nodiscard]] double number(double low, double high) const;
  /// A time in ms up to kLongestMs; @p low_ms is 0 or kNanosecondMs.
  [[nodiscard]] Nanos milliseconds(double low_ms) const;
  /// Low and high of a time in ms (twice the same) or of {uniform: [low, high]}; each from 0.
  [[nodiscard]] std::pair<Nanos, Nanos> time_range() const;
  [[nodiscard]] std::int64_t integer(std::int64_t low, std::int64_t high) const;
  [[nodiscard]] bool boolean() const;
  /// The node as YAML text, for those that keep a part of a file uninterpreted.
  [[nodiscard]] std::string dump() const;

  /// "file:line: path", for those that find out later what is wrong with the node.
  [[nodiscard]] std::string location() const;
  /// @throws Error{kBadInput} "file:line: path: message".
  [[noreturn]] void fail(const std::string& message) const;

 private:
  /// "" for what is no scalar.
  [[nodiscard]] const std::string& scalar() const;
  template <typename T>
  [[nodiscard]] T number_of(const NumberRead<T>& read) const;

  std::string file_;
  std::shared_ptr<const YAML::Node> node_;
  std::string path_;  ///< "units.cpu.slots", for messages.
};

/// A `--set a.b.c=value` on top of a file: replaces or adds one scalar before the file is
/// interpreted.
struct YamlOverride {
  std::string path;   ///< "cpu.active_w"
  std::string value;  ///< YAML text of a scalar or flow node.
};

/// @param file   Name for messages.
/// @throws Error{kBadInput} with file:line for a syntax error, an empty document or more than one
/// document.
[[nodiscard]] YamlNode parse_yaml(const std::string& file, const std::string& text);
[[nodiscard]] YamlNode parse_yaml(const std::string& file, const std::string& text,
                                  const std::string& root,
                                  const std::vector<YamlOverride>& overrides);

}  // namespace pirt
