// A run's log as ticks, one at a time. In: path -> out: what the run was, and per tick the record that was
// handed over; InputError when the file is no log of ours. A tick counts when its sensors, command, states,
// motors, health and timing are there. Not for the tick.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/log/log_reader.hpp"
#include "equipoise/runtime/record.hpp"

namespace equipoise::app {

class RunLog {
 public:
  explicit RunLog(const std::string& path);
  /// From the bytes of a log; `origin` names it in errors.
  RunLog(const std::string& bytes, const std::string& origin);

  void show_progress(const std::string& what) { reader_.show_progress(what); }
  const runtime::RunInfo& run() const { return run_; }
  /// As the run judged itself, once the log has been read; none: it was cut off, or killed.
  const std::optional<runtime::EndRecord>& end() const { return end_; }
  /// Next whole tick; false at the end.
  bool next(runtime::TickRecord* tick);

  /// So far. Names of TickRecord::others, in order; ticks that lack a message; bytes that belong to none.
  const std::vector<std::string>& estimators() const { return estimators_; }
  std::int64_t incomplete_ticks() const { return incomplete_ticks_; }
  std::size_t damaged_bytes() const { return reader_.damaged_bytes(); }

 private:
  void find_run(LogReader reader, const std::string& origin);
  bool finish(runtime::TickRecord* tick);
  void take(const LogEvent& event);

  LogReader reader_;
  runtime::RunInfo run_;
  std::optional<runtime::EndRecord> end_;
  std::vector<std::string> estimators_;
  std::int64_t incomplete_ticks_ = 0;
  runtime::TickRecord tick_{};
  unsigned seen_ = 0;  // messages of tick_, as bits in the order of the field list
  bool torn_ = false;  // one of them could not be decoded
};

Command command_of(const runtime::TickRecord& r) noexcept;

/// A logged tick as the loop's boundary and supervisor: its time, its sample, and what the runtime held
/// against the motors then. What is commanded goes nowhere.
struct LoggedTick {
  std::int64_t now_ns;
  const RawSample& raw;
  std::uint32_t inhibit;

  int wait_tick(std::int64_t* out) const noexcept {
    *out = now_ns;
    return 0;
  }
  RawSample read() const noexcept { return raw; }
  int write(const MotorCommand& /*command*/) const noexcept { return 0; }
  std::uint32_t begin(std::int64_t /*now_ns*/, const RawSample& /*raw*/) const noexcept { return inhibit; }
  void end(bool /*driven*/, int /*write_error*/) const noexcept {}
};

/// "EQUIPOISE_STATE_EKF13" -> "state_ekf13".
std::string short_name(std::string_view channel);

}  // namespace equipoise::app
