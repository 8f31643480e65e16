// The value against nlohmann's: the same text in gives the same text out, the same errors.
#include "workloads/base/text/json.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

namespace pirt {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Library = nlohmann::ordered_json;

std::string library_text(const Library& json, int indent = -1) {
  return json.dump(indent, ' ', false, Library::error_handler_t::replace);
}

std::string nested(std::size_t levels) {
  return std::string(levels, '[') + std::string(levels, ']');
}

TEST(Json, WritesWhatItReadAsTheLibraryDoes) {
  for (const char* text : {"null",
                           "true",
                           "false",
                           "0",
                           "-0",
                           "-0.0",
                           "5e-324",
                           "1.7976931348623157e308",
                           "9223372036854775807",
                           "-9223372036854775808",
                           "18446744073709551615",
                           "18446744073709551616",
                           "-9223372036854775809",
                           "0.1",
                           "1e2",
                           "100.0",
                           "1e-7",
                           "123456789012345680000",
                           "\"\"",
                           "\"a\\u0000\\n\\\"\\\\/\\ud83d\\ude00\\u00fc\"",
                           "[]",
                           "{}",
                           "[[],{},[{}]]",
                           R"({"b":1,"a":[1,2.5,"x",null,{"c":{}}],"":false})",
                           R"({"a":1,"b":2,"a":{"c":3}})",
                           R"({"a":{"b":1},"a":[{"a":[]}, 7]})",
                           " [ 1 , 2 ] "}) {
    for (const int indent : {-1, 0, 2}) {
      EXPECT_EQ(json_text(parse_json(text), indent), library_text(Library::parse(text), indent))
          << text;
    }
  }
}

TEST(Json, RefusesWhatTheLibraryRefusesInItsWords) {
  for (const char* text : {"",           " ",     "[1,",      "[1,]",     "{\"a\"}",
                           "{\"a\":1,}", "{a:1}", "nul",      "1 2",      "01",
                           "+1",         "1e999", "[-1e999]", "\"\xff\"", "\"\\ud800\"",
                           "\"a\n\"",    "// 1",  "NaN",      "\xef\xbb", "{\"a\":[1,{\"b\":}]}"}) {
    std::string expected;
    try {
      const Library json = Library::parse(text);
    } catch (const Library::exception& error) {
      expected = error.what();
    }
    ASSERT_NE(expected, "") << text;
    EXPECT_THAT([&] { static_cast<void>(parse_json(text)); }, ThrowsMessage<JsonError>(expected));
    EXPECT_FALSE(try_parse_json(text)) << text;
  }
}

TEST(Json, HasALimitOfLevelsInsteadOfTheStacks) {
  EXPECT_EQ(json_text(parse_json(nested(kMostJsonLevels))), nested(kMostJsonLevels));
  for (const std::size_t levels : {std::size_t{kMostJsonLevels} + 1, std::size_t{5'000'000}}) {
    EXPECT_THAT([&] { static_cast<void>(parse_json(nested(levels))); },
                ThrowsMessage<JsonError>(HasSubstr("more than 1000 lists and objects")));
    EXPECT_FALSE(try_parse_json(std::string(levels, '[')));
  }
}

TEST(Json, IsMadeOfBracesAsTheLibraryIs) {
  const std::vector<std::string> names = {"a", "b"};
  const std::map<std::string, double> map = {{"x", 1}, {"y", -0.0}};
  const std::vector<std::pair<double, double>> points = {{1, 2}, {3, 4.5}};
  const auto make = [&]<typename Value>(Value /*of*/) {
    Value json = {{"null", nullptr},
                  {"int", -1},
                  {"unsigned", 1U},
                  {"size", std::size_t{7}},
                  {"float", 0.1F},
                  {"double", 0.1},
                  {"bool", true},
                  {"text", "t"},
                  {"string", std::string("s")},
                  {"view", std::string_view("view").substr(1)},
                  {"names", names},
                  {"no names", std::vector<std::string>{}},
                  {"map", map},
                  {"points", points},
                  {"pair", {1, "b"}},
                  {"words", {"b", 1}},
                  {"object", {{"b", 1}}},
                  {"objects", {{{"b", 1}}, {{"b", 2}}}},
                  {"nothing", Value()},
                  {"list", Value::array({1, Value::array(), Value::object()})}};
    json["later"]["deep"] = {1, 2};
    json["int"] = {{"now", "an object"}};
    json["pushed"].push_back(1);
    json["pushed"].push_back({{"a", 1}});
    json["pushed"].push_back({"a", 1});
    json["pushed"].emplace_back(Value::array()).push_back(nullptr);
    json["pushed"].back()["not"[0] == 'n' ? 0 : 1] = 5;
    json.erase("nothing");
    json.erase("never there");
    json.update(Value({{"bool", false}, {"new", 1}}));
    return json;
  };
  EXPECT_EQ(json_text(make(Json()), 1), library_text(make(Library()), 1));
}

TEST(Json, WritesExtremesAndWhatIsNoNumber) {
  const auto text = [](auto value) { return json_text(Json(value)); };
  EXPECT_EQ(text(std::numeric_limits<std::int64_t>::min()), "-9223372036854775808");
  EXPECT_EQ(text(std::numeric_limits<std::uint64_t>::max()), "18446744073709551615");
  EXPECT_EQ(text(-0.0), "-0.0");
  EXPECT_EQ(text(1.0), "1.0");
  EXPECT_EQ(text(std::numeric_limits<double>::denorm_min()), "5e-324");
  EXPECT_EQ(text(std::nan("")), "null");
  EXPECT_EQ(text(-std::numeric_limits<double>::infinity()), "null");
  EXPECT_TRUE(std::signbit(parse_json("-0.0").get<double>()));
}

TEST(Json, WritesTextsThatAreNotUtf8) {
  const std::string name = "a\xff/\xc3.png";
  EXPECT_EQ(json_text({{name, name}}), library_text({{name, name}}));
  EXPECT_EQ(json_text(Json(name)), "\"a\xef\xbf\xbd/\xef\xbf\xbd.png\"");
}

TEST(Json, ReadsNumbersIntoWhatHoldsThem) {
  EXPECT_EQ(Json(255).get<std::uint8_t>(), 255);
  EXPECT_EQ(Json(7U).get<std::int64_t>(), 7);
  EXPECT_EQ(Json(-2.75).get<int>(), -2);
  EXPECT_EQ(Json(3).get<double>(), 3.0);
  EXPECT_EQ(parse_json("18446744073709551615").get<std::uint64_t>(), ~std::uint64_t{0});
  EXPECT_EQ(parse_json("-9223372036854775808").get<std::int64_t>(),
            std::numeric_limits<std::int64_t>::min());
  const auto refused = [](const char* text, auto as) {
    EXPECT_THAT([&] { static_cast<void>(parse_json(text).get<decltype(as)>()); },
                ThrowsMessage<JsonError>(HasSubstr("is out of range")))
        << text;
  };
  refused("256", std::uint8_t{});
  refused("-1", std::uint64_t{});
  refused("-0.75e1", std::size_t{});
  refused("2147483648", int{});
  refused("9223372036854775808", std::int64_t{});
  refused("9223372036854775808.0", std::int64_t{});
  refused("1e300", std::int64_t{});
  refused("18446744073709551616", std::uint64_t{});
  EXPECT_THROW(static_cast<void>(Json(std::nan("")).get<int>()), JsonError);
}

/// What reading throws of either.
template <typename Value, typename Read>
std::string error_of(const Value& json, Read read) {
  try {
    read(json);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "none";
}

TEST(Json, RefusesOtherTypesInTheLibrarysWords) {
  for (const char* text : {"null", "true", "1", "-1.5", "\"t\"", "[1,\"x\"]", "{\"a\":[]}"}) {
    const Json ours = parse_json(text);
    const Library theirs = Library::parse(text);
    const auto same = [&](auto read) {
      EXPECT_EQ(error_of(ours, read), error_of(theirs, read)) << text;
    };
    same([](const auto& j) { static_cast<void>(j.template get<bool>()); });
    same([](const auto& j) { static_cast<void>(j.template get<std::int64_t>()); });
    same([](const auto& j) { static_cast<void>(j.template get<double>()); });
    same([](const auto& j) { static_cast<void>(j.template get<std::string>()); });
    same([](const auto& j) { static_cast<void>(j.template get<std::vector<int>>()); });
    same([](const auto& j) { static_cast<void>(j.template get<std::map<std::string, int>>()); });
    same([](const auto& j) { static_cast<void>(j.at("b")); });
    same([](const auto& j) { static_cast<void>(j.at(2)); });
    same([](const auto& j) { static_cast<void>(j.value("a", 1)); });
    same([](auto j) { j["b"] = 1; });
    same([](auto j) { j.push_back(1); });
    same([](auto j) { j.erase("a"); });
  }
  const Json null;
  EXPECT_THROW(static_cast<void>(parse_json("[1]").at(-1)), JsonError);
  EXPECT_THROW(static_cast<void>(Json::array().back()), JsonError);
  EXPECT_THROW(static_cast<void>(null["a"]), JsonError);
}

TEST(Json, ReadsIntoFieldsAndContainers) {
  const Json json = parse_json(R"({"n":3,"t":"x","b":true,"l":[[1],[2,3]],"m":{"a":1.5}})");
  const int n = json.at("n");
  const std::string t = json["t"];
  const bool b = json.at("b");
  EXPECT_EQ(n, 3);
  EXPECT_EQ(t, "x");
  EXPECT_TRUE(b);
  EXPECT_EQ(json.at("l").get<std::vector<std::vector<int>>>(),
            (std::vector<std::vector<int>>{{1}, {2, 3}}));
  EXPECT_EQ((json.at("m").get<std::map<std::string, double>>()),
            (std::map<std::string, double>{{"a", 1.5}}));
  EXPECT_EQ(json.value("n", 0), 3);
  EXPECT_EQ(json.value("t", ""), "x");
  EXPECT_EQ(json.value("none", "y"), "y");
  EXPECT_EQ(json.value("none", Json()), nullptr);
}

TEST(Json, IsWalkedThrough) {
  const auto sum = [](const Json& json) {
    int total = 0;
    for (const Json& each : json) total += each.get<int>();
    return total;
  };
  EXPECT_EQ(sum({1, 2, 3}), 6);
  EXPECT_EQ(sum({{"a", 1}, {"b", 4}}), 5);
  EXPECT_EQ(sum(Json()), 0);
  EXPECT_EQ(sum(7), 7);
  Json json = {1, 2};
  for (Json& each : json) each = each.get<int>() + 1;
  EXPECT_EQ(json, Json({2, 3}));
  std::string keys;
  const Json object = {{"b", 1}, {"a", 2}};
  for (const auto& [key, value] : object.items()) keys += key + json_text(value);
  EXPECT_EQ(keys, "b1a2");
  EXPECT_TRUE(Json().items().empty());
  EXPECT_TRUE(Json::array().items().empty());
  EXPECT_THROW(static_cast<void>(json.items()), JsonError);
}

TEST(Json, IsEqualWhereTheLibrarysIs) {
  const std::vector<std::string> corpus = {"null",
                                           "true",
                                           "false",
                                           "0",
                                           "-0.0",
                                           "1",
                                           "1.0",
                                           "1.5",
                                           "-2",
                                           "\"1\"",
                                           "\"\"",
                                           "[]",
                                           "{}",
                                           "[1]",
                                           "[1.0]",
                                           "[1,2]",
                                           "[2,1]",
                                           R"({"a":1})",
                                           R"({"a":1.0})",
                                           R"({"a":1,"b":2})",
                                           R"({"b":2,"a":1})",
                                           R"({"a":[{"b":null}]})",
                                           "9007199254740993",
                                           "9007199254740992.0",
                                           "18446744073709551615",
                                           "18446744073709551615.0"};
  for (const std::string& a : corpus) {
    for (const std::string& b : corpus) {
      EXPECT_EQ(parse_json(a) == parse_json(b), Library::parse(a) == Library::parse(b))
          << a << " and " << b;
    }
  }
  EXPECT_EQ(Json(1), Json(1U));
  EXPECT_NE(Json(-1), Json(~std::uint64_t{0}));  // the library says they are equal
  EXPECT_NE(Json(std::nan("")), Json(std::nan("")));
  EXPECT_EQ(Json("a"), "a");
  EXPECT_EQ("a", Json("a"));
  EXPECT_EQ(Json("a"), std::string("a"));
  EXPECT_EQ(Json(), nullptr);
  EXPECT_TRUE(Json(true) == true);
  EXPECT_FALSE(Json(1) == true);
}

TEST(Json, FindsManyKeysAsItFindsFew) {
  constexpr int kKeys = 50'000;
  Json json;
  for (int i = 0; i < kKeys; ++i) json[std::to_string(i)] = i;
  const Json read = parse_json(json_text(json));
  EXPECT_EQ(read, json);
  for (int i = 0; i < kKeys; i += 7) EXPECT_EQ(read.at(std::to_string(i)), i);
  EXPECT_FALSE(read.contains("x"));
  // Around the number from which on there is an index.
  Json some;
  for (int i = 0; i < 34; ++i) some[std::to_string(i)] = i;
  for (const int gone : {0, 33, 5, 31}) some.erase(std::to_string(gone));
  EXPECT_EQ(some.size(), 30U);
  some["a"] = 1, some["b"] = 2, some["c"] = 3, some["a"] = 4;
  EXPECT_EQ(some.size(), 33U);
  EXPECT_EQ(some.at("a"), 4);
  EXPECT_EQ(some.at("32"), 32);
  EXPECT_FALSE(some.contains("31"));
  EXPECT_EQ(some.items().front().key, "1");
}

TEST(Json, IsAValue) {
  Json a = {{"l", {1, 2}}};
  const Json b = a;
  a["l"].push_back(3);
  EXPECT_EQ(b["l"].size(), 2U);
  Json c = std::move(a);
  EXPECT_EQ(c["l"].size(), 3U);
  EXPECT_TRUE(a.is_null());  // NOLINT(bugprone-use-after-move): what a move leaves is promised
  c["l"] = c["l"][0];
  EXPECT_EQ(json_text(c), R"({"l":1})");
  c = c["l"];
  EXPECT_EQ(c, 1);
  c = {1, {2, 3}};
  c.push_back(c[1]);
  c = std::move(c[1]);
  EXPECT_EQ(c, Json({2, 3}));
}

}  // namespace
}  // namespace pirt
