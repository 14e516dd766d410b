// GPIO chips and lines, and what the pads of all pins are switched to.
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "app/board/am335x.hpp"
#include "app/doctor/doctor.hpp"
#include "sysfs.h"

namespace equipoise::app::doctor {
namespace {

constexpr const char* kSignature = "equipoise";  // as the drivers sign their requests

struct Line {
  std::string use;  // "motor 1 in1"
  std::string chip;
  std::uint32_t line;
  bool input;
};

std::vector<Line> lines_of(const Board& board) {
  std::vector<Line> lines;
  const auto pin = [&lines](const std::string& use, const bbb_pin_t& p, bool input) {
    if (p.used) lines.push_back({use, p.chip, p.line, input});
  };
  const auto line = [&lines](const std::string& use, const BoardLine& l, bool input) {
    lines.push_back({use, l.chip, static_cast<std::uint32_t>(l.line), input});
  };
  pin("[bridges] enable", board.wiring.enable, false);
  pin("[imu] interrupt", board.wiring.imu.interrupt, true);
  for (std::uint32_t i = 0; i < board.wiring.motors; ++i) {
    const std::string motor = "motor " + std::to_string(i + 1) + " ";
    pin(motor + "in1", board.wiring.motor[i].in1, false);
    pin(motor + "in2", board.wiring.motor[i].in2, false);
    pin(motor + "fault", board.wiring.motor[i].fault, true);
  }
  line("[leds] red", board.led_red, false);
  line("[leds] green", board.led_green, false);
  for (const BoardLine& bar : board.led_bars) line("[leds] bars", bar, false);
  line("[buttons] pause", board.button_pause, true);
  line("[buttons] mode", board.button_mode, true);
  return lines;
}

/// Who holds a line; empty: nobody, or the kernel does not say.
std::string holder_of(const std::string& chip_path, std::uint32_t line) {
  const int fd = open(chip_path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return "";
  gpio_v2_line_info info{};
  info.offset = line;
  const bool asked = ioctl(fd, GPIO_V2_GET_LINEINFO_IOCTL, &info) == 0;
  close(fd);
  if (!asked || (info.flags & GPIO_V2_LINE_FLAG_USED) == 0) return "";
  return info.consumer[0] == '\0' ? "a kernel driver" : info.consumer;
}

void examine_line(const Patient& patient, Findings* findings, const Line& line) {
  const std::string name = "gpio." + line.chip + "." + std::to_string(line.line);
  char dir[SYSFS_PATH_MAX];
  if (sysfs_find(patient.path("/sys/bus/gpio/devices").c_str(), "gpiochip", line.chip.c_str(), dir) < 0) {
    findings->fail(
        name, line.use + ": no gpio chip \"" + line.chip + "\"",
        "gpiodetect; ls -l /sys/bus/gpio/devices  # then correct the board file " + patient.board_path);
    return;
  }
  const std::string device = patient.path("/dev/" + std::string(std::strrchr(dir, '/') + 1));
  if (access(device.c_str(), R_OK | W_OK) != 0) {
    findings->fail(name, line.use + ": " + device + ": " + std::strerror(errno), kGroupFix);
    return;
  }
  const std::string holder = holder_of(device, line.line);
  if (holder == kSignature) {
    findings->warn(name, line.use + ": held by a running equipoise", "sudo systemctl stop equipoise");
  } else if (line.use.rfind("[leds]", 0) == 0 &&
             access(patient.path("/sys/class/leds/" + holder).c_str(), F_OK) == 0 && !holder.empty()) {
    findings->ok(name, line.use + ": the kernel's LED " + holder);
  } else if (!holder.empty()) {
    findings->fail(name, line.use + ": held by \"" + holder + "\"", overlay_fix(patient));
  } else {
    findings->ok(name, line.use + ": free");
  }
}

/// Pad control registers, as pinctrl-single prints them: "pin 18 (PIN18) ... 44e10848 00000006
/// pinctrl-single".
std::map<std::uint32_t, std::uint32_t> read_pads(const std::string& path) {
  constexpr std::uint32_t kControlModule = 0x44e10000;
  std::map<std::uint32_t, std::uint32_t> pads;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string word;
    while (words >> word) {
      if (word.size() != 8 || word.compare(0, 5, "44e10") != 0) continue;
      std::string value;
      words >> value;
      const auto address = static_cast<std::uint32_t>(std::strtoul(word.c_str(), nullptr, 16));
      pads[address - kControlModule] = static_cast<std::uint32_t>(std::strtoul(value.c_str(), nullptr, 16));
      break;
    }
  }
  return pads;
}

struct Use {
  std::string use;
  std::vector<Pad> pads;
  std::string owner;  // in the kernel's list of pads; empty: whoever
};

std::vector<Use> uses_of(const Board& board) {
  std::vector<Use> uses;
  constexpr const char* kPinController = "44e10800";  // our lines are its own
  uses.push_back({"[imu] bus", pads_of_port(board.wiring.imu.bus), ""});
  for (std::uint32_t i = 0; i < board.wiring.motors; ++i) {
    const bbb_motor_t& motor = board.wiring.motor[i];
    const std::string name = "motor " + std::to_string(i + 1) + " ";
    uses.push_back({name + "pwm", pads_of_pwm(motor.pwm, motor.pwm_channel), motor.pwm});
    uses.push_back({name + "encoder", pads_of_encoder(motor.encoder), motor.encoder});
  }
  for (const Line& line : lines_of(board))
    uses.push_back({line.use, pads_of_gpio(line.chip, line.line, line.input),
                    line.use.rfind("[leds]", 0) == 0 ? "" : kPinController});  // the Blue's own tree has LEDs
  const bool blue = board.overlay == "blue";
  uses.push_back({"[serial] device", pads_of_port(board.serial_device), board.serial_device});
  uses.push_back({"[can] interface", pads_of_port(board.can_interface, blue), board.can_interface});
  return uses;
}

void examine_pad(const Patient& patient, Findings* findings, const std::string& use, const Pad& pad,
                 const std::map<std::uint32_t, std::uint32_t>& pads) {
  const std::string name = "pinmux." + pad.pin;
  const auto found = pads.find(pad.offset);
  if (found == pads.end()) {
    findings->skip(name, use + ": the kernel does not list its pad");
    return;
  }
  const std::uint32_t mode = found->second & 7U;
  const bool deaf = pad.input && (found->second & kPadReceiver) == 0;
  if (mode != pad.mode) {
    findings->fail(
        name, use + ": pad is in mode " + std::to_string(mode) + ", needs mode " + std::to_string(pad.mode),
        overlay_fix(patient));
  } else if (deaf) {
    findings->fail(name, use + ": the pad's receiver is off, it reads nothing", overlay_fix(patient));
  } else {
    findings->ok(name, use + ": mode " + std::to_string(mode));
  }
}

/// Who has claimed each pad: "pin 18 (PIN18): 48302200.pwm (GPIO UNCLAIMED) function ..." or "(MUX
/// UNCLAIMED)".
std::map<std::uint32_t, std::string> read_owners(const std::string& path) {
  constexpr std::uint32_t kFirstPad = 0x800;
  std::map<std::uint32_t, std::string> owners;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    unsigned pin = 0;
    const std::size_t colon = line.find("): ");
    if (colon == std::string::npos || std::sscanf(line.c_str(), "pin %u", &pin) != 1) continue;
    const std::string rest = line.substr(colon + 3);
    if (rest.front() != '(') owners[kFirstPad + 4 * pin] = rest.substr(0, rest.find(' '));
  }
  return owners;
}

void examine_owner(const Patient& patient, Findings* findings, const Use& use, const Pad& pad,
                   const std::map<std::uint32_t, std::string>& owners) {
  const auto found = owners.find(pad.offset);
  if (use.owner.empty() || use.owner.front() == '/') return;
  const std::string name = "owner." + pad.pin;
  if (found == owners.end()) {
    findings->warn(name, use.use + ": nobody has claimed its pad", overlay_fix(patient));
  } else if (found->second.find(use.owner) == std::string::npos) {
    findings->fail(name, use.use + ": its pad belongs to " + found->second, overlay_fix(patient));
  }
}

void examine_pinmux(const Patient& patient, Findings* findings) {
  const std::string controller = patient.path("/sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/");
  const auto pads = read_pads(controller + "pins");
  if (pads.empty()) {
    findings->skip("pinmux", "only root may read what the pins are switched to",
                   "sudo equipoise doctor --board " + patient.board_path);
    return;
  }
  const auto owners = read_owners(controller + "pinmux-pins");
  for (const Use& use : uses_of(*patient.board)) {
    for (const Pad& pad : use.pads) {
      examine_pad(patient, findings, use.use, pad, pads);
      if (!owners.empty()) examine_owner(patient, findings, use, pad, owners);
    }
  }
}

}  // namespace

void examine_pins(const Patient& patient, Findings* findings) {
  for (const Line& line : lines_of(*patient.board)) examine_line(patient, findings, line);
  examine_pinmux(patient, findings);
}

}  // namespace equipoise::app::doctor
