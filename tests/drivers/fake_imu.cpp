#include "fake_imu.hpp"

#include <cmath>

namespace {
constexpr uint8_t kUserCtrl = 0x6A, kPower = 0x6B, kBank = 0x6D, kOffset = 0x6E, kData = 0x6F;
constexpr uint8_t kFifoCountH = 0x72, kFifoCountL = 0x73, kFifo = 0x74, kWhoAmI = 0x75;
constexpr size_t kFifoBytes = 1024;
using Lock = std::lock_guard<std::mutex>;
}  // namespace

FakeImu::FakeImu() { reset(); }

void FakeImu::reset() {
  reg_.fill(0);
  reg_[kPower] = 0x01;
  fifo_.clear();
}

void FakeImu::store(uint8_t reg, uint8_t value) {
  const uint16_t cell = static_cast<uint16_t>(reg_[kBank] << 8 | reg_[kOffset]);
  if (reg == kData) {
    dmp_[cell % dmp_.size()] = static_cast<uint8_t>(value ^ (cell == corrupt_cell_ ? 0x10 : 0));
    ++reg_[kOffset];
    return;
  }
  if (reg == kPower && (value & 0x80) != 0) return reset();
  if (reg == kept_register_) return;
  if (reg == kUserCtrl && (value & 0x04) != 0) fifo_.clear();
  reg_[reg & 0x7F] =
      reg == kUserCtrl ? static_cast<uint8_t>(value & ~0x0D) : value;  // reset bits clear themselves
}

uint8_t FakeImu::load(uint8_t reg) {
  if (reg == kData) {
    const uint16_t cell = static_cast<uint16_t>(reg_[kBank] << 8 | reg_[kOffset]);
    ++reg_[kOffset];
    return dmp_[cell % dmp_.size()];
  }
  if (reg == kFifoCountH) return static_cast<uint8_t>(fifo_.size() >> 8);
  if (reg == kFifoCountL) return static_cast<uint8_t>(fifo_.size());
  if (reg == kWhoAmI) return who_am_i_;
  if (reg != kFifo) return reg_[reg & 0x7F];
  if (fifo_.empty()) return 0xFF;
  const uint8_t value = fifo_.front();
  fifo_.pop_front();
  return value;
}

int FakeImu::write(const uint8_t* data, int size) {
  const Lock lock(mutex_);
  if (size < 1) return 0;
  pointer_ = data[0];
  if (size == 2) writes_.push_back({data[0], data[1]});
  for (int i = 1; i < size; ++i) {
    store(pointer_, data[i]);
    if (pointer_ != kData) ++pointer_;
  }
  return 0;
}

int FakeImu::read(uint8_t* data, int size) {
  const Lock lock(mutex_);
  for (int i = 0; i < size; ++i) {
    data[i] = load(pointer_);
    if (pointer_ != kData && pointer_ != kFifo) ++pointer_;
  }
  return 0;
}

int FakeImu::nextTransfer() {
  const Lock lock(mutex_);
  ++transfers_;
  if (fail_times_ == 0) return 0;
  if (fail_after_ > 0) {
    --fail_after_;
    return 0;
  }
  --fail_times_;
  return fail_error_;
}

bool FakeImu::nextIsShort() {
  const Lock lock(mutex_);
  const bool result = short_next_;
  short_next_ = false;
  return result;
}

void FakeImu::failNext(int error, int times, int after) {
  const Lock lock(mutex_);
  fail_error_ = error;
  fail_times_ = times;
  fail_after_ = after;
}

void FakeImu::shortNext() {
  const Lock lock(mutex_);
  short_next_ = true;
}

void FakeImu::setWhoAmI(uint8_t value) {
  const Lock lock(mutex_);
  who_am_i_ = value;
}

void FakeImu::keepRegister(uint8_t reg) {
  const Lock lock(mutex_);
  kept_register_ = reg;
}

void FakeImu::corruptDmpMemory(uint16_t address) {
  const Lock lock(mutex_);
  corrupt_cell_ = address;
}

void FakeImu::setRegister(uint8_t reg, uint8_t value) {
  const Lock lock(mutex_);
  reg_[reg & 0x7F] = value;
}

uint8_t FakeImu::reg(uint8_t reg) const {
  const Lock lock(mutex_);
  return reg_[reg & 0x7F];
}

uint8_t FakeImu::dmpMemory(uint16_t address) const {
  const Lock lock(mutex_);
  return dmp_[address % dmp_.size()];
}

uint16_t FakeImu::dmpStart() const {
  const Lock lock(mutex_);
  return static_cast<uint16_t>(reg_[0x70] << 8 | reg_[0x71]);
}

void FakeImu::setSample(const std::array<int16_t, 3>& accel, const std::array<int16_t, 3>& gyro) {
  const Lock lock(mutex_);
  const auto put = [this](uint8_t at, int16_t value) {
    const uint16_t bits = static_cast<uint16_t>(value);
    reg_[at] = static_cast<uint8_t>(bits >> 8);
    reg_[at + 1u] = static_cast<uint8_t>(bits);
  };
  for (uint8_t i = 0; i < 3; ++i) {
    put(static_cast<uint8_t>(0x3B + 2 * i), accel[i]);
    put(static_cast<uint8_t>(0x43 + 2 * i), gyro[i]);
  }
}

void FakeImu::pushFifo(const std::vector<uint8_t>& bytes) {
  const Lock lock(mutex_);
  for (const uint8_t byte : bytes) {
    if (fifo_.size() == kFifoBytes) fifo_.pop_front();
    fifo_.push_back(byte);
  }
}

int FakeImu::fifoSize() const {
  const Lock lock(mutex_);
  return static_cast<int>(fifo_.size());
}

int FakeImu::transfers() const {
  const Lock lock(mutex_);
  return transfers_;
}

std::vector<std::array<uint8_t, 2>> FakeImu::writes() const {
  const Lock lock(mutex_);
  return writes_;
}

std::vector<uint8_t> dmpPacket(const std::array<double, 4>& wxyz) {
  std::vector<uint8_t> bytes;
  for (const double component : wxyz) {
    const uint32_t q30 = static_cast<uint32_t>(static_cast<int32_t>(std::lround(component * (1 << 30))));
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<uint8_t>(q30 >> shift));
  }
  bytes.resize(20, 0);
  return bytes;
}
