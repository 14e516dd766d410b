// A hardware boundary that breaks on purpose: wraps any backend and spoils what passes through, from a given
// tick on. In: backend, fault, first tick and how many -> out: another backend, and what of the fault lies
// outside the boundary: a log that fails, a remote that is silent. While the loop is stalled it plays the
// guard's part too: after three silent ticks the motors go off. Simulation and tests only.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <random>

#include "robot_io.h"

namespace equipoise::app {

enum class FaultKind : std::size_t {
  kImuOff,
  kImuStuck,
  kNoiseBurst,
  kNotANumber,
  kBiasJump,
  kDelayed,
  kDuplicated,
  kTornPacket,
  kFifoOverflow,
  kNack,
  kBusHang,
  kLostInterrupt,
  kEncoderReversal,
  kCountJump,
  kWheelLoss,
  kBatterySag,
  kAdcOpen,
  kClockJump,
  kStall1ms,
  kStall20ms,
  kStall50ms,
  kWriteError,
  kRemoteLost,
  kLogFull,
  kCount
};

struct FaultInfo {
  const char* name;
  /// Ticks from the fault until the motors must be off; 0: may be ridden through while the state stays right.
  int deadline_ticks;
  /// Samples in a row that a check needs before the data are known to be unusable are part of the deadline.
  const char* why;
  bool once = false;  // strikes in its first tick only: what comes after is usable again
};

inline constexpr int kDeadlineTicks = 3;  // after the fault makes the data unusable
inline constexpr std::array<FaultInfo, static_cast<std::size_t>(FaultKind::kCount)> kFaults{{
    {"imu_off", kDeadlineTicks, "no sample"},
    {"imu_stuck", 3 + kDeadlineTicks, "same numbers; three alike are needed to tell"},
    {"noise_burst", 0, "20 deg/s and 0.5 g of noise"},
    {"not_a_number", 1, "in the gyro"},
    {"bias_jump", 0, "0.2 rad/s on the gyro"},
    {"delayed", 0, "samples three ticks old"},
    {"duplicated", kDeadlineTicks, "one sample again and again"},
    {"torn_packet", 0, "attitude packet refused"},
    {"fifo_overflow", 0, "attitude packets lost"},
    {"nack", kDeadlineTicks, "IMU does not answer"},
    {"bus_hang", 1, "the read takes 60 ms and fails"},
    {"lost_interrupt", kDeadlineTicks, "ticks by deadline, no samples"},
    {"encoder_reversal", 0, "one encoder counts backwards"},
    {"count_jump", 1, "500 counts at once", true},
    {"wheel_loss", 0, "one encoder stands still"},
    {"battery_sag", 5, "5 V"},
    {"adc_open", 5, "reads zero"},
    {"clock_jump", 0, "time stamps jump by 1 s, once"},
    {"stall_1ms", 0, "below a tick"},
    {"stall_20ms", 1, "the loop wakes late", true},
    {"stall_50ms", 1, "the loop wakes late", true},
    {"write_error", 2, "motor writes fail"},
    {"remote_lost", 0, "commands get old: CAN bus-off, remote gone"},
    {"log_full", 2, "the log cannot be written"},
}};

class FaultBackend {
 public:
  FaultBackend(rio_t inner, std::uint64_t seed) : inner_(inner), engine_(seed) {}

  /// From now on, for so many ticks.
  void start(FaultKind kind, int ticks) {
    kind_ = kind;
    left_ = ticks;
    age_ = 0;
  }
  bool active() const { return left_ > 0; }
  FaultKind kind() const { return kind_; }
  const std::atomic<bool>& log_failed() const { return log_failed_; }
  bool remote_silent() const { return is(FaultKind::kRemoteLost); }

  rio_t io() {
    static const rio_ops_t ops{wait_tick, read_sensors, write_motors, motors_off, close};
    return {&ops, this};
  }

 private:
  static constexpr int kGuardTicks = 3;
  static constexpr std::int64_t kClockJump_ns = 1'000'000'000;
  static FaultBackend& self(void* p) { return *static_cast<FaultBackend*>(p); }

  bool is(FaultKind kind) const { return left_ > 0 && kind_ == kind; }
  bool first(FaultKind kind) const { return is(kind) && age_ == 1; }
  int stall(int ticks, std::int64_t* now_ns);
  void spoil(rio_sensors_t* s);

  static int wait_tick(void* p, std::int64_t* now_ns);
  static int read_sensors(void* p, rio_sensors_t* out);
  static int write_motors(void* p, const rio_motors_t* motors) {
    // A bridge that does not obey keeps its last duty until the guard or the next try stops it.
    return self(p).is(FaultKind::kWriteError) ? -EIO : rio_write_motors(&self(p).inner_, motors);
  }
  static int motors_off(void* p) { return rio_motors_off(&self(p).inner_); }
  static void close(void* p) { rio_close(&self(p).inner_); }

  rio_t inner_;
  std::atomic<bool> log_failed_{false};
  std::mt19937_64 engine_;
  FaultKind kind_ = FaultKind::kImuOff;
  int left_ = 0;
  int age_ = 0;  // ticks since the start, the first is 1
  std::int64_t clock_offset_ns_ = 0;
  rio_sensors_t frozen_{};
  std::array<rio_sensors_t, 4> history_{};
  std::array<double, RIO_MAX_MOTORS> encoder_at_start_{};
};

}  // namespace equipoise::app
