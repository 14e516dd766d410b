#include "app/doctor/doctor.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

namespace equipoise::app::doctor {

const char* const kGroupFix = "sudo adduser \"$USER\" equipoise  # then log in again";

std::string overlay_fix(const Patient& patient) {
  std::error_code error;
  if (std::filesystem::exists(patient.path("/boot/extlinux/extlinux.conf"), error))
    return "sudo sed -i 's/^default .*/default equipoise/' /boot/extlinux/extlinux.conf && sudo reboot";
  const std::string overlay = patient.board == nullptr ? "cape" : patient.board->overlay;
  if (overlay == "none")
    return "none of ours is for this board: switch the pin in the board's own device tree";
  return "echo 'uboot_overlay_addr4=/lib/firmware/equipoise-" + overlay +
         ".dtbo' | sudo tee -a /boot/uEnv.txt && sudo reboot";
}

const char* name_of(Verdict verdict) {
  constexpr std::array<const char*, 4> kNames{"ok", "warn", "fail", "skipped"};
  // cppcheck-suppress CastIntegerToAddressAtReturn  ; an array of names
  return kNames[static_cast<std::size_t>(verdict)];
}

Finding passed(const std::string& name, const std::string& what) { return {name, Verdict::kOk, what, ""}; }
Finding warning(const std::string& name, const std::string& what, const std::string& fix) {
  return {name, Verdict::kWarn, what, fix};
}
Finding failure(const std::string& name, const std::string& what, const std::string& fix) {
  return {name, Verdict::kFail, what, fix};
}
Finding skipped(const std::string& name, const std::string& what, const std::string& fix) {
  return {name, Verdict::kSkipped, what, fix};
}

bool healthy(const Findings& findings) {
  return std::none_of(findings.begin(), findings.end(),
                      [](const Finding& f) { return f.verdict == Verdict::kFail; });
}

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line.substr(0, line.find('\0'));
}

Findings examine(const Patient& asked) {
  Findings findings;
  Patient patient = asked;
  const bool robot = !first_line(asked.path("/proc/device-tree/model")).empty();
  if (!robot) patient.board = nullptr;  // whoever asks from a laptop learns about the laptop
  examine_kernel(patient, &findings);
  examine_overlay(patient, &findings);
  examine_schedule(patient, &findings);
  examine_process(patient, &findings);
  if (patient.board != nullptr) {
    examine_buses(patient, &findings);
    examine_pins(patient, &findings);
  } else if (asked.board != nullptr) {
    findings.push_back(
        skipped("board", asked.board_path + " is a board file without an error; what it names is on a robot",
                "on the robot: equipoise doctor --board " + asked.board_path));
  } else {
    findings.push_back(skipped("board", "no board file given: nothing of a robot was looked at",
                               "equipoise doctor --board config/boards/robotics_cape_mbbr.toml"));
  }
  return findings;
}

}  // namespace equipoise::app::doctor
