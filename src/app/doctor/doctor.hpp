// What keeps this machine from running a robot: kernel, device tree, pins, chips, permissions, limits.
// In: file system root ("" is the machine), board file, key -> out: findings, each with the command that
// mends it. Changes nothing on the machine but reads of the IMU's identity. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "app/board/board.hpp"

namespace equipoise::app::doctor {

enum class Verdict { kOk, kWarn, kFail, kSkipped };
const char* name_of(Verdict verdict);

struct Finding {
  std::string name;  // what was looked at: "imu.chip"
  Verdict verdict;
  std::string what;  // found
  std::string fix;   // a command to copy, or what to do; empty when nothing has to be done
};

Finding passed(const std::string& name, const std::string& what);
Finding warning(const std::string& name, const std::string& what, const std::string& fix);
Finding failure(const std::string& name, const std::string& what, const std::string& fix);
Finding skipped(const std::string& name, const std::string& what, const std::string& fix = "");

using Findings = std::vector<Finding>;
bool healthy(const Findings& findings);  // nothing fails

struct Patient {
  std::string root;              // "": this machine; a directory in tests
  const Board* board = nullptr;  // null: no robot asked for
  std::string board_path;
  std::string key;  // command key file; empty: none

  std::string path(const std::string& absolute) const { return root + absolute; }
};

/// Loads the overlay that sets every pin and enables every device that a board file names.
std::string overlay_fix(const Patient& patient);
/// Lets the user who asks at the devices; takes effect at the next login.
extern const char* const kGroupFix;

void examine_kernel(const Patient& patient, Findings* findings);    // kernel, device tree, clock
void examine_process(const Patient& patient, Findings* findings);   // limits, LCM route, key
void examine_buses(const Patient& patient, Findings* findings);     // I2C, counters, PWM, ADC, serial, CAN
void examine_pins(const Patient& patient, Findings* findings);      // pinmux, GPIO chips and lines
void examine_overlay(const Patient& patient, Findings* findings);   // device tree, boot loader's files
void examine_schedule(const Patient& patient, Findings* findings);  // interrupts, CPU frequency, watchdog

Findings examine(const Patient& patient);

/// First line of a file, or of a device tree string; empty where there is none.
std::string first_line(const std::string& path);

/// What a maintainer needs to help from afar: the findings and what they were drawn from. No keys, no names
/// of people or networks. InputError when the file cannot be written.
void write_report(const Patient& patient, const Findings& findings, const std::string& path);

}  // namespace equipoise::app::doctor
