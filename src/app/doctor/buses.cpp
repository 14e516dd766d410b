// Devices that a board file names: IMU, counters, PWM, ADC, serial port, CAN.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "app/doctor/doctor.hpp"
#include "app/text/format.hpp"
#include "dmp.h"
#include "i2c_dev.h"
#include "mpu9250_registers.h"
#include "sysfs.h"

namespace equipoise::app::doctor {
namespace {

std::string reason(int error) { return std::strerror(error < 0 ? -error : error); }

bool may(const std::string& path, int mode) { return access(path.c_str(), mode) == 0; }

std::string hex(unsigned value) { return format("0x%02x", value); }

/// The first device of a class at this address; empty where there is none.
std::string find(const Patient& patient, const std::string& class_dir, const std::string& prefix,
                 const std::string& device) {
  char dir[SYSFS_PATH_MAX];
  const int status = sysfs_find(patient.path(class_dir).c_str(), prefix.c_str(), device.c_str(), dir);
  return status == 0 ? dir : "";
}

Finding examine_imu_answer(const bbb_imu_t& imu, int status, std::uint8_t who) {
  const std::string where = std::string(imu.bus) + " address " + hex(imu.address);
  const std::string bus_number = std::string(imu.bus).substr(std::string(imu.bus).find_last_of('-') + 1);
  const std::string scan = "i2cdetect -y -r " + bus_number;
  if (status == -EREMOTEIO || status == -ENXIO || status == -EIO)
    return failure("imu.chip", where + ": nothing answers: power, wiring or [imu] address", scan);
  if (status == -EBUSY)
    return failure("imu.chip", where + ": held by a kernel driver",
                   "ls -l /sys/bus/i2c/devices/" + bus_number + "-00*/driver  # unbind that driver");
  if (status < 0) return failure("imu.chip", where + ": " + reason(status), scan);
  if (who == MPU9250_WHO_9250) return passed("imu.chip", where + " is an MPU-9250 (" + hex(who) + ")");
  if (who == MPU9250_WHO_9255 || who == MPU9250_WHO_6500)
    return warning("imu.chip",
                   where + " is " + (who == MPU9250_WHO_9255 ? "an MPU-9255 (" : "an MPU-6500 (") + hex(who) +
                       "): works, but is not the chip the robot was tuned with",
                   "none needed; run equipoise calibrate gyro and accel");
  return failure("imu.chip", where + " answers as " + hex(who) + ", which is no MPU-9250, -9255 or -6500",
                 scan + "  # then correct [imu] bus and address");
}

/// One of the kernel's devices: is it there, does it fill a buffer, may we read it?
Finding examine_iio(const Patient& patient, const std::string& name, const char* device) {
  const std::string trigger = patient.board->wiring.imu.trigger;
  const std::string dir = find(patient, "/sys/bus/iio/devices", "iio:device", device);
  if (dir.empty())
    return failure(
        name, std::string("no IIO device ") + device + ": kernel driver or device tree node missing",
        "cat /sys/bus/iio/devices/*/name; dmesg | grep -i iio  # then correct [imu] part or the device tree");
  const std::string node = patient.path("/dev/") + dir.substr(dir.rfind('/') + 1);
  const std::string now = first_line(dir + "/trigger/current_trigger");
  if (!may(dir + "/buffer/enable", F_OK))
    return failure(name, dir + "/buffer: none, the driver has no interrupt",
                   "give the node an interrupt in the device tree");
  if (!may(node, R_OK) || !may(dir + "/buffer/enable", W_OK))
    return failure(name, node + ": " + reason(errno), kGroupFix);
  if (may(dir + "/trigger/current_trigger", F_OK) && now.empty() && trigger.empty())
    return failure(
        name, dir + "/trigger/current_trigger is empty",
        "cat /sys/bus/iio/devices/trigger*/name  # then [imu] trigger = \"NAME\" in " + patient.board_path);
  return passed(name, std::string(device) + " is " + dir.substr(patient.root.size()));
}

void examine_chip(const Patient& patient, Findings* findings) {
  const bbb_imu_t& imu = patient.board->wiring.imu;
  const std::string name = imu.bus;
  const std::string bus = patient.path(name);
  const bool there = may(bus, F_OK);
  if (!there || !may(bus, R_OK | W_OK)) {
    findings->push_back(
        failure("imu.bus", name + ": " + reason(errno),
                there ? kGroupFix : "sudo modprobe i2c-dev && ls /dev/i2c-*  # then correct [imu] bus"));
    return;
  }
  i2c_dev_t chip{};
  int status = i2c_dev_open(&chip, bus.c_str(), imu.address);
  if (status == -ENOTTY || status == -EOPNOTSUPP) {
    findings->push_back(failure("imu.bus", name + " is not an I2C bus that can do plain transfers",
                                "ls -l /sys/class/i2c-dev  # then correct [imu] bus"));
    return;
  }
  std::uint8_t who = 0;
  if (status == 0) {
    findings->push_back(passed("imu.bus", name + " opens"));
    status = i2c_dev_read(&chip, MPU9250_WHO_AM_I, &who, 1);
    i2c_dev_close(&chip);
  }
  findings->push_back(examine_imu_answer(imu, status, who));
}

Finding examine_dmp(const Patient& patient) {
  const std::string path = patient.board->wiring.imu.dmp_firmware;
  if (path.empty()) return passed("imu.dmp", "no firmware image given: our own attitude filter is used");
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error || size != DMP_FIRMWARE_BYTES)
    return failure("imu.dmp",
                   path + ": " + (error ? error.message() : std::to_string(size) + " bytes, not 3062"),
                   "ls -l " + path + "  # correct [imu] dmp_firmware, or set it to \"\" for our own filter");
  const int range_g = patient.board->wiring.imu.accel_range_g;
  if (range_g != 2 && range_g != 8)
    return failure("imu.dmp", "the DMP runs at 2 or 8 g, not at " + std::to_string(range_g),
                   "set [imu] accel_range_g = 8 in " + patient.board_path);
  return passed("imu.dmp", path + " has the right size; accelerometer at " + std::to_string(range_g) +
                               (range_g == 2 ? " g, as InvenSense's driver sets it"
                                             : " g, as librobotcontrol sets it since 0.4.0"));
}

Finding examine_encoder(const Patient& patient, std::uint32_t i) {
  const std::string device = patient.board->wiring.motor[i].encoder;
  const std::string name = "encoder." + std::to_string(i + 1);
  std::string file;
  const std::string counter = find(patient, "/sys/bus/counter/devices", "counter", device);
  if (!counter.empty()) file = counter + "/count0/enable";
  if (counter.empty()) {
    const std::string legacy = find(patient, "/sys/bus/platform/devices", device, device);
    if (!legacy.empty() && may(legacy + "/position", F_OK)) file = legacy + "/enabled";
  }
  if (file.empty())
    return failure(name, "no eQEP at " + device + ": driver or device tree node missing",
                   overlay_fix(patient));
  if (!may(file, W_OK)) return failure(name, file + ": " + reason(errno), kGroupFix);
  return passed(name, "eQEP at " + device);
}

Finding examine_pwm(const Patient& patient, std::uint32_t i) {
  const bbb_motor_t& motor = patient.board->wiring.motor[i];
  const std::string name = "pwm." + std::to_string(i + 1);
  const std::string chip = find(patient, "/sys/class/pwm", "pwmchip", motor.pwm);
  std::int64_t channels = 0;
  if (chip.empty())
    return failure(name, std::string("no EHRPWM at ") + motor.pwm + ": driver or device tree node missing",
                   overlay_fix(patient));
  if (sysfs_read_number(chip.c_str(), "npwm", &channels) < 0 || channels <= motor.pwm_channel)
    return failure(name,
                   chip + " has " + std::to_string(channels) + " channels, needs channel " +
                       (motor.pwm_channel == 0 ? "A" : "B"),
                   "ls -l /sys/class/pwm  # then correct [[motor]] pwm and pwm_channel");
  if (!may(chip + "/export", W_OK)) return failure(name, chip + "/export: " + reason(errno), kGroupFix);
  return passed(name,
                std::string("EHRPWM at ") + motor.pwm + " channel " + (motor.pwm_channel == 0 ? "A" : "B"));
}

Finding examine_adc(const Patient& patient) {
  const bbb_config_t& wiring = patient.board->wiring;
  const std::string device = find(patient, "/sys/bus/iio/devices", "iio:device", wiring.adc);
  if (device.empty())
    return failure("battery.adc", std::string("no ADC named ") + wiring.adc, overlay_fix(patient));
  const std::string attribute = "in_voltage" + std::to_string(wiring.battery_channel) + "_raw";
  std::int64_t counts = 0;
  const int status = sysfs_read_number(device.c_str(), attribute.c_str(), &counts);
  if (status < 0)
    return failure("battery.adc", device + "/" + attribute + ": " + reason(status), overlay_fix(patient));
  const double volts = patient.board->facts.battery_V_per_count * static_cast<double>(counts) +
                       patient.board->facts.battery_offset_V;
  const std::string text = format("%.2f V (%lld counts)", volts, static_cast<long long>(counts));
  constexpr double kTwoCells_V = 6.4;  // 3.2 V per LiPo cell: as good as empty
  if (volts < kTwoCells_V)
    return warning("battery.adc", text + ": empty or not connected", "charge and connect the battery");
  return passed("battery.adc", text);
}

Finding examine_serial(const Patient& patient) {
  const std::string& device = patient.board->serial_device;
  if (device.empty()) return skipped("serial", "not used by this board file");
  std::string path = patient.path(device);
  if (device.front() != '/') {
    const std::string tty = find(patient, "/sys/class/tty", "tty", device);
    if (tty.empty())
      return warning("serial", "no UART at " + device + ": no remote control", overlay_fix(patient));
    path = patient.path("/dev/" + tty.substr(tty.rfind('/') + 1));
  }
  const int fd = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd >= 0) {
    close(fd);
    return passed("serial", device + ": " + path.substr(patient.root.size()) + " opens");
  }
  const int error = errno;
  return warning("serial", path + ": " + reason(error) + ": no remote control",
                 error == EACCES ? kGroupFix : overlay_fix(patient));
}

Finding examine_can(const Patient& patient) {
  const Board& board = *patient.board;
  if (board.can_interface.empty()) return skipped("can", "not used by this board file");
  const bool blue = board.overlay == "blue";  // its CAN has pads and a transceiver of its own
  if (board.serial_device == "48022000" && !blue)
    return failure(
        "can", "DCAN1 and UART1 share P9.24 and P9.26",
        "set [serial] device = \"481aa000\" in " + patient.board_path + " and move the HC-06 to P8.37/38");
  const std::string net = find(patient, "/sys/class/net", "", board.can_interface);
  if (net.empty())
    return failure("can", "no CAN interface " + board.can_interface,
                   blue ? overlay_fix(patient)
                        : "echo 'uboot_overlay_addr5=/lib/firmware/equipoise-can.dtbo' | sudo tee -a "
                          "/boot/uEnv.txt && sudo reboot");
  const std::string interface = net.substr(net.rfind('/') + 1);
  if (first_line(net + "/operstate") == "down")
    return warning("can", interface + " is down",
                   "sudo ip link set " + interface + " up type can bitrate " +
                       std::to_string(board.can_bitrate) + " restart-ms 100");
  return passed("can", interface + " is up");
}

}  // namespace

void examine_buses(const Patient& patient, Findings* findings) {
  const bbb_imu_t& imu = patient.board->wiring.imu;
  if (imu.driver == BBB_IMU_IIO) {
    const imu_part_t* part = imu_part(imu.part);
    findings->push_back(examine_iio(patient, "imu.gyro", part->gyro_device));
    findings->push_back(examine_iio(patient, "imu.accel", part->accel_device));
  } else {
    examine_chip(patient, findings);
    findings->push_back(examine_dmp(patient));
  }
  for (std::uint32_t i = 0; i < patient.board->wiring.motors; ++i) {
    findings->push_back(examine_encoder(patient, i));
    findings->push_back(examine_pwm(patient, i));
  }
  findings->push_back(examine_adc(patient));
  findings->push_back(examine_serial(patient));
  findings->push_back(examine_can(patient));
}

}  // namespace equipoise::app::doctor
