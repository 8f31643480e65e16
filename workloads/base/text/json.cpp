// Messages are those of nlohmann's library, whose parser and writer serve here: who reads them has
// seen them before.
#include "workloads/base/text/json.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <unordered_map>

namespace pirt {

std::string JsonError::reason() const {
  const std::string text = what();
  const auto number = text.find("] ");
  return text.starts_with('[') && number != std::string::npos ? text.substr(number + 2) : text;
}

/// In their order. Of many, where each key is, so that reading a large object takes no time that
/// grows with the square.
struct Json::Members {
  static constexpr std::size_t kFew = 32;

  std::vector<JsonMember> list;
  std::unordered_multimap<std::size_t, std::size_t> places;  ///< By the key's hash; few have none.

  [[nodiscard]] const Json* find(std::string_view key) const {
    if (list.size() < kFew) {
      const auto found = std::ranges::find(list, key, &JsonMember::key);
      return found == list.end() ? nullptr : &found->value;
    }
    const auto [begin, end] = places.equal_range(std::hash<std::string_view>{}(key));
    for (auto place = begin; place != end; ++place) {
      if (list[place->second].key == key) return &list[place->second].value;
    }
    return nullptr;
  }
  /// A key that is not there.
  Json& add(std::string_view key) {
    list.push_back({std::string(key), Json()});
    if (list.size() == kFew) index();
    if (list.size() > kFew) places.emplace(std::hash<std::string_view>{}(key), list.size() - 1);
    return list.back().value;
  }
  void index() {
    places.clear();
    for (std::size_t i = 0; i < list.size() && list.size() >= kFew; ++i) {
      places.emplace(std::hash<std::string_view>{}(list[i].key), i);
    }
  }
};

Json::Json() noexcept : value_(nullptr) {}
Json::Json(std::nullptr_t) noexcept : value_(nullptr) {}
Json::Json(Stored, bool value) : value_(value) {}
Json::Json(Stored, std::int64_t value) : value_(value) {}
Json::Json(Stored, std::uint64_t value) : value_(value) {}
Json::Json(Stored, double value) : value_(value) {}
Json::Json(const char* text) : Json(std::string(text)) {}
Json::Json(std::string_view text) : Json(std::string(text)) {}
Json::Json(const std::string& text) : value_(std::make_unique<std::string>(text)) {}
Json::Json(std::string&& text) : value_(std::make_unique<std::string>(std::move(text))) {}

Json::Json(std::initializer_list<Json> values) {
  const bool is_object = std::ranges::all_of(values, [](const Json& each) {
    return each.is_array() && each.size() == 2 && each.front().is_string();
  });
  *this = is_object ? object(values) : array(values);
}

Json::Json(const Json& other) {
  std::visit(
      [this](const auto& value) {
        if constexpr (requires { value.get(); }) {
          value_ = std::make_unique<std::remove_cvref_t<decltype(*value)>>(*value);
        } else {
          value_ = value;
        }
      },
      other.value_);
}

Json::Json(Json&& other) noexcept : value_(std::exchange(other.value_, nullptr)) {}

Json& Json::operator=(const Json& other) {
  return *this = Json(other);  // which may be a part of this
}

Json& Json::operator=(Json&& other) noexcept {
  Value value = std::exchange(other.value_, nullptr);
  value_.swap(value);
  return *this;
}

Json::~Json() = default;

Json Json::array(std::initializer_list<Json> values) {
  Json json;
  json.value_ = std::make_unique<List>(values);
  return json;
}

Json Json::object(std::initializer_list<Json> members) {
  Json json;
  json.value_ = std::make_unique<Members>();
  for (const Json& each : members) json[each.at(0).text()] = each.at(1);
  return json;
}

/// The part of that type, none if this is of another.
template <typename T>
const T* Json::as() const {
  const auto* const held = std::get_if<std::unique_ptr<T>>(&value_);
  return held == nullptr ? nullptr : held->get();
}

bool Json::is_null() const { return std::holds_alternative<std::nullptr_t>(value_); }
bool Json::is_boolean() const { return std::holds_alternative<bool>(value_); }
bool Json::is_number() const { return is_number_integer() || is_number_float(); }
bool Json::is_number_integer() const {
  return std::holds_alternative<std::int64_t>(value_) || is_number_unsigned();
}
bool Json::is_number_unsigned() const { return std::holds_alternative<std::uint64_t>(value_); }
bool Json::is_number_float() const { return std::holds_alternative<double>(value_); }
bool Json::is_string() const { return as<std::string>() != nullptr; }
bool Json::is_array() const { return as<List>() != nullptr; }
bool Json::is_object() const { return as<Members>() != nullptr; }

const char* Json::type_name() const {
  if (is_null()) return "null";
  if (is_boolean()) return "boolean";
  if (is_string()) return "string";
  if (is_array()) return "array";
  return is_object() ? "object" : "number";
}

void Json::throw_not(const char* type) const {
  throw JsonError(
      fmt::format("[json.exception.type_error.302] type must be {}, but is {}", type, type_name()));
}

void Json::throw_cannot_use(int id, const char* what) const {
  throw JsonError(
      fmt::format("[json.exception.type_error.{}] cannot use {} with {}", id, what, type_name()));
}

std::size_t Json::size() const {
  if (const List* list = as<List>()) return list->size();
  if (const Members* members = as<Members>()) return members->list.size();
  return is_null() ? 0 : 1;
}

const Json* Json::find_member(std::string_view key) const {
  const Members* const members = as<Members>();
  if (members == nullptr) throw_cannot_use(306, "value()");
  return members->find(key);
}

bool Json::contains(std::string_view key) const {
  return is_object() && find_member(key) != nullptr;
}

const Json& Json::at(std::string_view key) const {
  if (!is_object()) throw_cannot_use(304, "at()");
  const Json* const found = find_member(key);
  if (found == nullptr) {
    throw JsonError(fmt::format("[json.exception.out_of_range.403] key '{}' not found", key));
  }
  return *found;
}

Json& Json::at(std::string_view key) { return const_cast<Json&>(std::as_const(*this).at(key)); }

const Json& Json::at_index(std::size_t index) const {
  const List* const list = as<List>();
  if (list == nullptr) throw_cannot_use(304, "at()");
  if (index >= list->size()) {
    throw JsonError(
        fmt::format("[json.exception.out_of_range.401] array index {} is out of range", index));
  }
  return (*list)[index];
}

const Json& Json::element(std::size_t index) const {
  if (const List* list = as<List>()) return (*list)[index];
  if (const Members* members = as<Members>()) return members->list[index].value;
  return *this;
}

Json& Json::operator[](std::string_view key) {
  if (is_null()) *this = object();
  if (!is_object()) throw_cannot_use(305, "operator[] with a string argument");
  if (const Json* found = find_member(key)) return const_cast<Json&>(*found);
  return std::get<std::unique_ptr<Members>>(value_)->add(key);
}

void Json::push_back(const Json& value) { emplace_back(Json(value)); }
void Json::push_back(Json&& value) { emplace_back(std::move(value)); }

Json& Json::emplace_back(Json&& value) {
  if (is_null()) *this = array();
  if (!is_array()) throw_cannot_use(308, "push_back()");
  return std::get<std::unique_ptr<List>>(value_)->emplace_back(std::move(value));
}

void Json::erase(std::string_view key) {
  if (!is_object()) throw_cannot_use(307, "erase()");
  Members& members = *std::get<std::unique_ptr<Members>>(value_);
  std::erase_if(members.list, [key](const JsonMember& each) { return each.key == key; });
  members.index();
}

void Json::update(const Json& object) {
  for (const auto& [key, value] : object.checked_members()) (*this)[key] = value;
}

const std::vector<JsonMember>& Json::items() const {
  static const std::vector<JsonMember> kNone;
  return empty() ? kNone : checked_members();
}

bool Json::boolean() const {
  const bool* const value = std::get_if<bool>(&value_);
  if (value == nullptr) throw_not("boolean");
  return *value;
}

double Json::number() const {
  if (const auto* value = std::get_if<double>(&value_)) return *value;
  if (const auto* value = std::get_if<std::int64_t>(&value_)) return static_cast<double>(*value);
  if (const auto* value = std::get_if<std::uint64_t>(&value_)) return static_cast<double>(*value);
  throw_not("number");
}

namespace {

/// @param limit  The first power of two that is too large.
template <typename T>
std::optional<T> whole_of(double value, double low, double limit) {
  const double whole = std::trunc(value);
  if (!(whole >= low && whole < limit)) return std::nullopt;
  return static_cast<T>(whole);
}

[[noreturn]] void throw_out_of_range(const Json& json) {
  throw JsonError(fmt::format("number {} is out of range", json_text(json)));
}

}  // namespace

std::int64_t Json::whole(std::int64_t low, std::int64_t high) const {
  std::optional<std::int64_t> value;
  if (const auto* held = std::get_if<std::int64_t>(&value_)) {
    value = *held;
  } else if (const auto* positive = std::get_if<std::uint64_t>(&value_)) {
    if (std::in_range<std::int64_t>(*positive)) value = static_cast<std::int64_t>(*positive);
  } else {
    value = whole_of<std::int64_t>(number(), -0x1p63, 0x1p63);
  }
  if (!value || *value < low || *value > high) throw_out_of_range(*this);
  return *value;
}

std::uint64_t Json::whole_up_to(std::uint64_t high) const {
  std::optional<std::uint64_t> value;
  if (const auto* held = std::get_if<std::uint64_t>(&value_)) {
    value = *held;
  } else if (const auto* either = std::get_if<std::int64_t>(&value_)) {
    if (*either >= 0) value = static_cast<std::uint64_t>(*either);
  } else {
    value = whole_of<std::uint64_t>(number(), 0, 0x1p64);
  }
  if (!value || *value > high) throw_out_of_range(*this);
  return *value;
}

const std::string& Json::text() const {
  const std::string* const value = as<std::string>();
  if (value == nullptr) throw_not("string");
  return *value;
}

const Json::List& Json::elements() const {
  const List* const list = as<List>();
  if (list == nullptr) throw_not("array");
  return *list;
}

const std::vector<JsonMember>& Json::checked_members() const {
  const Members* const members = as<Members>();
  if (members == nullptr) throw_not("object");
  return members->list;
}

bool Json::equals(const Json& other) const {
  if (is_number() && other.is_number()) {
    if (is_number_float() || other.is_number_float()) return number() == other.number();
    return std::visit(
        [&other](const auto& a) {
          return std::visit(
              [&a](const auto& b) {
                if constexpr (JsonInteger<std::remove_cvref_t<decltype(a)>> &&
                              JsonInteger<std::remove_cvref_t<decltype(b)>>) {
                  return std::cmp_equal(a, b);
                } else {
                  return false;
                }
              },
              other.value_);
        },
        value_);
  }
  if (value_.index() != other.value_.index()) return false;
  if (const List* list = as<List>()) return *list == *other.as<List>();
  if (const Members* members = as<Members>()) {
    return std::ranges::equal(members->list, other.as<Members>()->list,
                              [](const JsonMember& a, const JsonMember& b) {
                                return a.key == b.key && a.value == b.value;
                              });
  }
  if (const std::string* text = as<std::string>()) return *text == *other.as<std::string>();
  return value_ == other.value_;
}

/// Between our values and the library's text.
class JsonCodec : public nlohmann::json_sax<nlohmann::ordered_json> {
 public:
  explicit JsonCodec(Json& root) { open_.push_back(&root); }

  static nlohmann::ordered_json library_value(const Json& json);

  bool null() override { return add(Json()); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t& /*value*/) override { return false; }  // not in texts
  bool start_object(std::size_t /*size*/) override { return open(Json::object()); }
  bool start_array(std::size_t /*size*/) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& value) override {
    member_ = &(*open_.back())[value];
    return true;
  }
  bool parse_error(std::size_t /*position*/, const std::string& /*last_token*/,
                   const nlohmann::detail::exception& error) override {
    throw JsonError(error.what());
  }

 private:
  Json& place(Json value) {
    Json& parent = *open_.back();
    if (parent.is_array()) return parent.emplace_back(std::move(value));
    Json& there = member_ == nullptr ? parent : *member_;
    return there = std::move(value);
  }
  bool add(Json value) {
    place(std::move(value));
    return true;
  }
  bool open(Json value) {
    if (open_.size() > kMostJsonLevels) {
      throw JsonError(
          fmt::format("more than {} lists and objects within each other", kMostJsonLevels));
    }
    open_.push_back(&place(std::move(value)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }

  /// The place of the whole, then all that are not closed. None is moved before it is closed.
  std::vector<Json*> open_;
  Json* member_ = nullptr;  ///< Where the value of the last key goes.
};

nlohmann::ordered_json JsonCodec::library_value(const Json& json) {
  if (const auto* list = json.as<Json::List>()) {
    auto values = nlohmann::ordered_json::array();
    for (const Json& each : *list) values.push_back(library_value(each));
    return values;
  }
  if (const auto* members = json.as<Json::Members>()) {
    nlohmann::ordered_json::object_t object;
    object.reserve(members->list.size());
    // Keys are unique already: looking for each would take time that grows with the square.
    auto& pairs = static_cast<std::vector<nlohmann::ordered_json::object_t::value_type>&>(object);
    for (const auto& [key, value] : members->list) pairs.emplace_back(key, library_value(value));
    return object;
  }
  if (const auto* text = json.as<std::string>()) return *text;
  return std::visit(
      [](const auto& value) -> nlohmann::ordered_json {
        if constexpr (requires { value.get(); }) {
          return nullptr;  // those above
        } else {
          return value;
        }
      },
      json.value_);
}

Json parse_json(std::string_view text) {
  Json json;
  JsonCodec codec(json);
  nlohmann::ordered_json::sax_parse(text, &codec);
  return json;
}

std::optional<Json> try_parse_json(std::string_view text) {
  try {
    return parse_json(text);
  } catch (const JsonError&) {
    return std::nullopt;
  }
}

std::string json_text(const Json& json, int indent) {
  return JsonCodec::library_value(json).dump(indent, ' ', false,
                                             nlohmann::ordered_json::error_handler_t::replace);
}

std::ostream& operator<<(std::ostream& out, const Json& json) { return out << json_text(json); }

}  // namespace pirt
