// The simulated MBBR behind the pins of the emulated board, in the emulated machine's own time: 200 ticks per
// second of its clock, as on the robot. In: what the firmware's process does to PWM and GPIO. Out: IMU
// registers, decoder counts, ADC, a data-ready edge per tick. Waits for nobody.
#pragma once

#include <equipoise/config.hpp>
#include <equipoise/plant/mbbr_world.hpp>

#include "app/board/board.hpp"
#include "bench.hpp"

class PinWorld {
 public:
  PinWorld(Bench& bench, const equipoise::app::Board& board, const equipoise::MbbrConfig& config,
           std::uint64_t seed);

  /// Sleeps until the next tick, advances under what the pins say, shows the sensors.
  void tick(bool data_ready = true);

  equipoise::MotorCommand pins() const;
  bool motorsOff() const;  // no pulse on any channel and the bridges asleep, from the kernel's side
  double tilt_rad() const { return world_.truth().theta_xy.norm(); }
  bool held() const { return world_.held(); }
  std::int64_t now_ns() const { return due_ns_; }  // CLOCK_MONOTONIC of the last tick
  int late() const { return late_; }               // ticks that began after the next one was due

 private:
  void show(const equipoise::RawSample& raw);

  Bench& bench_;
  bbb_config_t wiring_;
  equipoise::MbbrWorld world_;
  std::int64_t due_ns_ = 0;
  int late_ = 0;
};
