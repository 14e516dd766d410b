// How far a job is and how long it will still take, on one line of stderr that is a terminal; nothing for
// jobs that end within two seconds. In: share done, 0 to 1 -> out: the line, at most ten times a second. at()
// may be called from several threads; not for the tick.
#pragma once

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <string>

namespace equipoise::app {

class Progress {
 public:
  explicit Progress(std::string what) : what_(std::move(what)), shown_(isatty(STDERR_FILENO) != 0) {}
  ~Progress() {
    if (drawn_) std::fprintf(stderr, "\r%70s\r", "");
  }

  void at(double share) {
    if (!shown_) return;
    const std::unique_lock<std::mutex> lock(drawing_, std::try_to_lock);
    const Clock::time_point now = Clock::now();
    if (!lock || now < next_) return;
    next_ = now + std::chrono::milliseconds(100);
    const double passed_s = std::chrono::duration<double>(now - start_).count();
    drawn_ = true;
    std::fprintf(stderr, "\r%.40s: %3.0f %%%s   ", what_.c_str(), 100.0 * share,
                 share > 0.0 ? (", " + duration(passed_s * (1.0 - share) / share) + " to go").c_str() : "");
    std::fflush(stderr);
  }

  /// "45 s", "3 min 20 s", "2 h 5 min"
  static std::string duration(double s) {
    const long long whole = std::llround(s);
    if (whole < 60) return std::to_string(whole) + " s";
    if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
    return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::string what_;
  bool shown_;
  bool drawn_ = false;
  std::mutex drawing_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_ + std::chrono::seconds(2);
};

}  // namespace equipoise::app
