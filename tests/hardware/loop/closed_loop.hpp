// A simulated robot behind the pins of the emulated board, in the emulated machine's own time: 200 ticks per
// second of its clock, as on the robot. In: what the firmware's process does to PWM and GPIO. Out: IMU
// registers, decoder counts, ADC, a data-ready edge per tick. Waits for nobody.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/samples.hpp"

/// A wheel's motor and encoder as they are soldered, whatever the board file says.
struct PinWheel {
  std::size_t channel;  // of Bench::pwm()
  bbb_pin_t in1, in2;
  int turns;         // with in1 high and in2 low: +1 or -1
  unsigned decoder;  // of Bench::setCounts()
  int counts;        // while the wheel turns forward: +1 or -1
};

/// A robot of the emulated board.
struct PinRobot {
  const char* name;
  std::string config;
  std::string board;
  std::vector<PinWheel> wheels;
  std::vector<bbb_pin_t> complaints;  // SF lines of the bridges, low when one complains
  std::string imu_driver = {};        // of the kernel's; empty: our own

  bool own_pace = false;  // its IMU has another rate: ticks wait for their time, not for a sample

  static PinRobot mbbr();
  static PinRobot mbbr_mpu6500();  // the same with the chip behind inv_mpu6050
  static PinRobot mbbr_mpu6500_on_spi();
  static PinRobot mbbr_lsm6dso();  // with another chip, behind st_lsm6dsx
  // Pins and polarities of librobotcontrol's motor.c, signs of its rc_balance.
  static PinRobot edumip();
  static PinRobot edumip_blue();
};

class PinWorld {
 public:
  PinWorld(Bench& bench, const PinRobot& robot, std::uint64_t seed);
  ~PinWorld();

  /// Sleeps until the next tick, advances under what the pins say, shows the sensors.
  void advance(bool data_ready = true);

  equipoise::MotorCommand pins() const;
  bool motorsOff() const;  // no pulse on any channel and the bridges asleep, from the kernel's side
  double tilt_rad() const;
  bool held() const;
  const PinRobot& robot() const { return robot_; }                   // with the files to give to the firmware
  const equipoise::SafetyParams& safety() const { return safety_; }  // as the firmware reads them
  std::int64_t now_ns() const { return due_ns_; }                    // CLOCK_MONOTONIC of the last tick
  int late() const { return late_; }  // ticks that began after the next one was due

 private:
  struct World;
  template <class Firmware>
  struct WorldOf;
  void show(const equipoise::RawSample& raw);

  Bench& bench_;
  PinRobot robot_;
  unsigned battery_channel_;
  equipoise::SafetyParams safety_;
  std::unique_ptr<World> world_;
  std::int64_t due_ns_ = 0;
  int late_ = 0;
};
