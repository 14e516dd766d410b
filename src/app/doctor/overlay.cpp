// The device tree as it was booted: our overlay, its kind, and what the boot loader's files say.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "app/doctor/doctor.hpp"

namespace equipoise::app::doctor {
namespace {

namespace fs = std::filesystem;

constexpr const char* kChoose = "sudo /usr/lib/equipoise/choose-overlays && sudo reboot";

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// #pinctrl-cells of the pin controller at 44e10800; 0: unknown.
int pinctrl_cells(const Patient& patient) {
  std::error_code error;
  const fs::path tree = fs::canonical(patient.path("/proc/device-tree"), error);
  if (error) return 0;
  fs::recursive_directory_iterator at(tree, error);
  for (; !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    if (at->path().filename() != "#pinctrl-cells" || at->path().parent_path().filename() != "pinmux@800")
      continue;
    const std::string cells = text_of(at->path().string());  // big-endian
    return cells.size() == 4 ? static_cast<unsigned char>(cells[3]) : 0;
  }
  return 0;
}

/// Loaded overlays of ours and the kind they were compiled for: "equipoise-cape.kernel", "pinctrl-cells 2".
void examine_loaded(const Patient& patient, Findings* findings, int cells) {
  const std::string chosen = patient.path("/proc/device-tree/chosen/overlays");
  std::error_code error;
  if (!fs::is_directory(chosen, error)) {
    findings->push_back(
        skipped("device_tree.overlay", "this boot loader does not say which overlays it loaded"));
    return;
  }
  const std::string ours = "equipoise-" + patient.board->overlay;
  bool found = false;
  const std::string wanted = "pinctrl-cells " + std::to_string(cells);
  for (const auto& entry : fs::directory_iterator(chosen, error)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("equipoise", 0) != 0) continue;
    found = found || name.rfind(ours, 0) == 0;
    const std::string kind = first_line(entry.path().string());
    if (cells != 0 && kind != wanted) {
      std::string what = name;
      what.append(" is for \"").append(kind).append("\", this kernel has #pinctrl-cells = <");
      what.append(std::to_string(cells)).append(">: wrong pads were switched, of the eMMC too");
      findings->push_back(failure("device_tree.cells", what, kChoose));
    }
  }
  findings->push_back(
      found ? passed("device_tree.overlay", ours + " is loaded")
            : warning("device_tree.overlay", "the overlay " + ours + " is not loaded", overlay_fix(patient)));
}

/// What the next start will load.
void examine_chosen(const Patient& patient, Findings* findings, int cells) {
  const std::string file = "/lib/firmware/equipoise-" + patient.board->overlay;
  const std::string right = patient.path(file + "-" + std::to_string(cells) + "cell.dtbo");
  std::error_code error;
  if (cells == 0 || !fs::exists(right, error)) return;  // not by our package
  const bool twin = text_of(right) == text_of(patient.path(file + ".dtbo"));
  const std::string cells_of = "#pinctrl-cells = <" + std::to_string(cells) + ">";
  findings->push_back(twin ? passed("device_tree.twin", file + ".dtbo is the one for " + cells_of)
                           : failure("device_tree.twin",
                                     file + ".dtbo is not the one for this kernel's " + cells_of, kChoose));
}

struct Setting {
  const char* name;
  const char* line;  // that must be there; with `off`: that must not
  bool off;
  const char* what;
};

constexpr Setting kSettings[] = {
    {"uenv.video", "disable_uboot_overlay_video=1", false, "HDMI takes the pads of motors and encoders"},
    {"uenv.audio", "disable_uboot_overlay_audio=1", false,
     "HDMI's sound takes the pads of the IMU's interrupt"},
    {"uenv.cape_universal", "enable_uboot_cape_universal=1", true,
     "the universal cape takes every pad of the headers"},
};

/// BeagleBoard.org's boot loader reads /boot/uEnv.txt.
void examine_uenv(const Patient& patient, Findings* findings) {
  std::ifstream file(patient.path("/boot/uEnv.txt"));
  if (!file || patient.board->overlay != "cape") return;
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);)
    lines.push_back(line.substr(0, line.find_last_not_of(" \t\r") + 1));
  for (const Setting& s : kSettings) {
    const bool there = std::find(lines.begin(), lines.end(), s.line) != lines.end();
    if (there != s.off) {
      findings->push_back(passed(s.name, std::string(s.line) + (s.off ? " is not set" : " is set")));
    } else if (s.off) {
      findings->push_back(
          failure(s.name, std::string("/boot/uEnv.txt: ") + s.line + ": " + s.what,
                  std::string("sudo sed -i 's/^") + s.line + "/#&/' /boot/uEnv.txt && sudo reboot"));
    } else {
      findings->push_back(
          failure(s.name, std::string("/boot/uEnv.txt without ") + s.line + ": " + s.what,
                  std::string("echo ") + s.line + " | sudo tee -a /boot/uEnv.txt && sudo reboot"));
    }
  }
}

}  // namespace

void examine_overlay(const Patient& patient, Findings* findings) {
  if (patient.board == nullptr || patient.board->overlay == "none") return;
  const int cells = pinctrl_cells(patient);
  examine_loaded(patient, findings, cells);
  examine_chosen(patient, findings, cells);
  examine_uenv(patient, findings);
}

}  // namespace equipoise::app::doctor
