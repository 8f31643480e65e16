// What it costs to be somebody else's: a network as a workload file has it, beside OpenCV's dnn
// called at once, on as many threads, in turns.
//
// Usage: own MODEL CONFIG WIDTH HEIGHT [calls] [threads]; 200 and 1. CONFIG is - for ONNX. Prints
// the ratio of each pair of calls: median, and the 95 % interval of it.
#include "workloads/own/own.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/dnn.hpp>
#include <vector>

#include "characterize/statistics/statistics.h"
#include "workloads/inputs/pictures/images.h"

namespace {

using Clock = std::chrono::steady_clock;

template <typename Call>
double seconds(const Call& call) {
  const auto begin = Clock::now();
  call();
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) {
    fmt::print(stderr, "usage: own MODEL CONFIG WIDTH HEIGHT [calls] [threads]\n");
    return 2;
  }
  const std::string model = std::filesystem::absolute(argv[1]).string();
  const std::string config =
      std::string(argv[2]) == "-" ? "" : std::filesystem::absolute(argv[2]).string();
  const int width = std::atoi(argv[3]), height = std::atoi(argv[4]);
  const int calls = argc > 5 ? std::atoi(argv[5]) : 200;
  const int threads = argc > 6 ? std::atoi(argv[6]) : 1;
  const auto file = std::filesystem::temp_directory_path() / "pirt-bench-own.yaml";
  std::ofstream(file) << fmt::format(
      "workloads:\n  - name: bench.net\n    inputs: {{picture: \"f32[1,3,{},{}]\"}}\n    network: "
      "{}\n{}",
      height, width, model, config.empty() ? "" : "    config: " + config + "\n");
  const auto workload = pirt::own::to_workload(pirt::own::load(file).front());
  std::filesystem::remove(file);
  const auto images = pirt::generated_images(1);
  const auto data = workload.make_data({.seed = 1, .images = images.get()});
  auto outputs = pirt::make_tensors(workload.outputs);
  const auto kernel = pirt::own_operation(workload)->cpu({}, threads);
  kernel->bind(data.inputs, outputs);

  auto net = config.empty() ? cv::dnn::readNet(model) : cv::dnn::readNet(model, config);
  net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  const auto names = net.getUnconnectedOutLayersNames();
  const std::vector<int> shape = {1, 3, height, width};
  const cv::Mat input(shape, CV_32F, const_cast<std::byte*>(data.inputs[0].data()));
  std::vector<cv::Mat> results;

  std::vector<double> ratios, ours, theirs;
  for (int i = -5; i < calls; ++i) {
    const auto one = [&] { return seconds([&] { static_cast<void>(kernel->execute(1)); }); };
    const auto other = [&] {
      cv::setNumThreads(threads);
      return seconds([&] {
        net.setInput(input);
        net.forward(results, names);
      });
    };
    // Who is first changes: the second finds caches and clocks as the first left them.
    const double first = i % 2 == 0 ? one() : other();
    const double second = i % 2 == 0 ? other() : one();
    if (i < 0) continue;
    ours.push_back(i % 2 == 0 ? first : second);
    theirs.push_back(i % 2 == 0 ? second : first);
    ratios.push_back(ours.back() / theirs.back());
  }
  // The order statistics around the median: a binomial interval.
  std::ranges::sort(ratios);
  const auto n = static_cast<double>(ratios.size());
  const auto reach = static_cast<std::size_t>(0.98 * std::sqrt(n) + 1);
  const std::size_t middle = ratios.size() / 2;
  const auto low = ratios[middle > reach ? middle - reach : 0];
  const auto high = ratios[std::min(middle + reach, ratios.size() - 1)];
  const auto median = [](std::vector<double> of) {
    std::ranges::nth_element(of, of.begin() + static_cast<std::ptrdiff_t>(of.size() / 2));
    return of[of.size() / 2];
  };
  fmt::print(
      "{} threads, {} pairs: workload {:.3f} ms, cv::dnn {:.3f} ms, ratio {:.3f} ({:.3f} to "
      "{:.3f})\n",
      threads, ratios.size(), 1e3 * median(ours), 1e3 * median(theirs), ratios[middle], low, high);
  return 0;
}
