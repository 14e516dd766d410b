#include "app/doctor/doctor.hpp"

#include <fstream>

namespace equipoise::app::doctor {

const char* const kOverlayFix =
    "echo 'uboot_overlay_addr4=/lib/firmware/equipoise-cape.dtbo' | sudo tee -a /boot/uEnv.txt && sudo "
    "reboot";
const char* const kGroupFix = "sudo adduser \"$USER\" equipoise  # then log in again";

bool Findings::healthy() const {
  for (const Finding& finding : all_) {
    if (finding.verdict == Verdict::kFail) return false;
  }
  return true;
}

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line.substr(0, line.find('\0'));
}

Findings examine(const Patient& patient) {
  Findings findings;
  examine_kernel(patient, &findings);
  examine_process(patient, &findings);
  if (patient.board == nullptr) {
    findings.skip("board", "no board file given: nothing of a robot was looked at",
                  "equipoise doctor --board config/boards/robotics_cape_mbbr.toml");
    return findings;
  }
  if (first_line(patient.path("/proc/device-tree/model")).empty()) {
    findings.skip("board", "nothing that the board file names was looked for on a machine of another kind");
    return findings;
  }
  examine_buses(patient, &findings);
  examine_pins(patient, &findings);
  return findings;
}

}  // namespace equipoise::app::doctor
