// A hardware boundary that breaks on purpose: wraps any backend and spoils what passes through, from a given
// tick on. In: backend, fault, first tick and how many -> out: another backend, and what of the fault lies
// outside the boundary: a log that fails, a remote that is silent. While the loop is stalled it plays the
// guard's part too: after three silent ticks the motors go off, until the loop has let go of them. Simulation
// and tests only.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <random>

#include "app/io/hardware.hpp"

namespace equipoise::app {

/// A row per fault: its kind, and FaultInfo.
#define EQUIPOISE_FAULTS(F)                                                                  \
  F(kImuOff, "imu_off", kBlindTicks, "no sample")                                            \
  F(kImuGap, "imu_gap_100ms", 0, "no IMU sample for 100 ms", 20)                             \
  F(kAllGap, "all_gap_30ms", 0, "no sample at all for 30 ms", 6)                             \
  F(kImuStuck, "imu_stuck", 3 + kBlindTicks, "same numbers; three alike are needed to tell") \
  F(kBadSamples, "bad_samples", 0, "one IMU sample of ten is garbage, for a second", 200)    \
  F(kNoiseBurst, "noise_burst", 0, "20 deg/s and 0.5 g of noise")                            \
  F(kNotANumber, "not_a_number", kBlindTicks, "in the gyro")                                 \
  F(kBiasJump, "bias_jump", 0, "0.2 rad/s on the gyro")                                      \
  F(kDelayed, "delayed", 0, "samples three ticks old")                                       \
  F(kDuplicated, "duplicated", kBlindTicks, "one sample again and again")                    \
  F(kHalfRate, "half_rate", 0, "each IMU sample comes twice")                                \
  F(kTornPacket, "torn_packet", 0, "attitude packet refused")                                \
  F(kFifoOverflow, "fifo_overflow", 0, "attitude packets lost")                              \
  F(kNack, "nack", kBlindTicks, "IMU does not answer")                                       \
  F(kBusHang, "bus_hang", kBlindTicks, "the read takes 60 ms and fails")                     \
  F(kLostInterrupt, "lost_interrupt", kBlindTicks, "ticks by deadline, no samples")          \
  F(kGyroXFrozen, "gyro_x_frozen", 0, "repeats its last count")                              \
  F(kGyroYFrozen, "gyro_y_frozen", 0, "repeats its last count")                              \
  F(kGyroZFrozen, "gyro_z_frozen", 0, "repeats its last count")                              \
  F(kGyroXZero, "gyro_x_zero", 0, "reads zero")                                              \
  F(kGyroYZero, "gyro_y_zero", 0, "reads zero")                                              \
  F(kGyroZZero, "gyro_z_zero", 0, "reads zero")                                              \
  F(kGyroXFlipped, "gyro_x_flipped", 0, "reads minus the rate")                              \
  F(kGyroYFlipped, "gyro_y_flipped", 0, "reads minus the rate")                              \
  F(kGyroZFlipped, "gyro_z_flipped", 0, "reads minus the rate")                              \
  F(kGyroXYSwapped, "gyro_xy_swapped", 0, "each reads the other's rate")                     \
  F(kGyroYZSwapped, "gyro_yz_swapped", 0, "each reads the other's rate")                     \
  F(kGyroZXSwapped, "gyro_zx_swapped", 0, "each reads the other's rate")                     \
  F(kGyroRamp, "gyro_ramp", 0, "bias grows by 0.2 rad/s a second")                           \
  F(kAccelFrozen, "accel_frozen", 0, "accelerometer repeats its last counts")                \
  F(kEncoderReversal, "encoder_reversal", 0, "one encoder counts backwards")                 \
  F(kCountJump, "count_jump", 0, "500 counts at once")                                       \
  F(kWheelLoss, "wheel_loss", 0, "one encoder stands still")                                 \
  F(kEncoderDead, "encoder_dead", 0, "one encoder reads zero")                               \
  F(kTwoEncodersDead, "two_encoders_dead", 0, "two encoders stand still")                    \
  F(kEncoderErrors, "encoder_errors", 0, "three reads of ten fail, for a second", 200)       \
  F(kBatterySag, "battery_sag", 5, "5 V")                                                    \
  F(kBatteryFlicker, "battery_flicker", 0, "three readings of ten are zero")                 \
  F(kAdcOpen, "adc_open", 5, "reads zero")                                                   \
  F(kClockJump, "clock_jump", 0, "time stamps jump by 1 s, once")                            \
  F(kStall1ms, "stall_1ms", 0, "below a tick")                                               \
  F(kStall20ms, "stall_20ms", 0, "the loop wakes late")                                      \
  F(kStall50ms, "stall_50ms", 0, "the loop wakes late")                                      \
  F(kWriteError, "write_error", 2, "motor writes fail")                                      \
  F(kMotorDead, "motor_dead", 0, "one motor does not turn")                                  \
  F(kMotorsSwapped, "motors_swapped", 0, "each does what the other is told")                 \
  F(kMotorStuck, "motor_stuck", 0, "one bridge keeps 0.6 duty")                              \
  F(kRemoteLost, "remote_lost", 0, "commands get old: CAN bus-off, remote gone")             \
  F(kLogFull, "log_full", 2, "the log cannot be written")

#define EQUIPOISE_KIND(kind, ...) kind,
enum class FaultKind : std::size_t { EQUIPOISE_FAULTS(EQUIPOISE_KIND) kCount };
#undef EQUIPOISE_KIND

struct FaultInfo {
  const char* name;
  /// Ticks from the fault until the motors must be off; 0: may be tolerated while the state stays right.
  int deadline_ticks;
  const char* why;
  int ticks = 0;  // how long it lasts; 0: to the end
};

inline constexpr int kDeadlineTicks = 3;  // after the fault makes the data unusable
inline constexpr int kBlindTicks =
    30 + kDeadlineTicks;  // bridged by the model before (safety.max_missed_imu)
#define EQUIPOISE_INFO(kind, ...) FaultInfo{__VA_ARGS__},
inline constexpr std::array kFaults{EQUIPOISE_FAULTS(EQUIPOISE_INFO)};
#undef EQUIPOISE_INFO

class FaultBackend : public Backend {
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

 protected:
  int wait_tick(std::int64_t* now_ns) override;

 private:
  static constexpr int kGuardTicks = 3;
  static constexpr std::int64_t kClockJump_ns = 1'000'000'000;

  bool is(FaultKind kind) const { return left_ > 0 && kind_ == kind; }
  bool first(FaultKind kind) const { return is(kind) && age_ == 1; }
  int stall(int ticks, std::int64_t* now_ns);
  void spoil(rio_sensors_t* s);
  void spoil_imu(rio_sensors_t* s);
  void spoil_gyro(rio_sensors_t* s) const;

  int read_sensors(rio_sensors_t* out) override;
  int write_motors(const rio_motors_t& motors) override;
  int motors_off() override {
    cut_ = false;  // the loop has let go
    return rio_motors_off(&inner_);
  }
  void close() override { rio_close(&inner_); }

  rio_t inner_;
  std::atomic<bool> log_failed_{false};
  std::mt19937_64 engine_;
  FaultKind kind_ = FaultKind::kImuOff;
  int left_ = 0;
  int age_ = 0;       // ticks since the start, the first is 1
  bool cut_ = false;  // the guard has stopped the motors and the loop has not let go since
  std::int64_t clock_offset_ns_ = 0;
  rio_sensors_t frozen_{};
  std::array<rio_sensors_t, 4> history_{};
  std::array<double, RIO_MAX_MOTORS> encoder_at_start_{};
};

}  // namespace equipoise::app
