// pirt describe as its user runs it.
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/data.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

class Recognition : public testing::Test {
 protected:
  void SetUp() override {
    PIRT_DATA_OR_SKIP(photos, "photos-darknet");
    PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
    PIRT_DATA_OR_SKIP(squeezenet, "squeezenet-v1.0-deepcompressed");
    photos_ = photos.string() + "/";
    yolo_ = yolo.string() + "/";
    squeezenet_ = squeezenet.string() + "/";
  }

  [[nodiscard]] Outcome run_with_yolo(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"describe",
                                          "--model",
                                          yolo_ + "yolo-fastest-1.1.weights",
                                          "--config",
                                          yolo_ + "yolo-fastest-1.1.cfg",
                                          "--names",
                                          yolo_ + "coco.names"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return pirt(arguments);
  }

  std::string photos_, yolo_, squeezenet_;
};

TEST_F(Recognition, DetectsInAFileAndInAFolder) {
  const auto outcome = run_with_yolo({photos_ + "dog.jpg"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(outcome.json().at("objects").at(0).at("name"), "car");
  const auto table = run_with_yolo({photos_, "--table"});
  EXPECT_THAT(table.out, HasSubstr("picture"));
  EXPECT_THAT(table.out, HasSubstr("person"));
}

TEST_F(Recognition, DescribesAsJsonLines) {
  const Scratch scratch;
  const auto outcome =
      run_with_yolo({photos_, "-o", scratch.file("s.jsonl"), "--classifier",
                     squeezenet_ + "squeezenet_v1.0_dc.caffemodel", "--classifier-config",
                     squeezenet_ + "SqueezeNet_deploy.prototxt", "--classifier-names",
                     squeezenet_ + "imagenet1000_wnid_name.txt", "--labels", "2"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(slurp(scratch.file("s.jsonl")));
  std::vector<nlohmann::json> scenes;
  for (std::string line; std::getline(lines, line);) {
    scenes.push_back(nlohmann::json::parse(line));
  }
  ASSERT_EQ(scenes.size(), 3U);
  EXPECT_THAT(scenes[1].at("image"), HasSubstr("eagle.jpg"));
  EXPECT_EQ(scenes[1].at("labels").size(), 2U);
}

TEST_F(Recognition, LeavesOutAPictureThatCannotBeRead) {
  const Scratch scratch;
  const std::string dog = photos_ + "dog.jpg";
  const std::string cut = scratch.write("cut.jpg", slurp(dog).substr(0, 5000));
  const auto few = run_with_yolo({cut, dog, dog});
  EXPECT_EQ(few.exit_code, 4);
  EXPECT_EQ(std::ranges::count(few.out, '\n'), 2);
  EXPECT_THAT(few.err, testing::AllOf(HasSubstr("cut.jpg"), HasSubstr("1 of 3 pictures")));
  std::vector<std::string> many(20, dog);
  many.push_back(cut);
  const auto most = run_with_yolo(many);
  EXPECT_EQ(most.exit_code, 0);
  EXPECT_EQ(std::ranges::count(most.out, '\n'), 20);
  EXPECT_THAT(most.err, HasSubstr("cut.jpg"));
}

TEST_F(Recognition, RefusesWhatIsNoModelOrNoPicture) {
  const Scratch scratch;
  expect_refused(run_with_yolo({scratch.write("a.jpg", "x")}), {"a.jpg", "neither"});
  expect_refused(run_with_yolo({scratch.file("none.jpg")}), {"none.jpg"});
  expect_refused(pirt({"describe", "--model", scratch.write("m.onnx", "no model"), "--size", "8x8",
                       photos_ + "dog.jpg"}),
                 {"m.onnx", "ONNX"});
  expect_refused(pirt({"describe", "--model", scratch.file("m.onnx"), "--size", "8", photos_}),
                 {"WIDTHxHEIGHT"});
  expect_refused(pirt({"describe", photos_}), {"--model"});
  expect_refused(pirt({"detect", photos_}), {"pirt describe --table"});
}

}  // namespace
}  // namespace pirt::test
