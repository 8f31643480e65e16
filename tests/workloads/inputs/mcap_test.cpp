// MCAP and ROS 2's folders: other people's files are read as they say, and what is damaged is said.
#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <map>
#include <utility>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/bag_format.h"
#include "workloads/inputs/recording/compression.h"
#include "workloads/inputs/recording/mcap_format.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/inputs/sequence/trajectory.h"
#include "workloads/slam/run/pipeline.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;
using test::bad_input;
using test::put;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<fs::path> files_below(const fs::path& folder, const std::string& extension) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == extension) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

/// Topic, type, encoding and messages with their times, one a line.
std::string content_of(const Recording& recording) {
  std::string text;
  for (std::size_t t = 0; t < recording.topics().size(); ++t) {
    const Topic& topic = recording.topics()[t];
    text += fmt::format("{} {} {}\n", topic.name, topic.type, topic.encoding);
    for (std::size_t i = 0; i < topic.messages; ++i) {
      text += fmt::format("{}:", recording.time(t, i).count());
      for (const char c : recording.message(t, i)) text += fmt::format(" {}", int(c));
      text += '\n';
    }
  }
  return text +
         fmt::format("{} attachments, {} metadata", recording.attachments(), recording.metadata());
}

/// The same, as the JSON beside a file of the conformance suite says it.
std::string expected_content(const fs::path& file) {
  const Json json = parse_json(text_of(file));
  std::map<std::string, std::string> schemas, topics;
  std::map<std::string, std::multimap<std::int64_t, std::string>> messages;
  std::string text;
  int attachments = 0, metadata = 0;
  for (const Json& record : json.at("records")) {
    std::map<std::string, const Json*> fields;
    for (const Json& field : record.at("fields"))
      fields[field.at(0).get<std::string>()] = &field.at(1);
    const auto says = [&](const char* name) { return fields.at(name)->get<std::string>(); };
    const auto type = record.at("type").get<std::string>();
    if (type == "DataEnd") break;
    if (type == "Schema") schemas[says("id")] = says("name");
    if (type == "Channel") {
      topics[says("id")] = fmt::format("{} {} {}\n", says("topic"), schemas[says("schema_id")],
                                       says("message_encoding"));
    }
    if (type == "Message") {
      std::string line = says("log_time") + ":";
      for (const Json& byte : *fields.at("data")) line += " " + byte.get<std::string>();
      messages[says("channel_id")].emplace(std::stoll(says("log_time")), line + "\n");
    }
    attachments += type == "Attachment" ? 1 : 0;
    metadata += type == "Metadata" ? 1 : 0;
  }
  for (const auto& [id, topic] : topics) {
    text += topic;
    for (const auto& [time, line] : messages[id]) text += line;
  }
  return text + fmt::format("{} attachments, {} metadata", attachments, metadata);
}

TEST(Mcap, ReadsTheConformanceSuiteByItsIndexAndWithout) {
  PIRT_DATA_OR_SKIP(folder, "mcap-conformance");
  const auto files = files_below(folder, ".mcap");
  ASSERT_EQ(files.size(), 416U);
  for (const fs::path& file : files) {
    const std::string expected = expected_content(fs::path(file).replace_extension(".json"));
    EXPECT_EQ(content_of(*open_mcap(file)), expected) << file;
    EXPECT_EQ(content_of(*open_mcap(file, 0)), expected) << file;
  }
}

TEST(Mcap, RefusesABitThatChangedOrReadsTheRest) {
  PIRT_DATA_OR_SKIP(folder, "mcap-conformance");
  const test::ScratchFolder scratch;
  const fs::path changed = scratch.path() / "changed.mcap";
  for (const std::string name : {"TenMessages/TenMessages-ch-chx-mx-pad-rch-rsh-st-sum.mcap",
                                 "OneMessage/OneMessage-rch-rsh-st-sum.mcap",
                                 "OneAttachment/OneAttachment-ax-st-sum.mcap"}) {
    ASSERT_TRUE(fs::exists(folder / name)) << name;
    const std::string whole = text_of(folder / name);
    const std::string expected = content_of(*open_mcap(folder / name));
    for (std::size_t i = 0; i < whole.size(); ++i) {
      std::string text = whole;
      text[i] = static_cast<char>(text[i] ^ (1 << (i % 8)));
      put(changed, text);
      for (const std::uint64_t checked : {std::uint64_t{0}, std::uint64_t{1} << 20}) {
        try {
          const auto read = open_mcap(changed, checked);
          const std::string content = content_of(*read);
          // By its index alone what is between the chunks is not looked at.
          EXPECT_TRUE(content == expected || !read->warnings().empty())
              << name << " byte " << i << " checked " << checked << "\n"
              << content;
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::kBadInput);
          EXPECT_THAT(error.what(), HasSubstr("changed.mcap"));
        }
      }
    }
  }
}

TEST(Mcap, MessagesInFrontOfAChunkComeBeforeIts) {
  using mcap::Op;
  using mcap::raw;
  using mcap::sized;
  const std::string one = raw(std::uint16_t{1});
  const auto message = [&one](int i) {
    const std::string time = raw(static_cast<std::uint64_t>(from_ms(100.0 * i).count()));
    return mcap::record(Op::kMessage,
                        one + raw(std::uint32_t{0}) + time + time + std::to_string(i));
  };
  std::string text = std::string(mcap::kMagic) + mcap::record(Op::kHeader, sized("") + sized(""));
  text +=
      mcap::record(Op::kSchema, one + sized("sensor_msgs/msg/Imu") + sized("ros2msg") + sized(""));
  text += mcap::record(Op::kChannel, one + one + sized("/imu") + sized("cdr") + sized(""));
  for (int i = 0; i < 20; ++i) text += message(i);
  std::string chunk;
  for (int i = 20; i < 120; ++i) chunk += message(i);
  const std::string size = raw(std::uint64_t{chunk.size()});
  text += mcap::record(
      Op::kChunk, std::string(16, '\0') + size + raw(std::uint32_t{0}) + sized("") + size + chunk);
  text += mcap::record(Op::kDataEnd, raw(std::uint32_t{0}));
  text += mcap::record(Op::kFooter, std::string(20, '\0'));
  const test::ScratchFolder scratch;
  put(scratch.path() / "a.mcap", text + std::string(mcap::kMagic));
  const auto recording = open_mcap(scratch.path() / "a.mcap");
  EXPECT_THAT(recording->warnings(), IsEmpty());
  ASSERT_EQ(recording->topics().at(0).messages, 120U);
  for (std::size_t i = 0; i < 120; ++i) {
    EXPECT_EQ(recording->message(0, i), std::to_string(i));
    EXPECT_EQ(recording->message(0, i, 1), std::to_string(i).substr(0, 1));
  }
}

/// A flight of a second as every kind of recording.
class Packed : public testing::Test {
 protected:
  static SceneOptions options() {
    SceneOptions options = test::scene(3, 1.0, false);
    options.width = 160;
    options.height = 120;
    options.camera_rate_hz = 50;
    return options;
  }
  void write(const std::string& name) { ASSERT_TRUE(write_recording(flight_, path(name))); }
  [[nodiscard]] fs::path path(const std::string& name) const { return scratch_.path() / name; }
  static bool run(const std::string& command) { return std::system(command.c_str()) == 0; }

  /// The file with each of its chunks packed by a program, and no index.
  static std::string repacked(const std::string& text, const std::string& compression,
                              const std::string& command, const fs::path& scratch) {
    std::string out(mcap::kMagic);
    for (std::size_t at = out.size(); at < text.size() - mcap::kMagic.size();) {
      std::uint64_t size = 0;
      std::memcpy(&size, text.data() + at + 1, sizeof size);
      const auto op = static_cast<mcap::Op>(text[at]);
      std::string content = text.substr(at + mcap::kRecordHead, size);
      at += mcap::kRecordHead + size;
      if (op == mcap::Op::kMessageIndex) continue;
      if (op == mcap::Op::kChunk) {
        constexpr std::size_t kFixed = 8 + 8 + 8 + 4;
        put(scratch / "plain", content.substr(kFixed + 4 + 8));
        if (!run(command + " <" + (scratch / "plain").string() + " >" +
                 (scratch / "packed").string())) {
          return "";
        }
        const std::string packed = text_of(scratch / "packed");
        content = content.substr(0, kFixed) + mcap::sized(compression) +
                  mcap::raw(std::uint64_t{packed.size()}) + packed;
      }
      if (op == mcap::Op::kDataEnd) {
        out += mcap::record(op, mcap::raw(std::uint32_t{0}));
        out += mcap::record(mcap::Op::kFooter, std::string(20, '\0'));
        break;
      }
      out += mcap::record(op, content);
    }
    return out + std::string(mcap::kMagic);
  }

  void expect_same(const Sequence& read) const {
    EXPECT_THAT(read.warnings, IsEmpty());
    ASSERT_EQ(read.frames.size(), flight_.frames.size());
    ASSERT_EQ(read.imu.size(), flight_.imu.size());
    EXPECT_EQ(read.truth.size(), flight_.truth.size());
    for (std::size_t i = 0; i < read.frames.size(); ++i) {
      EXPECT_EQ(read.frames[i].time, flight_.frames[i].time);
      EXPECT_EQ(read.image(i, 0).pixels, flight_.image(i, 0).pixels);
    }
    for (std::size_t i = 0; i < read.imu.size(); ++i) {
      EXPECT_EQ(read.imu[i].gyro_rad_s, flight_.imu[i].gyro_rad_s);
    }
  }

  const test::ScratchFolder scratch_;
  const Sequence flight_ = generate_sequence(options());
};

/// All messages of @p from whose times are in [begin, end).
/// @param packed  Each by zstd.
void copy_part(const Recording& from, RecordingWriter& out, Nanos begin, Nanos end,
               bool packed = false) {
  for (std::size_t t = 0; t < from.topics().size(); ++t) {
    const Topic& topic = from.topics()[t];
    for (std::size_t i = 0; i < topic.messages; ++i) {
      const Nanos time = from.time(t, i);
      if (time < begin || time >= end) continue;
      const std::string message = from.message(t, i);
      out.write(topic.name, topic.type, time, packed ? pack("zstd", message, "f") : message);
    }
  }
  out.publish();
}

TEST_F(Packed, ChunksOfMcapAreUnpacked) {
  write("a.mcap");
  const std::pair<std::string, std::string> ways[] = {{"lz4", "lz4 -q"}, {"zstd", "zstd -q"}};
  for (const auto& [compression, command] : ways) {
    const std::string text =
        repacked(text_of(path("a.mcap")), compression, command, scratch_.path());
    if (text.empty()) GTEST_SKIP() << "there is no " << command;
    put(path("packed.mcap"), text);
    expect_same(read_sequence(path("packed.mcap")));
    // A byte of a chunk: that one is left out, and said.
    std::string damaged = text;
    damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 4);
    put(path("packed.mcap"), damaged);
    EXPECT_THAT(open_recording(path("packed.mcap"))->warnings().front(),
                AllOf(HasSubstr("a chunk of"), HasSubstr("is left out"), HasSubstr(compression)));
  }
}

TEST_F(Packed, WhatIsSmallIsUnpackedOnce) {
  write("a.mcap");
  const auto plain = open_recording(path("a.mcap"));
  const Nanos middle = flight_.frames[flight_.frames.size() / 2].time;
  fs::create_directory(path("s"));
  copy_part(*plain, *make_mcap(path("s/0.mcap"), best_compression()), Nanos::zero(), middle);
  copy_part(*plain, *make_mcap(path("s/1.mcap"), best_compression()), middle, Nanos::max());
  put(path("s/metadata.yaml"),
      "rosbag2_bagfile_information:\n  relative_file_paths:\n    - 0.mcap\n    - 1.mcap\n");
  const Sequence read = read_sequence(path("s"));
  // Nothing is left to unpack.
  for (const char* part : {"s/0.mcap", "s/1.mcap"}) fs::resize_file(path(part), 0);
  expect_same(read);
}

TEST(ChunkCache, MakesRoomBeforeItUnpacks) {
  ChunkCache cache;
  const int files[2] = {};
  std::weak_ptr<const std::string> first = cache.get(
      &files[0], 7, kMostChunkBytes / 2, [] { return std::string(kMostChunkBytes / 2, 'a'); });
  EXPECT_EQ(cache.get(&files[1], 7, 1, [] { return std::string("b"); })->front(), 'b');
  const auto keep = [] { return std::string("unpacked again"); };
  EXPECT_EQ(cache.get(&files[0], 7, kMostChunkBytes / 2, keep)->front(), 'a');
  const auto fail = []() -> std::string { throw_bad_input("it is damaged"); };
  const std::string damaged =
      bad_input([&] { static_cast<void>(cache.get(&files[1], 9, 1, fail)); });
  EXPECT_EQ(bad_input([&] { static_cast<void>(cache.get(&files[1], 9, 1, keep)); }), damaged);
  static_cast<void>(cache.get(&files[1], 8, kMostChunkBytes, [&] {
    EXPECT_TRUE(first.expired());
    return std::string("c");
  }));
}

TEST_F(Packed, FileOfMcapThatIsCutIsReadAsFarAsItIsWhole) {
  write("a.mcap");
  const std::string text = text_of(path("a.mcap"));
  put(path("a.mcap"), text.substr(0, 20));
  EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(path("a.mcap"))); }),
              AllOf(HasSubstr("no pictures"), HasSubstr("is not whole")));
  // As a recorder leaves it that was killed, on a file system of capitals.
  put(path("A.MCAP.active"), text.substr(0, text.size() - 100'000));
  const auto recording = open_recording(path("A.MCAP.active"));
  EXPECT_THAT(recording->warnings().front(),
              AllOf(HasSubstr("is not whole"), HasSubstr("messages")));
  EXPECT_EQ(recording->of_type("sensor_msgs/Imu").size(), 1U);
  // As a file system leaves it where power was lost: as long as it was, and zeros in place of its
  // end.
  put(path("zeros.mcap"), text.substr(0, text.size() - 100'000) + std::string(100'000, '\0'));
  const auto zeros = open_recording(path("zeros.mcap"));
  EXPECT_EQ(zeros->describe(), recording->describe());
  EXPECT_THAT(zeros->warnings(), testing::Contains(HasSubstr("is not whole")));
}

TEST_F(Packed, FileOfZstdIsUnpackedAndLeavesNothing) {
  write("a.db3");
  if (!run("zstd -q " + path("a.db3").string() + " -o " + path("a.db3.zstd").string()))
    GTEST_SKIP() << "there is no zstd";
  fs::remove(path("a.db3"));
  const fs::path temporary = path("tmp");
  fs::create_directory(temporary);
  ::setenv("TMPDIR", temporary.c_str(), 1);
  expect_same(read_sequence(path("a.db3.zstd")));
  ::unsetenv("TMPDIR");
  EXPECT_TRUE(fs::is_empty(temporary));
}

TEST_F(Packed, WhatZstdPackedMayUnpackToWholePieces) {
  if (best_compression() != "zstd") GTEST_SKIP() << "built without zstd";
  constexpr std::size_t kPiece = std::size_t{256} << 10;
  for (const std::size_t size : {kPiece - 1, kPiece, kPiece + 1, 2 * kPiece, 3 * kPiece}) {
    const std::string plain(size, 'a');
    const std::string packed = pack("zstd", plain, "f");
    EXPECT_TRUE(unpack_message(packed, "f") == plain) << size;
    const auto read = [rest = packed](std::size_t) mutable { return std::exchange(rest, {}); };
    EXPECT_TRUE(unpack("zstd", read, size, "f") == plain) << size;
  }
  write("a.db3");
  std::string text = text_of(path("a.db3"));
  text.resize((text.size() / kPiece + 1) * kPiece);
  put(path("b.db3.zstd"), pack("zstd", text, "b.db3.zstd"));
  expect_same(read_sequence(path("b.db3.zstd")));
}

TEST_F(Packed, MessagesAreUnpackedOneByOne) {
  if (best_compression() != "zstd") GTEST_SKIP() << "built without zstd";
  write("a.db3");
  const auto plain = open_recording(path("a.db3"));
  copy_part(*plain, *make_db3(path("p.db3")), Nanos::zero(), Nanos::max(), true);
  copy_part(*plain, *make_mcap(path("p.mcap")), Nanos::zero(), Nanos::max(), true);
  for (const char* name : {"p.db3", "p.mcap"}) {
    EXPECT_EQ(open_recording(path(name))->message(0, 0, 10), plain->message(0, 0, 10)) << name;
    expect_same(read_sequence(path(name)));
  }
}

TEST_F(Packed, MessagesThatAreDamagedAreLeftOutOfABag) {
  write("a.bag");
  std::string text = text_of(path("a.bag"));
  const std::string kind = bag::op_field(bag::Op::kMessage);
  std::size_t at = text.size() / 2;
  for (int i = 0; i < 4; ++i) {  // of which some are the IMU's
    at = text.find(kind, at);
    ASSERT_NE(at, std::string::npos);
    text[at + kind.size() - 1] = 9;
  }
  put(path("a.bag"), text);
  const Sequence read = read_sequence(path("a.bag"));
  EXPECT_LT(read.imu.size(), flight_.imu.size());
  EXPECT_GE(read.imu.size() + 4, flight_.imu.size());
  EXPECT_GE(read.frames.size() + 1, flight_.frames.size());
  EXPECT_THAT(read.warnings, testing::Contains(AllOf(HasSubstr("messages of /imu0 are left out"),
                                                     HasSubstr("leads to no message"))));
}

TEST_F(Packed, AChunkThatIsDamagedIsLeftOutOfALargeFile) {
  write("a.mcap");
  std::string text = text_of(path("a.mcap"));
  text[text.size() / 2] = static_cast<char>(text[text.size() / 2] ^ 4);
  put(path("a.mcap"), text);
  const auto recording = open_mcap(path("a.mcap"), 0);
  std::vector<Recording::Wanted> all;
  for (std::size_t i = 0; i < recording->topics().size(); ++i) all.push_back({i});
  std::size_t whole = 0, damaged = 0;
  recording->walk(all, [&](std::size_t, std::size_t, const Recording::Load& load) {
    try {
      static_cast<void>(load());
      ++whole;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("checksum"));
      ++damaged;
    }
  });
  EXPECT_GT(whole, 0U);
  EXPECT_GT(damaged, 0U);
}

TEST_F(Packed, PartsOfAFolderAreOne) {
  write("whole.db3");
  const auto whole = open_recording(path("whole.db3"));
  const Nanos middle = flight_.frames[flight_.frames.size() / 2].time;
  for (const std::string ending : {".db3", ".mcap"}) {
    const fs::path folder = path("rec" + ending.substr(1));
    fs::create_directory(folder);
    const auto part = [&](const std::string& name) {
      const fs::path file = folder / (name + ending);
      return ending == ".db3" ? make_db3(file) : make_mcap(file);
    };
    copy_part(*whole, *part("a_0"), Nanos::zero(), middle);
    copy_part(*whole, *part("a_1"), middle, Nanos::max());
    EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(folder)); }),
                AllOf(HasSubstr("2 recordings"), HasSubstr("metadata.yaml")));
    const auto metadata = [&](const std::string& last) {
      put(folder / "metadata.yaml",
          "rosbag2_bagfile_information:\n  relative_file_paths:\n    - a_0" + ending +
              "\n    - old_folder/" + last + ending + "\n");
    };
    metadata("a_1");
    expect_same(read_sequence(folder));
    if (best_compression() == "zstd") {
      const fs::path part_file = folder / ("a_1" + ending);
      const fs::path packed = part_file.string() + ".zst";
      const std::string plain = text_of(part_file);
      put(packed, pack("zstd", plain, "f"));
      fs::remove(part_file);
      expect_same(read_sequence(folder));
      fs::remove(packed);
      put(part_file, plain);
    }
    metadata("a_2");
    EXPECT_THAT(
        bad_input([&] { static_cast<void>(read_sequence(folder)); }),
        AllOf(HasSubstr("metadata.yaml:4"), HasSubstr("a_2" + ending), HasSubstr("missing")));
    // It was unpacked since, and another recording lies beside it.
    put(folder / "metadata.yaml",
        "rosbag2_bagfile_information:\n  relative_file_paths:\n    - a_0" + ending + ".zstd\n");
    const auto first = open_recording(folder);
    EXPECT_EQ(first->file(), (folder / ("a_0" + ending)).string());
    EXPECT_THAT(first->warnings(), testing::ElementsAre(AllOf(HasSubstr("a_1" + ending),
                                                              HasSubstr("does not name it"))));
    for (const char* name : {"a_0", "a_1"}) fs::remove(folder / (name + ending));
    EXPECT_THAT(bad_input([&] { static_cast<void>(read_sequence(folder)); }),
                AllOf(HasSubstr("metadata.yaml:3"), HasSubstr("missing")));
  }
}

TEST_F(Packed, APartThatIsNoFileIsRefused) {
  fs::create_directory(path("rec"));
  put(path("rec/a_0.mcap"), "not even one");
  for (const std::string part : {"\"\"", "a_0.mcap/", ".", ".."}) {
    put(path("rec/metadata.yaml"),
        "rosbag2_bagfile_information:\n  relative_file_paths:\n    - " + part + "\n");
    EXPECT_THAT(bad_input([&] { static_cast<void>(open_recording(path("rec"))); }),
                AllOf(HasSubstr("metadata.yaml:3"), HasSubstr("no file")));
  }
}

TEST_F(Packed, AMetadataFileOfNothingIsAsNone) {
  fs::create_directory(path("rec"));
  write("rec/a_0.mcap");
  for (const std::string& text : {std::string(), std::string(64, '\0')}) {
    put(path("rec/metadata.yaml"), text);
    EXPECT_EQ(open_recording(path("rec"))->file(), path("rec/a_0.mcap").string());
  }
}

TEST_F(Packed, OneFlightIsTheSameTrajectoryToTheByteHoweverItIsRecorded) {
  SceneOptions scene = test::scene(3, 2.0, true);
  scene.width = 320;
  scene.height = 240;
  write_euroc(generate_sequence(scene), path("folder"), 1);
  const Sequence folder = read_sequence(path("folder"));
  const auto trajectory = [&](const fs::path& file) {
    const Sequence sequence = read_sequence(file);
    EXPECT_EQ(sequence.frames.size(), folder.frames.size()) << file;
    slam::RunOptions options;
    options.setup = slam::setup_of(sequence);
    const auto result = slam::run_serially(sequence, options);
    EXPECT_GT(result.trajectory().size(), 20U) << file;
    return tum_text(result.trajectory());
  };
  const std::string expected = trajectory(path("folder"));
  for (const char* name : {"a.bag", "a.db3", "a.mcap"}) {
    ASSERT_TRUE(write_recording(folder, path(name)));
    EXPECT_EQ(trajectory(path(name)), expected) << name;
  }
  const auto plain = open_recording(path("a.mcap"));
  const Nanos middle = folder.frames[folder.frames.size() / 2].time;
  for (const std::string compression : {"lz4", "zstd"}) {
    const auto name = compression + ".mcap";
    copy_part(*plain, *make_mcap(path(name), compression), Nanos::zero(), Nanos::max());
    EXPECT_LT(fs::file_size(path(name)), fs::file_size(path("a.mcap")));
    EXPECT_EQ(trajectory(path(name)), expected) << name;
    // Where all chunks are packed, and where the index is all that is read of it when it is opened.
    EXPECT_EQ(open_mcap(path(name), 0)->describe(), plain->describe());
  }
  fs::create_directory(path("split"));
  copy_part(*plain, *make_mcap(path("split/s_0.mcap"), "zstd"), Nanos::zero(), middle);
  copy_part(*plain, *make_mcap(path("split/s_1.mcap")), middle, Nanos::max());
  put(path("split/metadata.yaml"),
      "rosbag2_bagfile_information:\n  relative_file_paths:\n    - s_0.mcap\n    - s_1.mcap\n");
  EXPECT_EQ(trajectory(path("split")), expected);
}

TEST_F(Packed, ForeignDatabaseRunsNoProgram) {
  const fs::path file = path("view.db3");
  if (!run("sqlite3 " + file.string() +
           " \"CREATE TABLE topics(id, name, type, serialization_format);"
           "CREATE VIEW messages AS WITH RECURSIVE r(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM "
           "r)"
           " SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM r;\"")) {
    GTEST_SKIP() << "there is no sqlite3";
  }
  EXPECT_THAT(bad_input([&] { static_cast<void>(open_recording(file)); }),
              AllOf(HasSubstr("view.db3"), HasSubstr("no recording of ROS 2")));
}

TEST_F(Packed, WhatARecorderLeftBesideItsDatabaseIsRead) {
  write("a.db3");
  const fs::path live = path("live.db3");
  // The log of a connection that is not closed: copied while it is open.
  if (!run("cd " + scratch_.path().string() +
           " && cp a.db3 live.db3 && sqlite3 live.db3 'PRAGMA journal_mode=WAL;' >/dev/null &&"
           " sqlite3 live.db3 \"PRAGMA wal_autocheckpoint=0; DELETE FROM messages WHERE id < 10;\""
           " '.shell mkdir kept && cp live.db3 live.db3-wal kept' >/dev/null")) {
    GTEST_SKIP() << "there is no sqlite3";
  }
  const auto count = [](const Recording& recording) {
    std::size_t messages = 0;
    for (const Topic& topic : recording.topics()) messages += topic.messages;
    return messages;
  };
  const fs::path kept = path("kept") / "live.db3";
  ASSERT_GT(fs::file_size(kept.string() + "-wal"), 0U);
  EXPECT_EQ(count(*open_recording(kept)) + 9, count(*open_recording(path("a.db3"))));
  EXPECT_EQ(std::distance(fs::directory_iterator(path("kept")), {}), 2);
}

TEST(Rosbag2, RecordingsAreReadByWhatTheyHold) {
  PIRT_DATA_OR_SKIP(folder, "rosbag2-recordings");
  for (const char* storage : {"mcap", "sqlite3"}) {
    const auto split = open_recording(folder / storage / "wbag");
    EXPECT_EQ(split->topics().size(), 8U) << storage;
    std::size_t messages = 0;
    for (std::size_t t = 0; t < split->topics().size(); ++t) {
      messages += split->topics()[t].messages;
      for (std::size_t i = 0; i < split->topics()[t].messages; ++i) {
        EXPECT_FALSE(split->message(t, i).empty());
      }
    }
    EXPECT_EQ(messages, 6074U) << storage;
    EXPECT_EQ(open_recording(folder / storage / "talker")->topics().size(), 3U) << storage;
    EXPECT_THAT(
        bad_input([&] { static_cast<void>(read_sequence(folder / storage / "wrong_rmw_test")); }),
        HasSubstr("has no pictures"))
        << storage;
    const auto cdr = open_recording(folder / storage / "cdr_test");
    EXPECT_THAT(cdr->describe(), AllOf(HasSubstr("/array_topic (test_msgs/Arrays, 4)"),
                                       HasSubstr("/test_topic (test_msgs/BasicTypes, 3)")));
    EXPECT_FALSE(cdr->message(0, 3).empty());
  }
  EXPECT_THAT(open_recording(folder / "sqlite3" / "empty_bag")->describe(),
              HasSubstr("/rosout (rcl_interfaces/Log, 0)"));
  const auto services = open_recording(folder / "mcap" / "topics_and_services.mcap");
  const auto calls = services->topic("/add_two_ints/_service_event");
  EXPECT_EQ(services->topics()[calls].messages, 6U);
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(read_sequence(folder / "mcap" / "topics_and_services.mcap"));
              }),
              HasSubstr("has no pictures"));
}

}  // namespace
}  // namespace pirt
