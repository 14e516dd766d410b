// doctor --report: one text file for whoever helps from afar.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "app/board/calibration_file.hpp"
#include "app/doctor/doctor.hpp"
#include "app/text/version.hpp"

namespace equipoise::app::doctor {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 14> kFiles{
    "/proc/version",
    "/proc/cmdline",
    "/proc/device-tree/model",
    "/etc/os-release",
    "/boot/uEnv.txt",
    "/boot/extlinux/extlinux.conf",
    "/proc/modules",
    "/proc/interrupts",
    "/proc/meminfo",
    "/sys/kernel/debug/gpio",
    "/sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/pins",
    "/sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/pinmux-pins",
    "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
    "/sys/class/watchdog/watchdog0/state",
};

constexpr std::array<const char*, 8> kFolders{
    "/proc/device-tree/chosen/overlays",
    "/sys/class/pwm",
    "/sys/bus/counter/devices",
    "/sys/bus/iio/devices",
    "/sys/bus/gpio/devices",
    "/sys/class/tty",
    "/sys/class/i2c-dev",
    "/sys/class/leds",
};

constexpr std::size_t kMostOfAFile = 65536;

std::string start_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return "(not there, or not for this user)\n";
  std::string text(kMostOfAFile, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  std::replace(text.begin(), text.end(), '\0', '\n');  // strings of the device tree
  return text.empty() || text.back() == '\n' ? text : text + "\n";
}

/// Names and, of links, where they lead: addresses.
std::string listing(const std::string& path) {
  std::vector<std::string> lines;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(path, error)) {
    std::string line = entry.path().filename().string();
    if (entry.is_symlink(error)) line += " -> " + fs::read_symlink(entry.path(), error).string();
    lines.push_back(line);
  }
  std::sort(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text.empty() ? "(empty)\n" : text;
}

/// Interrupt threads and what is ours, with their priorities: fields of /proc/PID/stat.
std::string threads(const Patient& patient) {
  std::string text;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(patient.path("/proc"), error)) {
    const std::string comm = first_line(entry.path().string() + "/comm");
    if (comm.rfind("irq/", 0) == 0 || comm.rfind("equipoise", 0) == 0)
      text += first_line(entry.path().string() + "/stat") + "\n";
  }
  return text.empty() ? "(none)\n" : text;
}

}  // namespace

void write_report(const Patient& patient, const Findings& findings, const std::string& path) {
  const auto title = [](const std::string& name) { return "\n=== " + name + "\n"; };
  std::string text = "equipoise " + version() + "\n" + title("findings");
  for (const Finding& f : findings)
    text += std::string(name_of(f.verdict)) + " " + f.name + ": " + f.what + "\n";
  if (!patient.board_path.empty()) text += title(patient.board_path) + start_of(patient.board_path);
  for (const char* file : kFiles) text += title(file) + start_of(patient.path(file));
  for (const char* folder : kFolders) text += title(folder) + listing(patient.path(folder));
  text += title("threads") + threads(patient);
  write_whole(text, path);
}

}  // namespace equipoise::app::doctor
