#include "workloads/slam/run/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"
#include "workloads/base/text/markup.h"
#include "workloads/inputs/pictures/decoder.h"

namespace pirt::slam {
namespace {

constexpr int kSide = 560;  // of the trajectory's square, pixels
constexpr int kMargin = 40;
constexpr int kTop = 48;  // for the title

using Line = std::vector<Eigen::Vector2d>;

/// Everything in pixels of the finished picture.
struct Drawing {
  int width = 0, height = 0;
  Line estimate, truth;
  Line map, known_again;  ///< Of single points.
  double metre = 1;       ///< Pixels.
  double frame_scale = 1;
  Eigen::Vector2d frame_at;
};

/// The two axes in which points extend most, in order.
std::array<int, 2> widest_axes(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d low = points.front();
  Eigen::Vector3d high = points.front();
  for (const auto& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const Eigen::Vector3d extent = high - low;
  int least = 2;
  for (const int axis : {1, 0}) {
    if (extent(axis) < extent(least)) least = axis;
  }
  return {least == 0 ? 1 : 0, least == 2 ? 1 : 2};
}

/// What nine of ten points lie within along an axis: some of a map's are far off.
std::array<double, 2> usual_extent(const std::vector<Eigen::Vector3d>& points, int axis) {
  std::vector<double> at;
  for (const auto& p : points) at.push_back(p(axis));
  std::ranges::sort(at);
  const std::size_t beyond = at.size() / 20;
  return {at[beyond], at[at.size() - 1 - beyond]};
}

Drawing draw(const Plot& plot) {
  Drawing d;
  std::vector<Eigen::Vector3d> estimate;
  std::vector<Eigen::Vector3d> truth;
  std::vector<Eigen::Vector3d> map;
  std::vector<Eigen::Vector3d> known_again;
  Similarity to_truth;
  if (!plot.truth.empty() && plot.trajectory.size() >= 3) {
    to_truth = align(plot.trajectory, plot.truth, plot.alignment);
  }
  for (const auto& pose : plot.trajectory) {
    estimate.push_back(to_truth * pose.body.position);
    if (const auto t = truth_at(plot.truth, pose.time)) truth.push_back(t->position);
    const bool again = std::ranges::binary_search(plot.known_again, pose.time);
    if (again) known_again.push_back(estimate.back());
  }
  for (const auto& point : plot.map) map.push_back(to_truth * point);
  auto all = estimate;
  all.insert(all.end(), truth.begin(), truth.end());
  if (!all.empty()) {
    const auto [a, b] = widest_axes(all);
    Eigen::Vector2d low(1e300, 1e300);
    Eigen::Vector2d high = -low;
    for (const auto& p : all) {
      low = low.cwiseMin(Eigen::Vector2d(p(a), p(b)));
      high = high.cwiseMax(Eigen::Vector2d(p(a), p(b)));
    }
    if (!map.empty()) {
      const auto x = usual_extent(map, a);
      const auto y = usual_extent(map, b);
      low = low.cwiseMin(Eigen::Vector2d(x[0], y[0]));
      high = high.cwiseMax(Eigen::Vector2d(x[1], y[1]));
    }
    d.metre = (kSide - 2 * kMargin) / std::max({(high - low).maxCoeff(), 0.1});
    const auto pixel = [&, across = a, along = b](const Eigen::Vector3d& p) {
      return Eigen::Vector2d(kMargin + d.metre * (p(across) - low.x()),
                             kTop + kSide - kMargin - d.metre * (p(along) - low.y()));
    };
    for (const auto& p : estimate) d.estimate.push_back(pixel(p));
    for (const auto& p : truth) d.truth.push_back(pixel(p));
    for (const auto& p : known_again) d.known_again.push_back(pixel(p));
    for (const auto& p : map) {
      const Eigen::Vector2d at = pixel(p);
      const bool shown =
          at.x() > 0 && at.x() < kSide && at.y() > kTop && at.y() < kTop + kSide - kMargin / 2;
      if (shown) d.map.push_back(at);
    }
  }
  const GreyImage& image = plot.frame.image;
  d.frame_scale = image.empty() ? 1.0 : static_cast<double>(kSide) / image.height;
  d.frame_scale = std::min(d.frame_scale, 1.5);
  d.frame_at = {kSide, kTop};
  d.width = kSide + static_cast<int>(d.frame_scale * image.width) + 16;
  d.height = kTop + kSide + 16;
  return d;
}

/// A length that is easy to read, of about a fifth of the plot.
double bar_length_m(double metre) {
  const double wanted = kSide / 5.0 / metre;
  const double decade = std::pow(10.0, std::floor(std::log10(wanted)));
  const double part = wanted / decade;
  return decade * (part >= 5 ? 5 : part >= 2 ? 2 : 1);
}

std::string svg_line(const Line& line, const char* colour, double width) {
  std::string points;
  for (const auto& p : line) points += fmt::format("{:.1f},{:.1f} ", p.x(), p.y());
  return fmt::format("<polyline fill='none' stroke='{}' stroke-width='{}' points='{}'/>\n", colour,
                     width, points);
}

std::string svg_dots(const Line& points, const char* colour, int width) {
  std::string path;
  for (const auto& p : points) path += fmt::format("M{:.1f} {:.1f}h0", p.x(), p.y());
  return fmt::format("<path stroke='{}' stroke-width='{}' stroke-linecap='round' d='{}'/>\n",
                     colour, width, path);
}

/// What the lines and dots of the trajectory's part are.
std::string legend(const Plot& plot) {
  std::string text = plot.truth.empty() ? "estimate blue" : "truth grey, estimate blue";
  if (!plot.map.empty()) text += ", map brown";
  if (!plot.known_again.empty()) text += ", known again orange";
  return text;
}

std::string base64(const std::string& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group =
          (group << 8U) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const bool there = i + k <= bytes.size();
      text += there ? kDigits[(group >> (18 - 6 * k)) & 63U] : '=';
    }
  }
  return text;
}

cv::Mat mat_of(const GreyImage& image) {
  return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

void paint_line(cv::Mat& canvas, const Line& line, const cv::Scalar& colour, int width) {
  std::vector<cv::Point> points;
  for (const auto& p : line) points.emplace_back(cvRound(p.x()), cvRound(p.y()));
  cv::polylines(canvas, points, false, colour, width, cv::LINE_AA);
}

void paint(const Plot& plot, const Drawing& d, cv::Mat& canvas) {
  const cv::Scalar grey(150, 150, 150);
  const cv::Scalar blue(200, 80, 20);
  const cv::Scalar red(40, 40, 220);
  const cv::Scalar green(60, 180, 60);
  const auto text = [&](const std::string& what, int x, int y, const cv::Scalar& colour) {
    cv::putText(canvas, what, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv::LINE_AA);
  };
  const cv::Scalar brown(140, 170, 200);
  const cv::Scalar orange(0, 140, 255);
  const auto points = [&](const Line& at, const cv::Scalar& colour, int radius) {
    for (const auto& p : at) {
      cv::circle(canvas, {cvRound(p.x()), cvRound(p.y())}, radius, colour, -1, cv::LINE_AA);
    }
  };
  points(d.map, brown, 1);
  paint_line(canvas, d.truth, grey, 3);
  points(d.known_again, orange, 2);
  paint_line(canvas, d.estimate, blue, 1);
  text(plot.title, kMargin, 20, {0, 0, 0});
  text(legend(plot), kMargin, 40, grey);
  const double bar = bar_length_m(d.metre);
  const int end = kMargin + cvRound(bar * d.metre);
  cv::line(canvas, {kMargin, kTop + kSide - 10}, {end, kTop + kSide - 10}, {0, 0, 0}, 2);
  text(fmt::format("{} m", bar), end + 6, kTop + kSide - 6, {0, 0, 0});
  if (plot.frame.image.empty()) return;
  cv::Mat colour;
  cv::cvtColor(mat_of(plot.frame.image), colour, cv::COLOR_GRAY2BGR);
  cv::resize(colour, colour, {}, d.frame_scale, d.frame_scale, cv::INTER_LINEAR);
  colour.copyTo(canvas({static_cast<int>(d.frame_at.x()), static_cast<int>(d.frame_at.y()),
                        colour.cols, colour.rows}));
  const auto dots = [&](const std::vector<Eigen::Vector2f>& pixels, const cv::Scalar& c) {
    for (const auto& p : pixels) {
      const Eigen::Vector2d at = d.frame_at + d.frame_scale * p.cast<double>();
      cv::circle(canvas, {cvRound(at.x()), cvRound(at.y())}, 3, c, 1, cv::LINE_AA);
    }
  };
  dots(plot.frame.tracks, green);
  dots(plot.frame.landmarks, red);
  text("followed points green, landmarks red", static_cast<int>(d.frame_at.x()), 40, grey);
}

}  // namespace

ShownFrame show(const State& state, const GreyImage& image) {
  ShownFrame shown{image, {}, {}};
  for (const auto& track : state.tracks) {
    (track.landmark >= 0 ? shown.landmarks : shown.tracks).push_back(track.pixel);
  }
  return shown;
}

Plot plot_of(const RunResult& run, const Setup& setup) {
  Plot plot;
  plot.trajectory = run.trajectory();
  for (const auto& frame : run.frames) {
    if (frame.report.from_map > 0) plot.known_again.push_back(frame.pose.time);
  }
  for (const auto& point : run.last.map) plot.map.push_back(point.position);
  for (const auto& landmark : run.last.landmarks) plot.map.push_back(landmark.position);
  if (run.last.in_map && setup.known != nullptr) {
    for (const auto& point : *setup.known) plot.map.push_back(point.position);
  }
  return plot;
}

std::string plot_svg(const Plot& plot) {
  const Drawing d = draw(plot);
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='13'>\n<rect width='100%' height='100%' fill='white'/>\n",
      d.width, d.height);
  svg += fmt::format("<text x='{}' y='20'>{}</text>\n", kMargin, escape_markup(plot.title));
  svg += fmt::format("<text x='{}' y='40' fill='#777'>{}</text>\n", kMargin, legend(plot));
  svg += svg_dots(d.map, "#c8aa8c", 2) + svg_line(d.truth, "#999", 3) +
         svg_dots(d.known_again, "#ff8c00", 5) + svg_line(d.estimate, "#1450c8", 1);
  const double bar = bar_length_m(d.metre);
  svg += fmt::format("<path d='M{} {}h{:.1f}' stroke='black' stroke-width='2'/>\n", kMargin,
                     kTop + kSide - 10, bar * d.metre);
  svg += fmt::format("<text x='{:.1f}' y='{}'>{} m</text>\n", kMargin + bar * d.metre + 6,
                     kTop + kSide - 6, bar);
  if (!plot.frame.image.empty()) {
    const GreyImage& image = plot.frame.image;
    svg += fmt::format(
        "<image x='{}' y='{}' width='{:.1f}' height='{:.1f}' "
        "href='data:image/png;base64,{}'/>\n",
        d.frame_at.x(), d.frame_at.y(), d.frame_scale * image.width, d.frame_scale * image.height,
        base64(encode_png(mat_of(image))));
    const auto dots = [&](const std::vector<Eigen::Vector2f>& pixels, const char* colour) {
      for (const auto& p : pixels) {
        const Eigen::Vector2d at = d.frame_at + d.frame_scale * p.cast<double>();
        svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3' fill='none' stroke='{}'/>\n",
                           at.x(), at.y(), colour);
      }
    };
    dots(plot.frame.tracks, "#3cb43c");
    dots(plot.frame.landmarks, "#dc2828");
    svg += fmt::format(
        "<text x='{}' y='40' fill='#777'>followed points green, landmarks red"
        "</text>\n",
        d.frame_at.x());
  }
  return svg + "</svg>\n";
}

std::string plot_png(const Plot& plot) {
  const Drawing d = draw(plot);
  try {
    cv::Mat canvas(d.height, d.width, CV_8UC3, cv::Scalar(255, 255, 255));
    paint(plot, d, canvas);
    return encode_png(canvas);
  } catch (const cv::Exception& error) {
    throw_environment("OpenCV cannot draw: " + error.err);
  }
}

}  // namespace pirt::slam
