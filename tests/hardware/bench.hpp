// The kernel side of the emulated robot (tests/hardware/kernel, gpio-sim), as a test sees it: what reaches
// the pins, what the sensors measure, faults. In: values -> out: files of debugfs and sysfs. Linux 6.1 in the
// test machine only.
#pragma once

#include <bbb_config.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <thread>
#include <vector>

class Bench {
 public:
  struct Channel {
    uint64_t duty_ns, period_ns, enabled;
  };

  Bench();  // fresh: no faults, lines low, sensors at rest

  std::array<Channel, 4> pwm() const;  // 48302200 A, B, 48304200 A, B
  bool pin(const std::string& chip, unsigned line) const;
  void drivePin(const std::string& chip, unsigned line, bool high);
  // Whose the IMU is: "" of /dev/i2c-2, else of this driver of the kernel's.
  void serveImu(const std::string& driver);
  void dataReady();  // a falling edge of the IMU's interrupt, gpio3.21, or the kernel driver's own interrupt
  void setImu(const std::array<int16_t, 3>& accel, const std::array<int16_t, 3>& gyro);
  void pushFifo(const std::vector<uint8_t>& bytes);
  void setCounts(const std::array<int64_t, 3>& counts);
  void stickCounter(unsigned decoder);  // its count stays, wherever the wheel goes
  void setAdc(unsigned channel, uint32_t counts);
  void fault(const std::string& device, int error,
             uint32_t times);  // imu, pwm, counter, adc; UINT32_MAX: forever
  void unplug(const std::string& device);
  void plug(const std::string& device);
  uint8_t imuRegister(uint8_t reg) const;

  static bbb_config_t mbbr();  // wired as config/boards/robotics_cape_mbbr.toml

 private:
  const std::string& simDirectory(const std::string& chip) const;
  std::string simPath(const std::string& chip, unsigned line, const std::string& attribute) const;

  mutable std::map<std::string, std::string> sim_directories_;
  bool kernel_imu_ = false;
};

// The IMU's interrupt at 200 Hz, for as long as it lives.
class Metronome {
 public:
  explicit Metronome(Bench& bench);
  ~Metronome();
  void pause(bool on) { paused_ = on; }

 private:
  std::atomic<bool> stop_{false}, paused_{false};
  std::thread thread_;
};
