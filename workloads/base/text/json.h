// JSON as a value of our own, and as text.
//
// Reading, writing and the rules are compiled in json.cpp, where the library that knows the text
// stays: each file that included its header took 4 to 5 s more. Not a query language, no binary
// formats, no comments.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iosfwd>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace pirt {

/// Text that is no JSON, a value of another type than the reader expects, a key or an element that
/// is not there. Readers of files catch it and say which file.
class JsonError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  /// what() without the library's number in front: for messages that say which file.
  [[nodiscard]] std::string reason() const;
};

template <typename T>
concept JsonInteger = std::integral<T> && !std::same_as<T, bool> && !std::same_as<T, char>;
/// What becomes a list, or with keys an object.
template <typename T>
concept JsonRange = !std::convertible_to<const T&, std::string_view> &&
                    !std::convertible_to<const T&, std::string> && requires(const T& range) {
  range.begin();
  range.end();
  typename T::value_type;
};
/// What a value turns into without being asked by get().
template <typename T>
concept JsonScalar = JsonInteger<T> || std::floating_point<T> || std::same_as<T, bool> ||
    std::same_as<T, std::string>;

struct JsonMember;

/// Null, a boolean, a whole number, another number, a text, a list, or an object, whose keys stay
/// in the order in which they were written. A whole number that is read without a sign, or made of
/// an unsigned type, is unsigned.
///
/// A braced list is an object if each of its elements is a list of two with a text first, and a
/// list otherwise: `{{"a", 1}, {"b", {2, 3}}}`.
class Json {
 public:
  template <typename Of>
  class Iterator;

  Json() noexcept;
  Json(std::nullptr_t) noexcept;
  template <std::same_as<bool> T>
  Json(T value) : Json(Stored(), value) {}
  template <JsonInteger T>
  Json(T value)
      : Json(Stored(),
             static_cast<std::conditional_t<std::signed_integral<T>, std::int64_t, std::uint64_t>>(
                 value)) {}
  template <std::floating_point T>
  Json(T value) : Json(Stored(), static_cast<double>(value)) {}
  // Cold, as those of literals are: code that builds documents is large and runs once, and the
  // compiler need not make it fast.
  [[gnu::cold]] Json(const char* text);
  [[gnu::cold]] Json(std::string_view text);
  [[gnu::cold]] Json(const std::string& text);
  Json(std::string&& text);
  template <JsonRange T>
  Json(const T& range) : Json(requires { typename T::mapped_type; } ? object() : array()) {
    if constexpr (requires { typename T::mapped_type; }) {
      for (const auto& [key, value] : range) (*this)[key] = value;
    } else {
      for (const auto& each : range) emplace_back(each);
    }
  }
  template <typename A, typename B>
  Json(const std::pair<A, B>& pair) : Json(array({pair.first, pair.second})) {}
  [[gnu::cold]] Json(std::initializer_list<Json> values);
  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(const Json& other);
  Json& operator=(Json&& other) noexcept;
  ~Json();

  [[nodiscard]] static Json array(std::initializer_list<Json> values = {});
  [[nodiscard]] static Json object(std::initializer_list<Json> members = {});

  [[nodiscard]] bool is_null() const;
  [[nodiscard]] bool is_boolean() const;
  [[nodiscard]] bool is_number() const;
  [[nodiscard]] bool is_number_integer() const;  ///< Signed or not.
  [[nodiscard]] bool is_number_unsigned() const;
  [[nodiscard]] bool is_number_float() const;
  [[nodiscard]] bool is_string() const;
  [[nodiscard]] bool is_array() const;
  [[nodiscard]] bool is_object() const;

  /// Elements or members; 0 of null, 1 of any other.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] bool empty() const { return size() == 0; }
  /// False also if this is no object.
  [[nodiscard]] bool contains(std::string_view key) const;

  /// @throws JsonError if there is no such member or element, or this has none.
  [[nodiscard]] const Json& at(std::string_view key) const;
  [[nodiscard]] const Json& at(const char* key) const { return at(std::string_view(key)); }
  template <std::integral T>
  [[nodiscard]] const Json& at(T index) const {
    return at_index(checked(index));
  }
  [[nodiscard]] Json& at(std::string_view key);
  [[nodiscard]] Json& at(const char* key) { return at(std::string_view(key)); }
  template <std::integral T>
  [[nodiscard]] Json& at(T index) {
    return const_cast<Json&>(at_index(checked(index)));
  }
  [[nodiscard]] const Json& operator[](std::string_view key) const { return at(key); }
  [[nodiscard]] const Json& operator[](const char* key) const { return at(key); }
  template <std::integral T>
  [[nodiscard]] const Json& operator[](T index) const {
    return at(index);
  }
  /// Adds what is not there; null becomes an object.
  /// @throws JsonError if this is neither.
  Json& operator[](std::string_view key);
  Json& operator[](const char* key) { return (*this)[std::string_view(key)]; }
  template <std::integral T>
  [[nodiscard]] Json& operator[](T index) {
    return at(index);
  }
  /// Of a list that is not empty.
  [[nodiscard]] const Json& front() const { return at(0); }
  [[nodiscard]] Json& front() { return at(0); }
  [[nodiscard]] const Json& back() const { return at_index(size() - 1); }
  [[nodiscard]] Json& back() { return const_cast<Json&>(at_index(size() - 1)); }

  /// The member, or @p otherwise if there is none.
  /// @throws JsonError if this is no object or the member is of another type.
  template <typename T>
  [[nodiscard]] T value(std::string_view key, const T& otherwise) const {
    const Json* const found = find_member(key);
    return found == nullptr ? otherwise : found->get<T>();
  }
  [[nodiscard]] std::string value(std::string_view key, const char* otherwise) const {
    return value(key, std::string(otherwise));
  }

  /// Numbers become each other, a fraction of a whole number is cut off. Lists become containers,
  /// objects become maps of texts.
  /// @throws JsonError if this is of another type or a whole number that T cannot hold.
  template <typename T>
  [[nodiscard]] T get() const;
  template <JsonScalar T>
  operator T() const {  // NOLINT(google-explicit-constructor): a field is read by assigning it
    return get<T>();
  }

  /// The member, if @p value is known; of a duration its count.
  template <typename T>
  void put(std::string_view key, const std::optional<T>& value) {
    if constexpr (requires { value->count(); }) {
      if (value) (*this)[key] = value->count();
    } else {
      if (value) (*this)[key] = *value;
    }
  }
  /// Null becomes a list.
  /// @throws JsonError if this is neither.
  void push_back(const Json& value);
  void push_back(Json&& value);
  Json& emplace_back(Json&& value);
  /// Removes a member if there is one.
  void erase(std::string_view key);
  /// Takes over the members of @p object, those of the same key too.
  void update(const Json& object);

  /// The elements, or the values of the members; a scalar is a list of itself, null an empty one.
  [[nodiscard]] Iterator<const Json> begin() const;
  [[nodiscard]] Iterator<const Json> end() const;
  [[nodiscard]] Iterator<Json> begin();
  [[nodiscard]] Iterator<Json> end();
  /// Keys and values of an object; of what is empty none.
  /// @throws JsonError for any other.
  [[nodiscard]] const std::vector<JsonMember>& items() const;

  /// Numbers are equal by what they are worth, objects if their members are in the same order.
  friend bool operator==(const Json& a, const Json& b) { return a.equals(b); }
  /// Exact for plain values, which otherwise could be meant as numbers as well.
  template <typename T>
  requires(std::is_scalar_v<T>) friend bool operator==(const Json& a, T b) {
    return a.equals(Json(b));
  }

 private:
  using List = std::vector<Json>;
  struct Members;
  using Value =
      std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double,
                   std::unique_ptr<std::string>, std::unique_ptr<List>, std::unique_ptr<Members>>;
  struct Stored {};
  friend class JsonCodec;  // from and to text

  Json(Stored, bool value);
  Json(Stored, std::int64_t value);
  Json(Stored, std::uint64_t value);
  Json(Stored, double value);

  template <typename T>
  static std::size_t checked(T index) {
    // What is below 0 is as far out of range as can be.
    return static_cast<std::size_t>(index);
  }
  template <typename T>
  [[nodiscard]] const T* as() const;
  [[nodiscard]] bool equals(const Json& other) const;
  [[nodiscard]] const Json& at_index(std::size_t index) const;
  [[nodiscard]] const Json& element(std::size_t index) const;
  [[nodiscard]] const Json* find_member(std::string_view key) const;
  [[nodiscard]] bool boolean() const;
  [[nodiscard]] std::int64_t whole(std::int64_t low, std::int64_t high) const;
  [[nodiscard]] std::uint64_t whole_up_to(std::uint64_t high) const;
  [[nodiscard]] double number() const;
  [[nodiscard]] const std::string& text() const;
  [[nodiscard]] const List& elements() const;
  [[nodiscard]] const std::vector<JsonMember>& checked_members() const;
  [[nodiscard]] const char* type_name() const;
  [[noreturn]] void throw_not(const char* type) const;
  [[noreturn]] void throw_cannot_use(int id, const char* what) const;

  Value value_;
};

struct JsonMember {
  std::string key;
  Json value;
};

template <typename T>
T Json::get() const {
  if constexpr (std::same_as<T, Json>) {
    return *this;
  } else if constexpr (std::same_as<T, bool>) {
    return boolean();
  } else if constexpr (std::signed_integral<T>) {
    return static_cast<T>(whole(std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
  } else if constexpr (std::unsigned_integral<T>) {
    return static_cast<T>(whole_up_to(std::numeric_limits<T>::max()));
  } else if constexpr (std::floating_point<T>) {
    return static_cast<T>(number());
  } else if constexpr (std::same_as<T, std::string>) {
    return text();
  } else if constexpr (requires { typename T::mapped_type; }) {
    T map;
    for (const auto& [key, each] : checked_members()) {
      map.emplace(key, each.template get<typename T::mapped_type>());
    }
    return map;
  } else {
    T list;
    for (const Json& each : elements()) {
      list.insert(list.end(), each.get<typename T::value_type>());
    }
    return list;
  }
}

template <typename Of>
class Json::Iterator {
 public:
  using value_type = Json;
  using difference_type = std::ptrdiff_t;

  Iterator() = default;
  Iterator(Of* of, std::size_t index) : of_(of), index_(index) {}
  Of& operator*() const { return const_cast<Of&>(of_->element(index_)); }
  Of* operator->() const { return &**this; }
  Iterator& operator++() {
    ++index_;
    return *this;
  }
  Iterator operator++(int) { return {of_, index_++}; }
  friend bool operator==(const Iterator&, const Iterator&) = default;

 private:
  Of* of_ = nullptr;
  std::size_t index_ = 0;
};

inline Json::Iterator<const Json> Json::begin() const { return {this, 0}; }
inline Json::Iterator<const Json> Json::end() const { return {this, size()}; }
inline Json::Iterator<Json> Json::begin() { return {this, 0}; }
inline Json::Iterator<Json> Json::end() { return {this, size()}; }

/// Lists and objects that contain each other; reading more would overflow the stack of those that
/// walk through it. What pirt writes has less than 20.
inline constexpr int kMostJsonLevels = 1000;

/// Of two members with one key the second holds.
/// @throws JsonError if it is none, has a number that no double holds, or more than
/// kMostJsonLevels.
[[nodiscard]] Json parse_json(std::string_view text);
/// None where parse_json() throws.
[[nodiscard]] std::optional<Json> try_parse_json(std::string_view text);
/// Without a newline at the end. What is no finite number is null. File names need not be UTF-8,
/// and JSON has to be: their other bytes become U+FFFD.
/// @param indent  Spaces a level; -1 = all on one line.
[[nodiscard]] std::string json_text(const Json& json, int indent = -1);
std::ostream& operator<<(std::ostream& out, const Json& json);

}  // namespace pirt
