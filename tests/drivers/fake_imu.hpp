// An MPU-9250 at register level for the tests: register file, reset, DMP memory, FIFO; and faults on its bus.
// In: I2C messages. Out: bytes, or a negative errno. Thread-safe: umockdev serves the bus from a thread of
// its own.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

class FakeImu {
 public:
  FakeImu();

  // One I2C message; returns 0 or -errno.
  int write(const uint8_t* data, int size);
  int read(uint8_t* data, int size);

  // What the bus does to the next transfers: 0 is fine.
  int nextTransfer();  // for the bus: errno to answer, or 0
  bool nextIsShort();  // for the bus: one message fewer than asked for

  void failNext(int error, int times = 1, int after = 0);  // after: that many good transfers first
  void shortNext();
  void setWhoAmI(uint8_t value);
  void keepRegister(uint8_t reg);           // writes to it are lost
  void corruptDmpMemory(uint16_t address);  // the cell keeps one bit inverted
  void setRegister(uint8_t reg, uint8_t value);
  uint8_t reg(uint8_t reg) const;
  uint8_t dmpMemory(uint16_t address) const;
  uint16_t dmpStart() const;
  void setSample(const std::array<int16_t, 3>& accel, const std::array<int16_t, 3>& gyro);
  void pushFifo(const std::vector<uint8_t>& bytes);
  int fifoSize() const;
  int transfers() const;
  std::vector<std::array<uint8_t, 2>> writes() const;  // single-byte register writes, in order

 private:
  void reset();
  void store(uint8_t reg, uint8_t value);
  uint8_t load(uint8_t reg);

  mutable std::mutex mutex_;
  std::array<uint8_t, 128> reg_{};
  std::array<uint8_t, 4096> dmp_{};
  std::deque<uint8_t> fifo_;
  std::vector<std::array<uint8_t, 2>> writes_;
  uint8_t pointer_ = 0;
  uint8_t who_am_i_ = 0x71;
  int kept_register_ = -1;
  int corrupt_cell_ = -1;
  int fail_error_ = 0, fail_times_ = 0, fail_after_ = 0;
  bool short_next_ = false;
  int transfers_ = 0;
};

// A DMP packet of 20 bytes with this quaternion (scaled to Q30).
std::vector<uint8_t> dmpPacket(const std::array<double, 4>& wxyz);
