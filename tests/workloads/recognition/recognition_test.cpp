// Users' models: what real ones see in real photos, what their outputs mean, and files that are no
// models.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <thread>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/own.h"
#include "workloads/recognition/describe_scene.h"
#include "workloads/recognition/opencv_threads.h"

namespace pirt::recognition {
namespace {

using test::bad_input;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::UnorderedElementsAre;

namespace fs = std::filesystem;

ModelOptions yolo(const fs::path& folder) {
  return {folder / "yolo-fastest-1.1.weights", folder / "yolo-fastest-1.1.cfg",
          folder / "coco.names"};
}

ModelOptions squeezenet(const fs::path& folder) {
  return {folder / "squeezenet_v1.0_dc.caffemodel", folder / "SqueezeNet_deploy.prototxt",
          folder / "imagenet1000_wnid_name.txt"};
}

std::vector<std::string> names_of(const auto& found) {
  std::vector<std::string> names;
  for (const auto& item : found) names.push_back(item.name);
  return names;
}

TEST(DetectObjects, FindsWhatThePhotosShow) {
  PIRT_DATA_OR_SKIP(photos, "photos-darknet");
  PIRT_DATA_OR_SKIP(model, "yolo-fastest-1.1");
  Model detector(yolo(model));
  EXPECT_EQ(detector.width(), 320);
  const auto dog = detect_objects(detector, rgb_pixels(photos / "dog.jpg"), {});
  EXPECT_THAT(names_of(dog), UnorderedElementsAre("car", "dog", "bicycle"));
  EXPECT_THAT(names_of(detect_objects(detector, rgb_pixels(photos / "person.jpg"), {})),
              IsSupersetOf({"person", "dog"}));  // and takes the horse for a sheep
  // The dog sits in the lower left of 768x576 pixels.
  const auto box = std::ranges::find(dog, "dog", &Detection::name)->box;
  EXPECT_NEAR(box.x, 130, 40);
  EXPECT_NEAR(box.y + box.height, 545, 40);
}

TEST(DetectObjects, ReadsWeightsOfBothOfDarknetsHeaders) {
  PIRT_DATA_OR_SKIP(photos, "photos-darknet");
  PIRT_DATA_OR_SKIP(folder, "yolo-fastest-1.1");
  const fs::path file = testing::TempDir() + "/pirt-old-" + std::to_string(::getpid()) + ".weights";
  // Version 0.1 has 4 bytes for the pictures of its training, where 0.2 has 8.
  std::string weights = read_file(folder / "yolo-fastest-1.1.weights");
  weights.replace(0, 20, std::string("\0\0\0\0\1\0\0\0\0\0\0\0\0\1\0\0", 16));
  std::ofstream(file, std::ios::binary) << weights;
  ModelOptions options = yolo(folder);
  options.model = file;
  Model detector(options);
  EXPECT_THAT(names_of(detect_objects(detector, rgb_pixels(photos / "dog.jpg"), {})),
              UnorderedElementsAre("car", "dog", "bicycle"));
  fs::remove(file);
}

TEST(DescribeScene, GivesObjectsAndLabels) {
  PIRT_DATA_OR_SKIP(photos, "photos-darknet");
  PIRT_DATA_OR_SKIP(yolo_folder, "yolo-fastest-1.1");
  PIRT_DATA_OR_SKIP(squeezenet_folder, "squeezenet-v1.0-deepcompressed");
  Model detector(yolo(yolo_folder));
  Model classifier(squeezenet(squeezenet_folder));
  const auto describe = [&](const std::string& name) {
    return describe_scene(name, rgb_pixels(photos / name), detector, &classifier, {}, 2);
  };
  EXPECT_THAT(names_of(describe("eagle.jpg").labels), testing::Contains(HasSubstr("bald eagle")));
  const auto dog = describe("dog.jpg");
  EXPECT_THAT(names_of(dog.labels), testing::Contains(HasSubstr("malamute")));

  const auto json = to_json(dog);
  EXPECT_EQ(json.at("image"), "dog.jpg");
  EXPECT_EQ(json.at("width"), 768);
  EXPECT_EQ(json.at("objects").size(), 3U);
  EXPECT_EQ(json.at("objects").at(0).at("box").size(), 4U);
  EXPECT_EQ(json_text(json).find('\n'), std::string::npos);
}

TEST(DescribeScene, SaysPlacesInWords) {
  EXPECT_EQ(place_of({0, 0, 10, 10}, 90, 90), "upper left");
  EXPECT_EQ(place_of({40, 40, 10, 10}, 90, 90), "centre");
  EXPECT_EQ(place_of({40, 80, 10, 10}, 90, 90), "lower");
  EXPECT_EQ(place_of({80, 40, 10, 10}, 90, 90), "right");
}

TEST(SuppressOverlaps, KeepsTheBestOfEachClass) {
  // The second shares 0.8 / 1.2 of its union with the first, the third as much, but is of another
  // class; the fourth is of another class and the same box; the fifth shares nothing; the last is
  // no box.
  const auto kept = suppress_overlaps({{1, 0.6, 0.02, 0, 0.12, 0.1},
                                       {1, 0.9, 0, 0, 0.1, 0.1},
                                       {2, 0.5, 0.02, 0, 0.12, 0.1},
                                       {3, 0.7, 0, 0, 0.1, 0.1},
                                       {1, 0.4, 0.5, 0.5, 1.7, 0.8},
                                       {1, 0.8, 0.5, 0.5, 0.5, 0.8}},
                                      {});
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_EQ(kept[0].score, 0.9);
  EXPECT_EQ(kept[1].score, 0.5);
  EXPECT_EQ(kept[2].right, 1) << "what lies outside the picture is cut off";
}

/// Protocol buffers by hand: a key is field * 8 + kind, kind 0 a number and 2 bytes with a length.
std::string number(int field, std::uint64_t value) {
  std::string text(1, static_cast<char>(field * 8));
  for (; value >= 128; value /= 128) text += static_cast<char>(value % 128 + 128);
  return text + static_cast<char>(value);
}
std::string bytes(int field, const std::string& value) {
  std::string text = number(field, value.size());
  text[0] = static_cast<char>(field * 8 + 2);
  return text + value;
}
std::string tensor_info(const std::string& name, const std::vector<int>& shape) {
  std::string dims;
  for (const int extent : shape) {
    dims += bytes(1, number(1, static_cast<std::uint64_t>(extent)));
  }
  return bytes(1, name) + bytes(2, bytes(1, number(1, 1) + bytes(2, dims)));
}
std::string node(const std::string& input, const std::string& output, const std::string& type) {
  return bytes(1, bytes(1, input) + bytes(2, output) + bytes(3, output) + bytes(4, type));
}

/// A model that averages each channel: its classes are red, green and blue.
std::string mean_colour_onnx() {
  const std::string graph = node("image", "mean", "GlobalAveragePool") +
                            node("mean", "scores", "Flatten") + bytes(2, "g") +
                            bytes(11, tensor_info("image", {1, 3, 8, 8})) +
                            bytes(12, tensor_info("scores", {1, 3}));
  return number(1, 7) + bytes(7, graph) + bytes(8, bytes(1, "") + number(2, 13));
}

class Models : public testing::Test {
 protected:
  Models() : folder_(testing::TempDir() + "/pirt-models-" + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~Models() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  static std::string refused(const ModelOptions& options) {
    return bad_input([&] { const Model model(options); });
  }
  fs::path folder_;
};

Tensor plain(int red, int green, int blue) {
  Tensor image({"image", Element::kU8, {3, 20, 10}});
  const auto pixels = image.as<std::uint8_t>();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<std::uint8_t>(i < 200 ? red : i < 400 ? green : blue);
  }
  return image;
}

TEST_F(Models, OfOnnxRun) {
  ModelOptions options{write("m.onnx", mean_colour_onnx()), std::nullopt,
                       write("m.names", "red\ngreen\nblue\n")};
  EXPECT_THAT(refused(options), HasSubstr("--size"));
  options.size = {{8, 8}};
  Model model(options);
  const auto outputs = model.run(plain(255, 51, 0), Fit::kStretch);
  ASSERT_EQ(outputs.size(), 1U);
  EXPECT_THAT(outputs[0].shape, ElementsAre(1, 3));
  EXPECT_NEAR(outputs[0].values[0], 1, 1e-6);
  EXPECT_NEAR(outputs[0].values[1], 0.2, 1e-6);
  EXPECT_THAT(names_of(classify(model, plain(0, 10, 250), 2)), ElementsAre("blue", "green"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(detect_objects(model, plain(0, 0, 0), {})); }),
              AllOf(HasSubstr("no detector"), HasSubstr("[1, 3]")));
}

/// OpenCV's count of threads, which the process has again afterwards.
class CountOfThreads {
 public:
  explicit CountOfThreads(int count) { cv::setNumThreads(count); }
  ~CountOfThreads() { cv::setNumThreads(before_); }
  CountOfThreads(const CountOfThreads&) = delete;
  CountOfThreads& operator=(const CountOfThreads&) = delete;

 private:
  int before_ = cv::getNumThreads();
};

TEST_F(Models, OfOneThreadLeaveTheCountAsItWas) {
  const CountOfThreads four(4);
  const auto file = write("m.onnx", mean_colour_onnx());
  const auto run = [&file] {
    ModelOptions options{file, std::nullopt, std::nullopt, {{8, 8}}};
    options.threads = 1;
    Model model(options);
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(model.run(plain(1, 2, 3), Fit::kStretch).size(), 1U);
    }
  };
  { const std::jthread one(run), other(run); }
  EXPECT_EQ(cv::getNumThreads(), 4);
}

// A kernel that computes on the calling thread meanwhile gets its own count afterwards.
TEST(OpencvThreads, AreANetworksAsLongAsItRuns) {
  const CountOfThreads four(4);
  {
    const OpencvThreads two(2);
    compute_on_calling_thread();
    EXPECT_EQ(cv::getNumThreads(), 2);
  }
  EXPECT_EQ(cv::getNumThreads(), 1);
}

TEST_F(Models, RefuseImagesOfAWrongDepthOrShape) {
  Model model({write("m.onnx", mean_colour_onnx()), std::nullopt, std::nullopt, {{8, 8}}});
  const auto run = [&](const TensorSpec& spec) {
    return bad_input([&] { static_cast<void>(model.run(Tensor(spec), Fit::kCrop)); });
  };
  EXPECT_THAT(run({"image", Element::kI16, {3, 8, 8}}), HasSubstr("i16[3,8,8]"));
  EXPECT_THAT(run({"image", Element::kU8, {4, 8, 8}}), HasSubstr("u8[4,8,8]"));
  EXPECT_THAT(run({"image", Element::kU8, {8, 8}}), HasSubstr("u8[8,8]"));
}

// OpenCV has them in the order of their names.
TEST_F(Models, OutputsOfAWorkloadFileAreThoseThatItNames) {
  const std::string graph =
      node("image", "b", "GlobalMaxPool") + node("image", "a", "GlobalAveragePool") +
      bytes(2, "g") + bytes(11, tensor_info("image", {1, 3, 8, 8})) +
      bytes(12, tensor_info("b", {1, 3, 1, 1})) + bytes(12, tensor_info("a", {1, 3, 1, 1}));
  write("two.onnx", number(1, 7) + bytes(7, graph) + bytes(8, bytes(1, "") + number(2, 13)));
  const auto load = [this](const std::string& first, const std::string& second) {
    const std::string shape = ": \"f32[1,3,1,1]\"";
    return own::load(write("w.yaml",
                           "workloads:\n  - name: my.two\n    network: two.onnx\n"
                           "    inputs: {image: \"f32[1,3,8,8]\"}\n    outputs: {" +
                               first + shape + ", " + second + shape + "}\n"));
  };
  const Workload two = own::to_workload(load("b", "a").front());
  const auto inputs = [&two] {
    auto made = make_tensors(two.inputs);
    made[0].as<float>()[0] = 64;
    return made;
  }();
  auto outputs = make_tensors(two.outputs);
  const auto kernel = own_operation(two)->cpu({}, 1);
  kernel->bind(inputs, outputs);
  static_cast<void>(kernel->execute(1));
  EXPECT_FLOAT_EQ(outputs[0].as<float>()[0], 64) << "the largest";
  EXPECT_FLOAT_EQ(outputs[1].as<float>()[0], 1) << "the mean";
  EXPECT_THAT(bad_input([&] { static_cast<void>(load("peak", "mean")); }),
              AllOf(HasSubstr("a: f32[1,3,1,1]"), HasSubstr("b: f32[1,3,1,1]")));
}

TEST_F(Models, ThatAreNoModelsAreRefused) {
  const auto text = write("t.onnx", "this is not a model\n");
  testing::internal::CaptureStderr();
  EXPECT_THAT(refused({text, std::nullopt, std::nullopt, {{8, 8}}}),
              AllOf(HasSubstr("t.onnx"), HasSubstr("ONNX")));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_THAT(refused({write("e.onnx", ""), std::nullopt, std::nullopt, {{8, 8}}}),
              HasSubstr("e.onnx"));
  EXPECT_THAT(refused({write("t.caffemodel", "x"), write("t.prototxt", "layer {"), std::nullopt}),
              HasSubstr("--size"));
  EXPECT_THAT(refused({folder_ / "t.caffemodel", folder_ / "t.prototxt", std::nullopt, {{8, 8}}}),
              AllOf(HasSubstr("t.caffemodel"), HasSubstr("Caffe")));
  EXPECT_THAT(refused({write("m.pt", "x")}), AllOf(HasSubstr("m.pt"), HasSubstr(".onnx")));
  EXPECT_THAT(refused({write("m.weights", "x")}), HasSubstr("--config"));
  EXPECT_THAT(refused({folder_ / "none.onnx"}), HasSubstr("none.onnx"));
  EXPECT_THAT(refused({text, write("a.cfg", "x")}), HasSubstr("leave out"));
}

TEST_F(Models, OfDarknetThatAreCutOffAreRefused) {
  PIRT_DATA_OR_SKIP(folder, "yolo-fastest-1.1");
  auto options = yolo(folder);
  const auto weights = read_file(options.model);
  options.model = write("cut.weights", weights.substr(0, weights.size() - 4));
  EXPECT_THAT(refused(options), HasSubstr("bytes where its configuration needs"));
  options.model = write("long.weights", weights + "four");
  EXPECT_NO_THROW(static_cast<void>(Model(options))) << "OpenCV takes it";
  options.model =
      write("nan.weights", weights.substr(0, 20) + std::string(weights.size() - 20, '\xff'));
  EXPECT_THAT(refused(options), HasSubstr("no numbers"));
  options.model = write("odd.weights", "\xff\xff\xff\xff" + weights.substr(4));
  EXPECT_THAT(refused(options), HasSubstr("version -1.2"));
  options.model = write("cut.weights", "");
  EXPECT_THAT(refused(options), HasSubstr("cut.weights"));
  options = yolo(folder);
  options.config = write("t.cfg", "[net]\nwidth=320\nheight=320\n[nonsense]\n");
  EXPECT_THAT(refused(options), HasSubstr("t.cfg"));
}

TEST_F(Models, NamesHaveToBeAsManyAsClasses) {
  ModelOptions options{write("m.onnx", mean_colour_onnx()),
                       std::nullopt,
                       write("m.names", "red\ngreen\n"),
                       {{8, 8}}};
  Model model(options);
  EXPECT_THAT(bad_input([&] { static_cast<void>(classify(model, plain(1, 2, 3), 1)); }),
              AllOf(HasSubstr("3 classes"), HasSubstr("2 names")));
  options.names = write("n.names", "red\n\nblue\n");
  EXPECT_THAT(refused(options), HasSubstr("n.names:2:"));
}

}  // namespace
}  // namespace pirt::recognition
