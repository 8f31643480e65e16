// Splitting pictures into bands of rows over the threads of one unit.
//
// OpenCV has one pool for the whole process, whose size the last one to ask has set, and runs one
// parallel loop at a time in it. Here it computes on the thread that calls it, and each unit splits
// its pictures itself, over threads of its own.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <thread>
#include <vector>

namespace pirt::cpu {

/// The threads of one unit: the calling one and others with its affinity, which the team joins when
/// it goes. Used by one thread at a time; several teams may run at once.
class BandTeam {
 public:
  /// @param threads  All together, at least 1.
  /// @throws Error{kEnvironment} if one of them cannot be started.
  explicit BandTeam(int threads);
  ~BandTeam() { end(); }
  BandTeam(const BandTeam&) = delete;
  BandTeam& operator=(const BandTeam&) = delete;

  [[nodiscard]] int size() const { return static_cast<int>(workers_.size()) + 1; }
  /// Runs @p body(0) to @p body(parts - 1), each once, and waits for all. Who is free takes the
  /// next one, the calling thread too: on busy cores nobody waits for a thread that does not get
  /// one. Throws the first exception that one of them threw.
  /// @param parts  At most size().
  void run(int parts, const std::function<void(int part)>& body);

 private:
  /// Of the current run; in one word, so that who takes a part knows which run it is of. Aligned as
  /// such a word is, without which clang calls a library for what is one instruction.
  struct alignas(8) State {
    std::uint32_t round = 0;
    std::uint16_t parts = 0;
    std::uint16_t taken = 0;
  };
  void end();
  void work();
  State take_parts();
  void do_part(int part);

  std::atomic<State> state_ = State{};
  std::atomic<int> done_ = 0;  ///< Parts of the current run.
  std::atomic<bool> ending_ = false;
  const std::function<void(int)>* body_ = nullptr;
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::vector<std::jthread> workers_;
};

/// The rows of the input, above and below a row of the output, that this row depends on. Whoever
/// splits a picture has to say them: there is no default.
class Halo {
 public:
  explicit constexpr Halo(int rows) : rows_(rows) {}
  /// A row may depend on any.
  static constexpr Halo whole_picture() { return Halo(1 << 24); }
  [[nodiscard]] constexpr int rows() const { return rows_; }

 private:
  int rows_;
};

/// A part of the rows to compute. Of its inputs it shows those rows and their halo, and nothing
/// else, so that too small a halo shows as a wrong output.
struct Band {
  cv::Range rows;    ///< To compute.
  cv::Range around;  ///< With the halo, as far as the picture reaches.

  /// `around` as a picture of its own.
  [[nodiscard]] cv::Mat surroundings(const cv::Mat& input) const;
  /// `rows` as a picture of its own.
  [[nodiscard]] cv::Mat alone(const cv::Mat& input) const;
  /// `rows`, for functions that look at what lies around a part (OpenCV's filters without
  /// BORDER_ISOLATED).
  [[nodiscard]] cv::Mat part(const cv::Mat& input) const;
};

/// Calls @p body with bands that together cover @p rows, one a thread.
void for_bands(BandTeam& team, int rows, Halo halo, const std::function<void(const Band&)>& body);

using Mats = std::vector<cv::Mat>;

/// Computes @p outputs of @p input band by band, exactly as @p filter would compute the whole, with
/// a filter that takes the edges of what it is given for those of the picture: the rows at a cut
/// are computed again from the rows around it.
/// @param filter   Writes to outputs of the input's rows, which are there already.
/// @param outputs  As many rows as the input.
void filter_in_bands(BandTeam& team, const cv::Mat& input, Mats& outputs, Halo halo,
                     const std::function<void(const cv::Mat& input, Mats& outputs)>& filter);

}  // namespace pirt::cpu
