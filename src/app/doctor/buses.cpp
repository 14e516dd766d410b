// Devices that a board file names: IMU, counters, PWM, ADC, serial port, CAN.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "app/doctor/doctor.hpp"
#include "dmp.h"
#include "i2c_dev.h"
#include "mpu9250_registers.h"
#include "sysfs.h"

namespace equipoise::app::doctor {
namespace {

std::string reason(int error) { return std::strerror(error < 0 ? -error : error); }

bool may(const std::string& path, int mode) { return access(path.c_str(), mode) == 0; }

std::string hex(unsigned value) {
  char text[8];
  std::snprintf(text, sizeof text, "0x%02x", value);
  return text;
}

/// The first device of a class at this address; empty where there is none.
std::string find(const Patient& patient, const std::string& class_dir, const std::string& prefix,
                 const std::string& device) {
  char dir[SYSFS_PATH_MAX];
  const int status = sysfs_find(patient.path(class_dir).c_str(), prefix.c_str(), device.c_str(), dir);
  return status == 0 ? dir : "";
}

void examine_imu_answer(Findings* findings, const bbb_imu_t& imu, int status, std::uint8_t who) {
  const std::string where = std::string(imu.bus) + " address " + hex(imu.address);
  const std::string bus_number = std::string(imu.bus).substr(std::string(imu.bus).find_last_of('-') + 1);
  const std::string scan = "i2cdetect -y -r " + bus_number;
  if (status == -EREMOTEIO || status == -ENXIO || status == -EIO) {
    findings->fail("imu.chip", where + ": nothing answers: power, wiring or [imu] address", scan);
  } else if (status == -EBUSY) {
    findings->fail("imu.chip", where + ": held by a kernel driver",
                   "ls -l /sys/bus/i2c/devices/" + bus_number + "-00*/driver  # unbind that driver");
  } else if (status < 0) {
    findings->fail("imu.chip", where + ": " + reason(status), scan);
  } else if (who == MPU9250_WHO_9250) {
    findings->ok("imu.chip", where + " is an MPU-9250 (" + hex(who) + ")");
  } else if (who == MPU9250_WHO_9255 || who == MPU9250_WHO_6500) {
    findings->warn("imu.chip",
                   where + " is " + (who == MPU9250_WHO_9255 ? "an MPU-9255 (" : "an MPU-6500 (") + hex(who) +
                       "): works, but is not the chip the robot was tuned with",
                   "none needed; run equipoise calibrate gyro and accel");
  } else {
    findings->fail("imu.chip", where + " answers as " + hex(who) + ", which is no MPU-9250, -9255 or -6500",
                   scan + "  # then correct [imu] bus and address");
  }
}

/// One of the kernel's devices: is it there, does it fill a buffer, may we read it?
void examine_iio(const Patient& patient, const std::string& name, const char* device, Findings* findings) {
  const std::string trigger = patient.board->wiring.imu.trigger;
  const std::string dir = find(patient, "/sys/bus/iio/devices", "iio:device", device);
  if (dir.empty()) {
    findings->fail(
        name, std::string("no IIO device ") + device + ": kernel driver or device tree node missing",
        "cat /sys/bus/iio/devices/*/name; dmesg | grep -i iio  # then correct [imu] part or the device tree");
    return;
  }
  const std::string node = patient.path("/dev/") + dir.substr(dir.rfind('/') + 1);
  const std::string now = first_line(dir + "/trigger/current_trigger");
  if (!may(dir + "/buffer/enable", F_OK)) {
    findings->fail(name, dir + "/buffer: none, the driver has no interrupt",
                   "give the node an interrupt in the device tree");
  } else if (!may(node, R_OK) || !may(dir + "/buffer/enable", W_OK)) {
    findings->fail(name, node + ": " + reason(errno), kGroupFix);
  } else if (may(dir + "/trigger/current_trigger", F_OK) && now.empty() && trigger.empty()) {
    findings->fail(
        name, dir + "/trigger/current_trigger is empty",
        "cat /sys/bus/iio/devices/trigger*/name  # then [imu] trigger = \"NAME\" in " + patient.board_path);
  } else {
    findings->ok(name, std::string(device) + " is " + dir.substr(patient.root.size()));
  }
}

void examine_imu(const Patient& patient, Findings* findings) {
  const bbb_imu_t& imu = patient.board->wiring.imu;
  if (imu.driver == BBB_IMU_IIO) {
    const imu_part_t* part = imu_part(imu.part);
    examine_iio(patient, "imu.gyro", part->gyro_device, findings);
    examine_iio(patient, "imu.accel", part->accel_device, findings);
    return;
  }
  const std::string bus = patient.path(imu.bus);
  if (!may(bus, F_OK)) {
    findings->fail("imu.bus", std::string(imu.bus) + ": " + reason(errno),
                   "sudo modprobe i2c-dev && ls /dev/i2c-*  # then correct [imu] bus");
    return;
  }
  if (!may(bus, R_OK | W_OK)) {
    findings->fail("imu.bus", std::string(imu.bus) + ": " + reason(errno), kGroupFix);
    return;
  }
  i2c_dev_t chip{};
  int status = i2c_dev_open(&chip, bus.c_str(), imu.address);
  if (status == -ENOTTY || status == -EOPNOTSUPP) {
    findings->fail("imu.bus", std::string(imu.bus) + " is not an I2C bus that can do plain transfers",
                   "ls -l /sys/class/i2c-dev  # then correct [imu] bus");
    return;
  }
  if (status == 0) findings->ok("imu.bus", std::string(imu.bus) + " opens");
  std::uint8_t who = 0;
  if (status == 0) {
    status = i2c_dev_read(&chip, MPU9250_WHO_AM_I, &who, 1);
    i2c_dev_close(&chip);
  }
  examine_imu_answer(findings, imu, status, who);
}

void examine_dmp(const Patient& patient, Findings* findings) {
  if (patient.board->wiring.imu.driver == BBB_IMU_IIO) return;
  const std::string path = patient.board->wiring.imu.dmp_firmware;
  if (path.empty()) {
    findings->ok("imu.dmp", "no firmware image given: our own attitude filter is used");
    return;
  }
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error || size != DMP_FIRMWARE_BYTES) {
    findings->fail("imu.dmp",
                   path + ": " + (error ? error.message() : std::to_string(size) + " bytes, not 3062"),
                   "ls -l " + path + "  # correct [imu] dmp_firmware, or set it to \"\" for our own filter");
  } else {
    const int range_g = patient.board->wiring.imu.accel_range_g;
    if (range_g == 2 || range_g == 8) {
      findings->ok("imu.dmp", path + " has the right size; accelerometer at " + std::to_string(range_g) +
                                  (range_g == 2 ? " g, as InvenSense's driver sets it"
                                                : " g, as librobotcontrol sets it since 0.4.0"));
    } else {
      findings->fail("imu.dmp", "the DMP runs at 2 or 8 g, not at " + std::to_string(range_g),
                     "set [imu] accel_range_g = 8 in " + patient.board_path);
    }
  }
}

void examine_encoder(const Patient& patient, Findings* findings, std::uint32_t i) {
  const std::string device = patient.board->wiring.motor[i].encoder;
  const std::string name = "encoder." + std::to_string(i + 1);
  std::string file;
  const std::string counter = find(patient, "/sys/bus/counter/devices", "counter", device);
  if (!counter.empty()) file = counter + "/count0/enable";
  if (counter.empty()) {
    const std::string legacy = find(patient, "/sys/bus/platform/devices", device, device);
    if (!legacy.empty() && may(legacy + "/position", F_OK)) file = legacy + "/enabled";
  }
  if (file.empty()) {
    findings->fail(name, "no eQEP at " + device + ": driver or device tree node missing",
                   overlay_fix(patient));
  } else if (!may(file, W_OK)) {
    findings->fail(name, file + ": " + reason(errno), kGroupFix);
  } else {
    findings->ok(name, "eQEP at " + device);
  }
}

void examine_pwm(const Patient& patient, Findings* findings, std::uint32_t i) {
  const bbb_motor_t& motor = patient.board->wiring.motor[i];
  const std::string name = "pwm." + std::to_string(i + 1);
  const std::string chip = find(patient, "/sys/class/pwm", "pwmchip", motor.pwm);
  std::int64_t channels = 0;
  if (chip.empty()) {
    findings->fail(name, std::string("no EHRPWM at ") + motor.pwm + ": driver or device tree node missing",
                   overlay_fix(patient));
  } else if (sysfs_read_number(chip.c_str(), "npwm", &channels) < 0 || channels <= motor.pwm_channel) {
    findings->fail(name,
                   chip + " has " + std::to_string(channels) + " channels, needs channel " +
                       (motor.pwm_channel == 0 ? "A" : "B"),
                   "ls -l /sys/class/pwm  # then correct [[motor]] pwm and pwm_channel");
  } else if (!may(chip + "/export", W_OK)) {
    findings->fail(name, chip + "/export: " + reason(errno), kGroupFix);
  } else {
    findings->ok(name,
                 std::string("EHRPWM at ") + motor.pwm + " channel " + (motor.pwm_channel == 0 ? "A" : "B"));
  }
}

void examine_adc(const Patient& patient, Findings* findings) {
  const bbb_config_t& wiring = patient.board->wiring;
  const std::string device = find(patient, "/sys/bus/iio/devices", "iio:device", wiring.adc);
  if (device.empty()) {
    findings->fail("battery.adc", std::string("no ADC named ") + wiring.adc, overlay_fix(patient));
    return;
  }
  const std::string attribute = "in_voltage" + std::to_string(wiring.battery_channel) + "_raw";
  std::int64_t counts = 0;
  const int status = sysfs_read_number(device.c_str(), attribute.c_str(), &counts);
  if (status < 0) {
    findings->fail("battery.adc", device + "/" + attribute + ": " + reason(status), overlay_fix(patient));
    return;
  }
  const double volts = patient.board->facts.battery_V_per_count * static_cast<double>(counts) +
                       patient.board->facts.battery_offset_V;
  char text[64];
  std::snprintf(text, sizeof text, "%.2f V (%lld counts)", volts, static_cast<long long>(counts));
  constexpr double kTwoCells_V = 6.4;  // 3.2 V per LiPo cell: as good as empty
  if (volts < kTwoCells_V) {
    findings->warn("battery.adc", std::string(text) + ": empty or not connected",
                   "charge and connect the battery");
  } else {
    findings->ok("battery.adc", text);
  }
}

void examine_serial(const Patient& patient, Findings* findings) {
  const std::string& device = patient.board->serial_device;
  if (device.empty()) {
    findings->skip("serial", "not used by this board file");
    return;
  }
  std::string path = patient.path(device);
  if (device.front() != '/') {
    const std::string tty = find(patient, "/sys/class/tty", "tty", device);
    if (tty.empty()) {
      findings->warn("serial", "no UART at " + device + ": no remote control", overlay_fix(patient));
      return;
    }
    path = patient.path("/dev/" + tty.substr(tty.rfind('/') + 1));
  }
  const int fd = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd >= 0) {
    close(fd);
    findings->ok("serial", device + ": " + path.substr(patient.root.size()) + " opens");
  } else {
    const int error = errno;
    findings->warn("serial", path + ": " + reason(error) + ": no remote control",
                   error == EACCES ? kGroupFix : overlay_fix(patient));
  }
}

void examine_can(const Patient& patient, Findings* findings) {
  const Board& board = *patient.board;
  if (board.can_interface.empty()) {
    findings->skip("can", "not used by this board file");
    return;
  }
  const bool blue = board.overlay == "blue";  // its CAN has pads and a transceiver of its own
  if (board.serial_device == "48022000" && !blue) {
    findings->fail(
        "can", "DCAN1 and UART1 share P9.24 and P9.26",
        "set [serial] device = \"481aa000\" in " + patient.board_path + " and move the HC-06 to P8.37/38");
    return;
  }
  const std::string net = find(patient, "/sys/class/net", "", board.can_interface);
  if (net.empty()) {
    findings->fail("can", "no CAN interface " + board.can_interface,
                   blue ? overlay_fix(patient)
                        : "echo 'uboot_overlay_addr5=/lib/firmware/equipoise-can.dtbo' | sudo tee -a "
                          "/boot/uEnv.txt && sudo reboot");
    return;
  }
  const std::string interface = net.substr(net.rfind('/') + 1);
  if (first_line(net + "/operstate") == "down") {
    findings->warn("can", interface + " is down",
                   "sudo ip link set " + interface + " up type can bitrate " +
                       std::to_string(board.can_bitrate) + " restart-ms 100");
  } else {
    findings->ok("can", interface + " is up");
  }
}

}  // namespace

void examine_buses(const Patient& patient, Findings* findings) {
  examine_imu(patient, findings);
  examine_dmp(patient, findings);
  for (std::uint32_t i = 0; i < patient.board->wiring.motors; ++i) {
    examine_encoder(patient, findings, i);
    examine_pwm(patient, findings, i);
  }
  examine_adc(patient, findings);
  examine_serial(patient, findings);
  examine_can(patient, findings);
}

}  // namespace equipoise::app::doctor
