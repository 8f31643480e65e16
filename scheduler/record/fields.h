// Records as JSON: one list of fields a record, walked by the writer and the reader alike, so that
// the two cannot drift apart. It stands in namespace pirt, before what is first written or read:
//
//   template <typename Fields, Of<Point> Given>
//   void walk(Fields& fields, Given& point) {
//     fields.field("x", point.x);
//   }
#pragma once

#include <concepts>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "workloads/base/text/json.h"

namespace pirt {

/// It, or a constant one: what is read into, and written from.
template <typename Given, typename Record>
concept Of = std::same_as<std::remove_const_t<Given>, Record>;

/// A list of what JSON itself does not know.
template <typename T>
concept RecordList = !JsonScalar<typename T::value_type> && requires(T list) {
  list.emplace_back();
};

struct RecordWriter {
  /// Of a record its fields, of a time its nanoseconds, of a list such of each.
  template <typename T>
  [[nodiscard]] static Json json_of(const T& value) {
    if constexpr (requires(RecordWriter fields) { walk(fields, value); }) {
      RecordWriter fields;
      walk(fields, value);
      return std::move(fields.json);
    } else if constexpr (requires { typename T::rep; }) {
      return value.count();
    } else if constexpr (RecordList<T>) {
      Json elements = Json::array();
      for (const auto& each : value) elements.push_back(json_of(each));
      return elements;
    } else {
      return value;
    }
  }

  /// Left out where it is absent.
  template <typename T>
  void field(const char* key, const T& value) {
    if constexpr (requires { value.has_value(); }) {
      if (value) field(key, *value);
    } else {
      json[key] = json_of(value);
    }
  }
  /// Left out where it is empty.
  template <typename T>
  void list(const char* key, const std::vector<T>& values) {
    if (!values.empty()) field(key, values);
  }
  /// An object: by that one of their fields.
  template <typename Record>
  void by_name(const char* key, const std::vector<Record>& records, std::string Record::*name) {
    Json& members = json[key] = Json::object();
    for (const Record& each : records) members[each.*name] = json_of(each);
  }

  Json json = Json::object();
};

/// Throws JsonError for a missing key or a wrong type.
struct RecordReader {
  template <typename T>
  static void read(const Json& from, T& value) {
    if constexpr (requires(RecordReader fields) { walk(fields, value); }) {
      RecordReader fields{from};
      walk(fields, value);
    } else if constexpr (requires { typename T::rep; }) {
      value = T(from.get<typename T::rep>());
    } else if constexpr (RecordList<T>) {
      for (const Json& each : from) read(each, value.emplace_back());
    } else {
      value = from.get<T>();
    }
  }

  template <typename T>
  void field(const char* key, T& value) {
    if constexpr (requires { value.has_value(); }) {
      if (json.contains(key)) read(json.at(key), value.emplace());
    } else {
      read(json.at(key), value);
    }
  }
  template <typename T>
  void list(const char* key, std::vector<T>& values) {
    if (json.contains(key)) field(key, values);
  }
  template <typename Record>
  void by_name(const char* key, std::vector<Record>& records, std::string Record::*name) {
    for (const auto& [member, value] : json.at(key).items()) {
      read(value, records.emplace_back());
      records.back().*name = member;
    }
  }

  const Json& json;
};

}  // namespace pirt
