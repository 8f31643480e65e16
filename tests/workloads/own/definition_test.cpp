#include "workloads/own/definition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/own/guarded_memory.h"

namespace pirt::own {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

Definition blur() {
  Definition made;
  made.name = "mine.blur";
  made.source = "/robot/libmine.so";
  made.digest = "0123456789abcdef";
  made.inputs = {tensor_from("image", "u8[height,width]")};
  made.outputs = {tensor_from("blurred", "u8[height,width]"), tensor_from("list", "f32[<=7,2]")};
  made.state = {tensor_from("mean", "f64[3]")};
  made.parameters = {tensor_from("weights", "i16[5,5]")};
  made.parameters.front().ranges = {{-3, 3}};
  made.size = Size{640, 480};
  made.frames = 3;
  made.slices = 4;
  made.ops_per_element = 50;
  made.tolerance = 0.01;
  made.backends = {"cpu"};
  return made;
}

TEST(OwnDefinition, TensorsAreReadAsTheyAreWritten) {
  for (const char* text :
       {"u8[480,640]", "f32[<=500,2]", "i16[height,width]", "f64[1]", "i32[width,height,3]"}) {
    EXPECT_EQ(tensor_text(tensor_from("t", text)), text);
  }
  EXPECT_THAT(tensor_from("t", "i16[height, 3]").shape, ElementsAre(kHeight, 3));
  for (const char* text : {"", "u8", "u8[]", "u8[0]", "u8[-1]", "u9[3]", "u8[3", "[3]", "u8[3,]",
                           "u8[depth]", "u8[3]x", "u8[9999999999999]"}) {
    SCOPED_TRACE(text);
    EXPECT_THROW(static_cast<void>(tensor_from("t", text)), Error);
  }
}

TEST(OwnDefinition, SizesAreReadAsTheyAreWritten) {
  EXPECT_EQ(size_from("1280x720"), (Size{1280, 720}));
  EXPECT_EQ(to_string(Size{1280, 720}), "1280x720");
  for (const char* text : {"", "x", "1280", "1280x", "x720", "0x720", "1280x720x3", "1280X720",
                           " 1280x720", "+1x1", "100000x1"}) {
    EXPECT_FALSE(size_from(text)) << text;
  }
}

TEST(OwnDefinition, IsTheSameFromText) {
  const Json json = to_json(blur());
  const Definition read = definition_from(parse_json(json_text(json)));
  EXPECT_EQ(to_json(read), json);
  EXPECT_EQ(read.parameters.front().ranges.front().low, -3);
  EXPECT_FALSE(read.functions);
}

TEST(OwnDefinition, IsMadeForSizes) {
  const Workload plain = to_workload(blur());
  EXPECT_THAT(plain.inputs.front().shape, ElementsAre(480, 640));
  EXPECT_EQ(plain.ops, 50 * 640 * 480);
  EXPECT_EQ(own_operation(plain)->slices.size(), 4U);
  const Workload large = plain.at_size(1280, 720);
  EXPECT_THAT(large.outputs.front().shape, ElementsAre(720, 1280));
  EXPECT_THAT(large.parameters.front().shape, ElementsAre(5, 5));
  EXPECT_EQ(large.ops, 50 * 1280 * 720);
  // 4 GiB are the most of a tensor.
  EXPECT_NO_THROW(static_cast<void>(plain.at_size(65'536, 65'536)));
  Definition wide = blur();
  wide.outputs.front().element = Element::kF32;
  const Workload of_floats = to_workload(wide);
  EXPECT_THROW(static_cast<void>(of_floats.at_size(65'536, 65'536)), Error);
  wide = blur();
  wide.inputs.front().element = Element::kF64;
  const Workload from_floats = to_workload(wide);
  EXPECT_THROW(static_cast<void>(from_floats.at_size(65'536, 65'536)), Error);
}

TEST(OwnDefinition, RefusesWhatIsNone) {
  const auto refuses = [](const auto& spoil, const char* why) {
    Definition made = blur();
    spoil(made);
    EXPECT_THAT(test::bad_input([&] { check(made, "a.yaml"); }),
                AllOf(HasSubstr("a.yaml"), HasSubstr(why)));
  };
  refuses([](Definition& d) { d.name = "blur"; }, "a dot");
  refuses([](Definition& d) { d.name = "mine.bl ur"; }, "letters");
  refuses([](Definition& d) { d.name = ".blur"; }, "a dot");
  const auto computes_nothing = [](Definition& d) {
    d.outputs.clear();
    d.backends = {"cpu", "opencl"};
  };
  refuses(computes_nothing, "no output");
  refuses([](Definition& d) { d.backends.clear(); }, "no kernel");
  refuses([](Definition& d) { d.size.reset(); }, "size of its own");
  refuses([](Definition& d) { d.outputs.front().name = "image"; }, "two tensors");
  refuses([](Definition& d) { d.inputs.front().shape = {}; }, "dimensions");
  refuses([](Definition& d) { d.inputs.front().shape = {1 << 20, 1 << 20}; }, "bytes");
  refuses([](Definition& d) { d.inputs.front().ranges = {{2, 1}}; }, "range");
  refuses([](Definition& d) { d.inputs.front().ranges = {{0.2, 0.8}}; }, "range");
  refuses([](Definition& d) { d.frames = 0; }, "frames");
  refuses([](Definition& d) { d.tolerance = 2; }, "tolerance");
  refuses([](Definition& d) { d.backends = {"opencl"}; }, "lists");
}

TEST(OwnDefinition, MayHaveNoTensors) {
  Definition made = blur();
  made.inputs = made.parameters = made.outputs = made.state = {};
  const Workload alone = to_workload(definition_from(to_json(made)));
  EXPECT_TRUE(alone.outputs.empty());
  EXPECT_FALSE(alone.ops);
}

TEST(OwnDefinition, IsMeasuredWithNumbersOfItsRanges) {
  Definition made = blur();
  made.inputs = {tensor_from("bit", "u8[1000]"), tensor_from("part", "f32[1000]")};
  made.inputs[0].ranges = {{0.2, 1}};
  made.inputs[1].ranges = {{0.1, 0.1 + 3e-8}};
  made.functions = [](Size) { return Functions{}; };
  const auto images = generated_images(1);
  const Data data = to_workload(made).make_data({.seed = 1, .images = images.get(), .frame = 0});
  for (const Tensor& input : data.inputs) EXPECT_EQ(out_of_range(input), "");
}

// Of stereo or motion nothing could be seen in a picture beside itself.
TEST(OwnDefinition, IsMeasuredWithPicturesThatFollowEachOther) {
  Definition made = blur();
  made.inputs = {tensor_from("left", "u8[48,64]"), tensor_from("right", "u8[48,64]"),
                 tensor_from("colour", "u8[3,48,64]")};
  made.functions = [](Size) { return Functions{}; };
  const Workload pair = to_workload(made);
  const auto images = generated_images(1);
  const auto pixels = [&](int frame, std::size_t input) {
    const Data data = pair.make_data({.seed = 1, .images = images.get(), .frame = frame});
    const auto all = data.inputs[input].as<std::uint8_t>();
    return std::vector(all.begin(), all.end());
  };
  EXPECT_NE(pixels(0, 0), pixels(0, 1));
  EXPECT_EQ(pixels(0, 1), pixels(1, 0));
  const auto third = images->rgb(picture_index(1) + 2, 64, 48);
  const auto colour = third.pixels.as<std::uint8_t>();
  EXPECT_EQ(pixels(0, 2), std::vector(colour.begin(), colour.end()));
}

TEST(OwnList, FindsWhatWasMadeKnownInAllItsSizes) {
  Definition known = blur();
  known.name = "mine.known";
  std::vector<Workload> one;
  one.push_back(to_workload(known));
  EXPECT_FALSE(try_find_spec(known.name));
  make_known(std::move(one));
  ASSERT_TRUE(try_find_spec("mine.known"));
  EXPECT_EQ(find_spec(known.name).slices.size(), 4U);
  const Workload& large = find_workload("mine.known@1280x720");
  EXPECT_EQ(&large, &find_workload("mine.known@1280x720"));
  EXPECT_EQ(large.name, "mine.known@1280x720");
  EXPECT_EQ(try_find_workload("mine.known@large"), nullptr);
  EXPECT_THAT(files_of({"mine.known@1280x720", "sobel", "mine.known"}),
              ElementsAre("/robot/libmine.so"));
  EXPECT_EQ(try_find_workload("mine.known@map"), nullptr) << "it has a state and a list";
  known.name = "mine.plain";
  known.state.clear();
  known.outputs.pop_back();
  one.clear();
  one.push_back(to_workload(known));
  make_known(std::move(one));
  const Workload& mapped = find_workload("mine.plain@map");
  EXPECT_EQ(mapped.variant, "map");
  EXPECT_EQ(&mapped, &find_workload("mine.plain@map"));
  EXPECT_EQ(find_workload("mine.plain@64x48@map").inputs.front().shape.front(), 48);
  EXPECT_EQ(try_find_workload("mine.plain@int8"), nullptr);
}

TEST(Sizes, AreOfPicturesAndLayers) {
  EXPECT_THAT(find_workload("sobel@1280x720").inputs.front().shape, ElementsAre(720, 1280));
  EXPECT_EQ(find_workload("sobel@1280x720@map").variant, "map");
  EXPECT_THAT(find_workload("conv3@26x20").inputs.front().shape, ElementsAre(256, 20, 26));
  EXPECT_THAT(find_workload("conv3@26x20@batch4").inputs.front().shape,
              ElementsAre(4, 256, 20, 26));
  EXPECT_EQ(find_workload("conv3@26x20@int8").precision, Precision::kInt8);
  for (const char* name : {"fc6@128x128", "sobel@map@1280x720", "sobel@0x720", "sobel@1280x720@",
                           "sobel@1280x720@nothing", "conv3@26x20@batch1000"}) {
    EXPECT_EQ(try_find_workload(name), nullptr) << name;
  }
  EXPECT_THAT(test::bad_input([] { static_cast<void>(find_workload("fc6@128x128")); }),
              AllOf(HasSubstr("fc6"), HasSubstr("no other sizes")));
}

TEST(GuardedMemory, SeesABytePastTheEnd) {
  GuardedMemory memory;
  Tensor tensor({"t", Element::kU8, {101}}, &memory);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(tensor.data()) % Tensor::kAlignment, 0U);
  EXPECT_TRUE(memory.holds(tensor.data() + 100));
  EXPECT_NO_THROW(memory.check());
  tensor.data()[101] = std::byte{1};
  EXPECT_THROW(memory.check(), Error);
  EXPECT_DEATH(tensor.data()[128] = std::byte{1}, "");
}

}  // namespace
}  // namespace pirt::own
