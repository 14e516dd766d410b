// GPIO chips and lines, and what the pads of all pins are switched to.
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "app/doctor/doctor.hpp"
#include "sysfs.h"

namespace equipoise::app::doctor {
namespace {

// The AM335x's pads as the BeagleBone Black brings them out. Facts of the chip, not wiring: TI SPRS717 table
// 4-1 (pin attributes), SPRUH73 table 9-7 (control module).
struct Pad {
  std::string pin;       // "P9.14"
  std::uint32_t offset;  // of conf_*, in the control module at 44e10000
  std::uint32_t mode;    // bits 2..0
  bool input = false;    // the receiver must be on, bit 5
};

constexpr std::uint32_t kPadGpio = 7;
constexpr std::uint32_t kPadReceiver = 1U << 5;

struct GpioPad {
  const char* chip;
  std::uint32_t line;
  const char* pin;
  std::uint32_t offset;
};

constexpr const char* kGpio0 = "44e07000";
constexpr const char* kGpio1 = "4804c000";
constexpr const char* kGpio2 = "481ac000";
constexpr const char* kGpio3 = "481ae000";

// Lines of the robots' headers and their neighbours; a pad that no header has goes by its ball's name.
constexpr std::array<GpioPad, 33> kGpioPads{{
    {kGpio0, 10, "P8.31", 0x8d8}, {kGpio0, 11, "P8.32", 0x8dc}, {kGpio2, 0, "gpmc_csn3", 0x888},
    {kGpio0, 20, "P9.41", 0x9b4}, {kGpio0, 22, "P8.19", 0x820}, {kGpio0, 23, "P8.13", 0x824},
    {kGpio0, 26, "P8.14", 0x828}, {kGpio0, 27, "P8.17", 0x82c}, {kGpio0, 30, "P9.11", 0x870},
    {kGpio0, 31, "P9.13", 0x874}, {kGpio1, 12, "P8.12", 0x830}, {kGpio1, 13, "P8.11", 0x834},
    {kGpio1, 16, "P9.15", 0x840}, {kGpio1, 17, "P9.23", 0x844}, {kGpio1, 18, "P9.14", 0x848},
    {kGpio1, 19, "P9.16", 0x84c}, {kGpio1, 28, "P9.12", 0x878}, {kGpio1, 29, "P8.26", 0x87c},
    {kGpio2, 1, "P8.18", 0x88c},  {kGpio2, 2, "P8.7", 0x890},   {kGpio2, 3, "P8.8", 0x894},
    {kGpio2, 4, "P8.10", 0x898},  {kGpio2, 5, "P8.9", 0x89c},   {kGpio2, 6, "P8.45", 0x8a0},
    {kGpio2, 7, "P8.46", 0x8a4},  {kGpio2, 8, "P8.43", 0x8a8},  {kGpio2, 9, "P8.44", 0x8ac},
    {kGpio2, 17, "P8.34", 0x8cc}, {kGpio3, 15, "P9.29", 0x994}, {kGpio3, 16, "P9.30", 0x998},
    {kGpio3, 17, "P9.28", 0x99c}, {kGpio3, 19, "P9.27", 0x9a4}, {kGpio3, 21, "P9.25", 0x9ac},
}};

/// Pads of an EHRPWM channel ("48302200", 0), an eQEP ("48300180"), a bus ("/dev/i2c-2"), a UART or CAN
/// controller
/// ("48022000", "481d0000"; the BeagleBone Blue's CAN is on other pads); empty: not known.
std::vector<Pad> pads_of_pwm(const std::string& device, std::uint32_t channel) {
  if (device == "48302200") return {channel == 0 ? Pad{"P9.14", 0x848, 6} : Pad{"P9.16", 0x84c, 6}};
  if (device == "48304200") return {channel == 0 ? Pad{"P8.19", 0x820, 4} : Pad{"P8.13", 0x824, 4}};
  return {};
}

std::vector<Pad> pads_of_encoder(const std::string& device) {
  if (device == "48300180") return {{"P9.42", 0x9a0, 1, true}, {"P9.27", 0x9a4, 1, true}};
  if (device == "48302180") return {{"P8.35", 0x8d0, 2, true}, {"P8.33", 0x8d4, 2, true}};
  if (device == "48304180") return {{"P8.12", 0x830, 4, true}, {"P8.11", 0x834, 4, true}};
  return {};
}

std::vector<Pad> pads_of_port(const std::string& port, bool blue = false) {
  if (port == "/dev/i2c-2") return {{"P9.20", 0x978, 3, true}, {"P9.19", 0x97c, 3, true}};
  if (port == "48022000") return {{"P9.26", 0x980, 0, true}, {"P9.24", 0x984, 0}};
  if (port == "481a8000") return {{"P9.11", 0x870, 6, true}};  // its transmitter is another robot's business
  if (port == "481aa000") return {{"P8.37", 0x8c0, 4}, {"P8.38", 0x8c4, 4, true}};
  if (port == "481d0000" && blue) return {{"uart0_ctsn", 0x968, 2}, {"uart0_rtsn", 0x96c, 2, true}};
  if (port == "481d0000") return {{"P9.26", 0x980, 2}, {"P9.24", 0x984, 2, true}};
  return {};
}

/// Empty: not on a header.
std::vector<Pad> pads_of_gpio(const std::string& chip, std::uint32_t line, bool input) {
  for (const GpioPad& pad : kGpioPads) {
    if (chip == pad.chip && line == pad.line) return {{pad.pin, pad.offset, kPadGpio, input}};
  }
  return {};
}

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

Finding examine_line(const Patient& patient, const Line& line) {
  const std::string name = "gpio." + line.chip + "." + std::to_string(line.line);
  char dir[SYSFS_PATH_MAX];
  if (sysfs_find(patient.path("/sys/bus/gpio/devices").c_str(), "gpiochip", line.chip.c_str(), dir) < 0)
    return failure(
        name, line.use + ": no gpio chip \"" + line.chip + "\"",
        "gpiodetect; ls -l /sys/bus/gpio/devices  # then correct the board file " + patient.board_path);
  const std::string device = patient.path("/dev/" + std::string(std::strrchr(dir, '/') + 1));
  if (access(device.c_str(), R_OK | W_OK) != 0)
    return failure(name, line.use + ": " + device + ": " + std::strerror(errno), kGroupFix);
  const std::string holder = holder_of(device, line.line);
  if (holder == kSignature)
    return warning(name, line.use + ": held by a running equipoise", "sudo systemctl stop equipoise");
  if (line.use.rfind("[leds]", 0) == 0 &&
      access(patient.path("/sys/class/leds/" + holder).c_str(), F_OK) == 0 && !holder.empty())
    return passed(name, line.use + ": the kernel's LED " + holder);
  if (!holder.empty()) return failure(name, line.use + ": held by \"" + holder + "\"", overlay_fix(patient));
  return passed(name, line.use + ": free");
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

Finding examine_pad(const Patient& patient, const std::string& use, const Pad& pad,
                    const std::map<std::uint32_t, std::uint32_t>& pads) {
  const std::string name = "pinmux." + pad.pin;
  const auto found = pads.find(pad.offset);
  if (found == pads.end()) return skipped(name, use + ": the kernel does not list its pad");
  const std::uint32_t mode = found->second & 7U;
  const bool deaf = pad.input && (found->second & kPadReceiver) == 0;
  if (mode != pad.mode)
    return failure(
        name, use + ": pad is in mode " + std::to_string(mode) + ", needs mode " + std::to_string(pad.mode),
        overlay_fix(patient));
  if (deaf) return failure(name, use + ": the pad's receiver is off, it reads nothing", overlay_fix(patient));
  return passed(name, use + ": mode " + std::to_string(mode));
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
    findings->push_back(warning(name, use.use + ": no driver has claimed its pad", overlay_fix(patient)));
  } else if (found->second.find(use.owner) == std::string::npos) {
    findings->push_back(
        failure(name, use.use + ": its pad belongs to " + found->second, overlay_fix(patient)));
  }
}

void examine_pinmux(const Patient& patient, Findings* findings) {
  const std::string controller = patient.path("/sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/");
  const auto pads = read_pads(controller + "pins");
  if (pads.empty()) {
    findings->push_back(skipped("pinmux", "only root may read what the pins are switched to",
                                "sudo equipoise doctor --board " + patient.board_path));
    return;
  }
  const auto owners = read_owners(controller + "pinmux-pins");
  for (const Use& use : uses_of(*patient.board)) {
    for (const Pad& pad : use.pads) {
      findings->push_back(examine_pad(patient, use.use, pad, pads));
      if (!owners.empty()) examine_owner(patient, findings, use, pad, owners);
    }
  }
}

}  // namespace

void examine_pins(const Patient& patient, Findings* findings) {
  for (const Line& line : lines_of(*patient.board)) findings->push_back(examine_line(patient, line));
  examine_pinmux(patient, findings);
}

}  // namespace equipoise::app::doctor
