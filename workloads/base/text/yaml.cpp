// Strict reading of YAML through yaml-cpp; every exception of the library ends here.
//
// yaml-cpp keeps duplicate keys and follows aliases without limit, so both are checked by hand.
#include "workloads/base/text/yaml.h"

#include <fmt/core.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdint>
#include <unordered_set>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

// A file of ours nests about ten levels and holds a few thousand nodes; a task graph of 100,000
// tasks about a million. What is beyond is an alias bomb or not a file of ours, and following it
// would take memory without end.
constexpr int kMaxDepth = 64;
constexpr std::int64_t kMaxNodes = 10'000'000;

std::string location(const std::string& file, const YAML::Node& node) {
  // Only nodes that came with an override have no mark; see rebuilt().
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? file + " (--set)" : file + ":" + std::to_string(mark.line + 1);
}

[[noreturn]] void fail_at(const std::string& file, const YAML::Node& node, const std::string& path,
                          const std::string& message) {
  throw_bad_input(location(file, node) + ": " + (path.empty() ? "" : path + ": ") + message);
}

[[noreturn]] void fail_at(const std::string& file, const YAML::Exception& error) {
  // "bad file" is what yaml-cpp says of a nesting deeper than it parses.
  const std::string reason = error.msg == "bad file" ? "nested too deeply" : error.msg;
  const std::string line = error.mark.is_null() ? "" : ":" + std::to_string(error.mark.line + 1);
  throw_bad_input(file + line + ": not valid YAML: " + reason);
}

std::string child_path(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

std::string_view kind_of(const YAML::Node& node) {
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list";
  return node.IsScalar() ? "a value" : "empty";
}

/// What a message quotes of a node of the wrong type.
std::string shown(const YAML::Node& node) {
  return node.IsScalar() ? "'" + node.Scalar() + "'" : std::string(kind_of(node));
}

/// A quoted scalar is text, whatever it looks like.
bool is_plain(const YAML::Node& node) { return node.IsScalar() && node.Tag() != "!"; }

/// What a text of several lines may contain beside printable text.
constexpr std::string_view kLineBreaks = "\n\r\t";

/// On the file's bytes, before anything is parsed: the line is known, comments are covered, and
/// yaml-cpp is never given bytes that it would pass on.
void check_bytes(const std::string& file, const std::string& text) {
  const auto found = find_unprintable(text, kLineBreaks);
  if (!found) return;
  const auto before = std::string_view(text).substr(0, found->at);
  throw_bad_input(fmt::format("{}:{}: not a text file: {}", file,
                              1 + std::ranges::count(before, '\n'), found->what));
}

/// Size and, since quoted scalars have escapes of their own ("\x1b"), once more the text.
void check_node(const std::string& file, const YAML::Node& node, int depth, std::int64_t& nodes) {
  if (node.IsScalar()) {
    const auto found = find_unprintable(node.Scalar(), kLineBreaks);
    if (found) fail_at(file, node, "", "the text has " + found->what);
  }
  if (depth > kMaxDepth) fail_at(file, node, "", "nested deeper than 64 levels");
  if (++nodes > kMaxNodes) fail_at(file, node, "", "aliases expand to more than 10 million nodes");
  if (!node.IsMap() && !node.IsSequence()) return;
  for (const auto& child : node) {
    if (node.IsMap()) {
      check_node(file, child.first, depth + 1, nodes);
      check_node(file, child.second, depth + 1, nodes);
    } else {
      check_node(file, child, depth + 1, nodes);
    }
  }
}

YAML::Node load_one(const std::string& file, const std::string& text) {
  check_bytes(file, text);
  try {
    auto documents = YAML::LoadAll(text);
    if (documents.empty() || documents.front().IsNull()) {
      throw_bad_input(file + ":1: the document is empty");
    }
    if (documents.size() > 1) {
      fail_at(file, documents[1], "",
              "more than one document in a file; keep one here and move the others, each without "
              "its ---, into files of their own");
    }
    std::int64_t nodes = 0;
    check_node(file, documents.front(), 0, nodes);
    return documents.front();
  } catch (const YAML::Exception& error) {
    fail_at(file, error);
  }
}

/// The same content without marks, by which messages tell an override from the file.
YAML::Node rebuilt(const YAML::Node& node) {
  YAML::Node copy(node.Type());
  if (node.IsScalar()) {
    copy = node.Scalar();
    if (!is_plain(node)) copy.SetTag("!");
  }
  for (const auto& child : node) {
    if (node.IsMap()) copy.force_insert(rebuilt(child.first), rebuilt(child.second));
    if (node.IsSequence()) copy.push_back(rebuilt(child));
  }
  return copy;
}

/// The value of @p key as an unshared handle; undefined if there is none.
YAML::Node child_of(const YAML::Node& map, std::string_view key) {
  for (const auto& entry : map) {
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

std::vector<std::string> key_names(const YAML::Node& map) {
  std::vector<std::string> names;
  for (const auto& entry : map) names.push_back(entry.first.Scalar());
  return names;
}

/// The paths of @p node at and below @p from: several if an alias shares it.
void add_paths(const YAML::Node& from, const std::string& path, const YAML::Node& node,
               std::vector<std::string>& paths) {
  if (from.is(node)) paths.push_back(path);
  std::size_t i = 0;
  for (const auto& child : from) {
    if (from.IsMap()) {
      add_paths(child.second, child_path(path, child.first.Scalar()), node, paths);
    } else {
      add_paths(child, fmt::format("{}[{}]", path, i++), node, paths);
    }
  }
}

/// Editing a node that an alias shares would change more than was asked for.
void refuse_shared(const YAML::Node& document, const YAML::Node& node, const std::string& what) {
  std::vector<std::string> paths;
  add_paths(document, "", node, paths);
  if (paths.size() < 2) return;
  throw_bad_input(
      fmt::format("{}: {} is the same YAML node as {}; write it out to change one of them", what,
                  paths[0], paths[1]));
}

/// The map that an override's path leads to below @p parent.
YAML::Node step_into(const YAML::Node& parent, const std::string& key, const std::string& path,
                     const std::string& what) {
  const YAML::Node child = child_of(parent, key);
  if (!child.IsDefined()) {
    throw_bad_input(what + ": " + path + " has no '" + key + "'" +
                    suggestion(key, key_names(parent)));
  }
  if (!child.IsMap()) throw_bad_input(what + ": " + path + "." + key + " is not a map");
  return child;
}

void apply(const YAML::Node& document, const std::string& root, const YamlOverride& change) {
  const std::string what = "--set " + change.path + "=" + change.value;
  YAML::Node value;
  try {
    value = rebuilt(YAML::Load(change.value));
  } catch (const YAML::Exception& error) {
    throw_bad_input(what + ": the value is not valid YAML: " + error.msg);
  }
  if (value.IsNull()) throw_bad_input(what + ": the value is empty");
  std::int64_t nodes = 0;
  check_node(what, value, 0, nodes);

  std::string path = root;
  YAML::Node parent = child_of(document, root);
  if (!parent.IsMap()) throw_bad_input(what + ": the file has no map '" + root + "'");
  const auto keys = split(change.path, '.');
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    // A unit has to be there; a map of one of its settings (`energy`) may be the first to be given.
    if (i > 0 && !child_of(parent, keys[i]).IsDefined()) {
      parent[keys[i]] = YAML::Node(YAML::NodeType::Map);
    }
    const YAML::Node child = step_into(parent, keys[i], path, what);
    refuse_shared(document, child, what);
    parent.reset(child);
    path += "." + keys[i];
  }
  refuse_shared(document, child_of(parent, keys.back()), what);
  parent[keys.back()] = value;
}

}  // namespace

YamlNode::YamlNode(std::string file, const YAML::Node& node, std::string path)
    : file_(std::move(file)),
      node_(std::make_shared<const YAML::Node>(node)),
      path_(std::move(path)) {}

bool YamlNode::is_map() const { return node_->IsMap(); }
bool YamlNode::is_sequence() const { return node_->IsSequence(); }
bool YamlNode::is_scalar() const { return node_->IsScalar(); }
const std::string& YamlNode::scalar() const { return node_->Scalar(); }

std::string YamlNode::location() const {
  return pirt::location(file_, *node_) + (path_.empty() ? "" : ": " + path_);
}

void YamlNode::fail(const std::string& message) const { fail_at(file_, *node_, path_, message); }

std::vector<std::string> YamlNode::keys() const {
  if (!node_->IsMap()) fail("must be a map, is " + std::string(kind_of(*node_)));
  std::vector<std::string> names;
  std::unordered_set<std::string_view> seen;
  for (const auto& entry : *node_) {
    if (!entry.first.IsScalar()) fail_at(file_, entry.first, path_, "a key must be plain text");
    const std::string& name = entry.first.Scalar();
    if (find_unprintable(name))
      fail_at(file_, entry.first, path_, "a key must be one line of text");
    if (!seen.insert(name).second) {
      fail_at(file_, entry.first, child_path(path_, name), "given twice");
    }
    names.push_back(name);
  }
  return names;
}

void YamlNode::check_keys(const std::vector<std::string>& allowed) const {
  for (const auto& name : keys()) {
    if (std::ranges::find(allowed, name) != allowed.end()) continue;
    for (const auto& entry : *node_) {
      if (entry.first.Scalar() != name) continue;
      fail_at(file_, entry.first, child_path(path_, name),
              "unknown key" + suggestion(name, allowed));
    }
  }
}

bool YamlNode::has(std::string_view key) const {
  return node_->IsMap() && child_of(*node_, key).IsDefined();
}

YamlNode YamlNode::at(std::string_view key) const {
  if (!node_->IsMap()) fail("must be a map, is " + std::string(kind_of(*node_)));
  const YAML::Node child = child_of(*node_, key);
  if (!child.IsDefined()) fail("missing key '" + std::string(key) + "'");
  return {file_, child, child_path(path_, key)};
}

std::vector<YamlNode> YamlNode::items() const {
  if (!node_->IsSequence()) fail("must be a list, is " + std::string(kind_of(*node_)));
  std::vector<YamlNode> nodes;
  for (const auto& child : *node_) {
    nodes.emplace_back(file_, child, path_ + "[" + std::to_string(nodes.size()) + "]");
  }
  return nodes;
}

std::string YamlNode::text() const {
  if (!node_->IsScalar()) fail("must be text, is " + std::string(kind_of(*node_)));
  if (find_unprintable(node_->Scalar())) fail("must be one line of text, without tabs");
  return node_->Scalar();
}

std::string YamlNode::one_of(const std::vector<std::string>& known) const {
  std::string word = text();
  if (std::ranges::find(known, word) == known.end()) {
    fail("'" + word + "' is not one of " + join(known, ", ") + suggestion(word, known));
  }
  return word;
}

std::string YamlNode::paragraph() const {
  if (!node_->IsScalar()) fail("must be text, is " + std::string(kind_of(*node_)));
  std::string line;
  for (const char c : node_->Scalar()) {
    const bool gap = c == ' ' || kLineBreaks.find(c) != std::string_view::npos;
    if (!gap) {
      line += c;
    } else if (!line.empty() && line.back() != ' ') {
      line += ' ';
    }
  }
  if (line.ends_with(' ')) line.pop_back();
  return line;
}

template <typename T>
T YamlNode::number_of(const NumberRead<T>& read) const {
  if (!node_->IsScalar()) fail("must be a number, is " + std::string(kind_of(*node_)));
  if (!is_plain(*node_)) fail("must be a number without quotes, got '" + node_->Scalar() + "'");
  if (!read.value) fail(read.problem);
  return *read.value;
}

double YamlNode::number(double low, double high) const {
  return number_of(decimal_number(scalar(), low, high));
}

Nanos YamlNode::milliseconds(double low_ms) const {
  return number_of(pirt::milliseconds(scalar(), low_ms, kLongestMs));
}

std::pair<Nanos, Nanos> YamlNode::time_range() const {
  if (!is_map()) {
    const Nanos time = milliseconds(0);
    return {time, time};
  }
  check_keys({"uniform"});
  const YamlNode uniform = at("uniform");
  const auto bounds = uniform.items();
  if (bounds.size() != 2) uniform.fail("must be [low, high]");
  const Nanos low = bounds[0].milliseconds(0);
  const Nanos high = bounds[1].milliseconds(0);
  if (low > high) uniform.fail("low must not be above high");
  return {low, high};
}

std::int64_t YamlNode::integer(std::int64_t low, std::int64_t high) const {
  return number_of(whole_number(scalar(), low, high));
}

bool YamlNode::boolean() const {
  const std::string text = is_plain(*node_) ? node_->Scalar() : "";
  if (text != "true" && text != "false") fail("must be true or false, got " + shown(*node_));
  return text == "true";
}

std::string YamlNode::dump() const { return YAML::Dump(*node_); }

YamlNode parse_yaml(const std::string& file, const std::string& text) {
  return parse_yaml(file, text, "", {});
}

YamlNode parse_yaml(const std::string& file, const std::string& text, const std::string& root,
                    const std::vector<YamlOverride>& overrides) {
  const YAML::Node document = load_one(file, text);
  if (!overrides.empty()) {
    // Keys are compared as text below, so that odd ones have to be refused first.
    const YamlNode top(file, document, "");
    for (const auto& key : top.keys()) {
      if (key == root && top.at(key).is_map()) {
        for (const auto& unit : top.at(key).keys()) static_cast<void>(unit);
      }
    }
  }
  for (const auto& change : overrides) apply(document, root, change);
  return {file, document, ""};
}

}  // namespace pirt
