#include "reports/run/robot_recording.h"

#include <algorithm>
#include <set>
#include <vector>

#include "workloads/inputs/recording/compression.h"
#include "workloads/inputs/recording/mcap_writer.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {
namespace {

constexpr std::int64_t kNanosPerSecond = 1'000'000'000;
constexpr const char* kWorld = "world";
constexpr const char* kMap = "map";

Json stamp_json(Nanos time) {
  return {{"sec", time.count() / kNanosPerSecond}, {"nsec", time.count() % kNanosPerSecond}};
}

Json vector_json(const Eigen::Vector3d& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

Json rotation_json(const Eigen::Matrix3d& rotation) {
  const Eigen::Vector4d q = quaternion_of(rotation);
  return {{"x", q.x()}, {"y", q.y()}, {"z", q.z()}, {"w", q.w()}};
}

Json pose_json(const Pose& pose) {
  return {{"position", vector_json(pose.position)}, {"orientation", rotation_json(pose.rotation)}};
}

Json transform_json(Nanos time, const char* parent, const char* child, const Pose& pose) {
  return {{"timestamp", stamp_json(time)},
          {"parent_frame_id", parent},
          {"child_frame_id", child},
          {"translation", vector_json(pose.position)},
          {"rotation", rotation_json(pose.rotation)}};
}

Json poses_json(Nanos time, const char* frame, Json poses) {
  return {{"timestamp", stamp_json(time)}, {"frame_id", frame}, {"poses", std::move(poses)}};
}

Json color_json(double r, double g, double b, double a) {
  return {{"r", r}, {"g", g}, {"b", b}, {"a", a}};
}

/// @param scene  As recognition::to_json() has it.
Json annotations_json(Nanos time, const Json& scene) {
  constexpr int kLineLoop = 2;
  const Json green = color_json(0, 1, 0, 1), none = color_json(0, 0, 0, 0);
  Json boxes = Json::array(), texts = Json::array();
  for (const Json& object : scene.at("objects")) {
    const auto box = object.at("box").get<std::vector<double>>();
    const double right = box[0] + box[2], bottom = box[1] + box[3];
    const Json left_top = {{"x", box[0]}, {"y", box[1]}};
    boxes.push_back({{"timestamp", stamp_json(time)},
                     {"type", kLineLoop},
                     {"points", Json::array({left_top,
                                             {{"x", right}, {"y", box[1]}},
                                             {{"x", right}, {"y", bottom}},
                                             {{"x", box[0]}, {"y", bottom}}})},
                     {"outline_color", green},
                     {"outline_colors", Json::array({green})},
                     {"fill_color", none},
                     {"thickness", 2}});
    texts.push_back({{"timestamp", stamp_json(time)},
                     {"position", left_top},
                     {"text", object.at("name")},
                     {"font_size", 12},
                     {"text_color", green},
                     {"background_color", none}});
  }
  return {{"circles", Json::array()}, {"points", std::move(boxes)}, {"texts", std::move(texts)}};
}

/// JSON Schema of what looks like @p example.
Json schema_of(const Json& example) {
  if (example.is_string()) return {{"type", "string"}};
  if (example.is_number()) return {{"type", "number"}};
  if (example.is_array()) {
    const Json items = example.empty() ? Json{{"type", "object"}} : schema_of(example.front());
    return {{"type", "array"}, {"items", items}};
  }
  Json properties = Json::object();
  for (const auto& [name, value] : example.items()) properties[name] = schema_of(value);
  Json schema = {{"type", "object"}, {"properties", std::move(properties)}};
  if (example.contains("nsec")) schema["title"] = "time";
  return schema;
}

class Recorder {
 public:
  explicit Recorder(const RobotRun& run) : run_(run) {}

  std::string record() {
    write_poses();
    write_paths();
    write_detections();
    write_latencies();
    // In order of time, as who plays it wants it.
    std::ranges::stable_sort(messages_, {}, &Message::time);
    std::string file;
    mcap::McapWriter writer([&file](std::string_view bytes) { file += bytes; }, "",
                            best_compression());
    for (const Message& each : messages_) {
      writer.write(
          each.topic,
          {each.schema, "jsonschema", "json", [&] { return json_text(schema_of(each.example)); }},
          each.time, each.text);
    }
    writer.finish();
    return file;
  }

 private:
  struct Message {
    Nanos time{};
    std::string_view schema;
    std::string topic, text;
    Json example;
  };

  /// @param example  What the schema is made of, where @p message leaves out something.
  void add(const std::string& topic, std::string_view schema, Nanos time, const Json& message,
           const Json& example = {}) {
    const bool is_first = topics_.insert(topic).second;
    messages_.push_back({time, schema, topic, json_text(message),
                         !is_first           ? Json()
                         : example.is_null() ? message
                                             : example});
  }

  void write_poses() {
    const auto way = run_.result.run.trajectory();
    Json poses = Json::array();
    for (const StampedPose& each : way) {
      const Nanos time = at(each.time);
      poses.push_back(pose_json(each.body));
      add("/pose", "foxglove.PoseInFrame", time,
          {{"timestamp", stamp_json(time)}, {"frame_id", kWorld}, {"pose", poses.back()}});
      add("/tf", "foxglove.FrameTransform", time, transform_json(time, kWorld, "body", each.body));
    }
    if (way.empty()) return;
    const Nanos begin = at(way.front().time);
    add("/trajectory", "foxglove.PosesInFrame", begin, poses_json(begin, kWorld, std::move(poses)));
    if (run_.map_from_world) {
      add("/tf", "foxglove.FrameTransform", begin,
          transform_json(begin, kMap, kWorld, *run_.map_from_world));
    }
  }

  void write_paths() {
    for (const PlannedPath& path : run_.plans.paths) {
      Json poses = Json::array();
      for (const auto& corner : path.corners) {
        poses.push_back(pose_json({.position = {corner.x, corner.y, 0}}));
      }
      const Nanos time = at(path.time);
      add("/path", "foxglove.PosesInFrame", time, poses_json(time, kMap, std::move(poses)));
    }
  }

  void write_detections() {
    const Json object = {{"name", "dog"}, {"box", Json::array({0, 0, 1, 1})}};
    const Json example = annotations_json({}, {{"objects", Json::array({object})}});
    for (const std::string& line : run_.scenes) {
      const Json scene = parse_json(line);
      const Nanos time = at(Nanos(std::stoll(scene.at("image").get<std::string>())));
      add("/detections", "foxglove.ImageAnnotations", time, annotations_json(time, scene), example);
    }
  }

  void write_latencies() {
    const auto& frames = run_.result.run.frames;
    for (std::size_t i = 0; i < std::min(frames.size(), run_.result.latencies.size()); ++i) {
      const Nanos time = at(frames[i].pose.time);
      add("/latency", "pirt.Latency", time,
          {{"timestamp", stamp_json(time)}, {"latency_ms", to_ms(run_.result.latencies[i])}});
    }
  }

  /// A camera that is late by more than its first stamp would begin before there are stamps.
  static Nanos at(Nanos time) { return std::max(time, Nanos::zero()); }

  const RobotRun& run_;
  std::set<std::string> topics_;
  std::vector<Message> messages_;
};

}  // namespace

std::string robot_recording(const RobotRun& run) { return Recorder(run).record(); }

}  // namespace pirt
