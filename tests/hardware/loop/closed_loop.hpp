// The simulated MBBR behind the pins of the emulated board. In: what the firmware's process does to PWM and
// GPIO. Out: IMU registers, decoder counts, ADC, a data-ready edge per tick. Time is the world's: a tick ends
// when the firmware has finished its own (a counter in shared memory), or has let the patience run out.
#pragma once

#include <equipoise/config.hpp>
#include <equipoise/plant/mbbr_world.hpp>

#include "bench.hpp"

class PinWorld {
 public:
  PinWorld(Bench& bench, const equipoise::MbbrConfig& config, std::uint64_t seed,
           const std::atomic<std::uint32_t>& firmware_ticks);

  /// One tick: advance under what the pins say, show the sensors, wait for the firmware. False: it did not
  /// answer.
  bool tick(bool data_ready = true);

  equipoise::MotorCommand pins() const;
  bool motorsOff() const;  // no pulse on any channel and the bridges asleep, from the kernel's side
  double tilt_rad() const { return world_.truth().theta_xy.norm(); }
  bool held() const { return world_.held(); }

 private:
  void show(const equipoise::RawSample& raw);

  Bench& bench_;
  const std::atomic<std::uint32_t>& firmware_ticks_;
  bbb_config_t board_ = Bench::mbbr();
  equipoise::MbbrWorld world_;
};
