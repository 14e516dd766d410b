#include "bench.hpp"

#include <errno.h>
#include <fcntl.h>
#include <sysfs.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "support/pin.hpp"

namespace {
const std::string kDebug = "/sys/kernel/debug/robot_bench/";
constexpr unsigned kDataReadyLine = 21;

// Kept open: under emulation, opening costs more than reading.
int keptFd(const std::string& path, int flags) {
  static std::map<std::string, int> fds;
  const auto known = fds.find(path);
  if (known != fds.end()) return known->second;
  const int fd = open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0) {
    std::perror(path.c_str());
    std::abort();  // the bench itself is broken: no test can say anything
  }
  return fds[path] = fd;
}

void writeBytes(const std::string& path, const void* data, size_t size) {
  if (write(keptFd(path, O_WRONLY), data, size) == static_cast<ssize_t>(size)) return;  // some cannot seek
  std::perror(path.c_str());
  std::abort();
}

void writeText(const std::string& path, const std::string& text) {
  writeBytes(path, text.data(), text.size());
}

std::string readLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

// Channels that a killed process of an earlier test left exported.
void unexportAll() {
  for (const char* device : {"48302200", "48304200"}) {
    char chip[SYSFS_PATH_MAX];
    if (sysfs_find("/sys/class/pwm", "pwmchip", device, chip) != 0) continue;
    for (const uint32_t channel : {0, 1}) (void)sysfs_write_number(chip, "unexport", channel);
  }
}
}  // namespace

Bench::Bench() {
  unexportAll();
  for (const char* device : {"imu", "pwm", "counter", "adc"}) fault(device, 0, 0);
  serveImu("");
  setImu({0, 0, 4096}, {0, 0, 0});
  writeText(kDebug + "counter_stuck", "0");
  setCounts({0, 0, 0});
  drivePin("481ae000", kDataReadyLine, true);
}

std::array<Bench::Channel, 4> Bench::pwm() const {
  std::array<Channel, 4> channels{};
  const ssize_t n = pread(keptFd(kDebug + "pwm_state", O_RDONLY), channels.data(), sizeof channels, 0);
  if (n != static_cast<ssize_t>(sizeof channels)) std::abort();
  return channels;
}

const std::string& Bench::simDirectory(const std::string& chip) const {
  std::string& known = sim_directories_[chip];
  if (known.empty()) {
    const std::string config = "/sys/kernel/config/gpio-sim/" + chip;
    known = "/sys/devices/platform/" + readLine(config + "/dev_name") + "/" +
            readLine(config + "/bank/chip_name");
  }
  return known;
}

std::string Bench::simPath(const std::string& chip, unsigned line, const std::string& attribute) const {
  return simDirectory(chip) + "/sim_gpio" + std::to_string(line) + "/" + attribute;
}

bool Bench::pin(const std::string& chip, unsigned line) const {
  char level = '?';
  if (pread(keptFd(simPath(chip, line, "value"), O_RDONLY), &level, 1, 0) != 1) std::abort();
  return level == '1';
}

void Bench::drivePin(const std::string& chip, unsigned line, bool high) {
  writeText(simPath(chip, line, "pull"), high ? "pull-up" : "pull-down");
}

void Bench::serveImu(const std::string& driver) {
  kernel_imu_ = !driver.empty();
  writeText(kDebug + "imu_who_am_i",
            driver.find("mpu6500") != std::string::npos ? "112" : "113");  // their register maps, WHO_AM_I
  writeText(kDebug + "imu_driver", driver + "\n");
}

void Bench::dataReady() {
  if (kernel_imu_) return writeText(kDebug + "imu_data_ready", "1");
  drivePin("481ae000", kDataReadyLine, false);
  drivePin("481ae000", kDataReadyLine, true);
}

void Bench::setImu(const std::array<int16_t, 3>& accel, const std::array<int16_t, 3>& gyro) {
  std::array<uint8_t, 14> bytes{};
  const auto put = [&bytes](size_t at, int16_t value) {
    bytes[at] = static_cast<uint8_t>(static_cast<uint16_t>(value) >> 8);
    bytes[at + 1] = static_cast<uint8_t>(value);
  };
  for (size_t i = 0; i < 3; ++i) {
    put(2 * i, accel[i]);
    put(8 + 2 * i, gyro[i]);
  }
  writeBytes(kDebug + "imu_sample", bytes.data(), bytes.size());
}

void Bench::pushFifo(const std::vector<uint8_t>& bytes) {
  writeBytes(kDebug + "imu_fifo", bytes.data(), bytes.size());
}

void Bench::setCounts(const std::array<int64_t, 3>& counts) {
  writeBytes(kDebug + "counter_positions", counts.data(), sizeof counts);
}

void Bench::stickCounter(unsigned decoder) {
  writeText(kDebug + "counter_stuck", std::to_string(1u << decoder));
}

void Bench::setAdc(unsigned channel, uint32_t counts) {
  writeText(kDebug + "adc" + std::to_string(channel), std::to_string(counts));
}

void Bench::fault(const std::string& device, int error, uint32_t times) {
  writeText(kDebug + device + "_error_count", "0");
  writeText(kDebug + device + "_error", std::to_string(error));
  writeText(kDebug + device + "_error_count", std::to_string(times));
}

void Bench::unplug(const std::string& device) { writeText(kDebug + "plug", "-" + device); }

void Bench::plug(const std::string& device) { writeText(kDebug + "plug", "+" + device); }

uint8_t Bench::imuRegister(uint8_t reg) const {
  std::array<char, 128> bytes{};
  std::ifstream(kDebug + "imu_registers", std::ios::binary).read(bytes.data(), bytes.size());
  return static_cast<uint8_t>(bytes[reg]);
}

bbb_config_t Bench::mbbr() {
  constexpr const char *kGpio0 = "44e07000", *kGpio1 = "4804c000", *kGpio2 = "481ac000", *kGpio3 = "481ae000";
  bbb_config_t config{};
  snprintf(config.imu.bus, sizeof config.imu.bus, "/dev/i2c-2");
  config.imu.address = 0x68;
  config.imu.rate_hz = 200;
  config.imu.gyro_range_dps = 2000;
  config.imu.accel_range_g = 8;
  config.imu.dlpf = 2;
  config.imu.interrupt = pin_of(kGpio3, kDataReadyLine, true);
  config.imu.late_after_us = 200000;  // emulation is slow: an edge is late when it does not come at all
  config.motors = 3;
  const bbb_pin_t in1[] = {pin_of(kGpio1, 28), pin_of(kGpio1, 16), pin_of(kGpio2, 9)};
  const bbb_pin_t in2[] = {pin_of(kGpio0, 31), pin_of(kGpio2, 17), pin_of(kGpio2, 8)};
  const bbb_pin_t sf[] = {pin_of(kGpio1, 17, true), pin_of(kGpio3, 17, true), pin_of(kGpio3, 16, true)};
  const char* pwm[] = {"48302200", "48302200", "48304200"};
  const uint32_t channel[] = {0, 1, 0};
  const char* encoder[] = {"48300180", "48302180", "48304180"};
  for (int i = 0; i < 3; ++i) {
    bbb_motor_t& motor = config.motor[i];
    motor.bridge = BBB_MC33926;
    motor.in1 = in1[i];
    motor.in2 = in2[i];
    motor.fault = sf[i];
    snprintf(motor.pwm, sizeof motor.pwm, "%s", pwm[i]);
    motor.pwm_channel = channel[i];
    snprintf(motor.encoder, sizeof motor.encoder, "%s", encoder[i]);
  }
  config.pwm_hz = 20000;
  config.enable = pin_of(kGpio0, 20);
  snprintf(config.adc, sizeof config.adc, "TI-am335x-adc");
  config.battery_channel = 6;
  config.battery_every_ticks = 20;
  return config;
}

Metronome::Metronome(Bench& bench)
    : thread_([this, &bench] {
        while (!stop_) {
          if (!paused_) bench.dataReady();
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
      }) {}

Metronome::~Metronome() {
  stop_ = true;
  thread_.join();
}
