// What runs when: interrupt threads, CPU frequency, and the watchdog for a kernel that runs nothing any more.
#include <algorithm>
#include <climits>
#include <filesystem>
#include <sstream>

#include "app/doctor/doctor.hpp"

namespace equipoise::app::doctor {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSetFix =
    "sudo /usr/lib/equipoise/real-time-machine  # the service does it at every start";

Finding examine_governor(const Patient& patient) {
  const std::string governor =
      first_line(patient.path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"));
  if (governor.empty() || governor == "performance")
    return passed("kernel.cpu_frequency", governor.empty() ? "fixed" : governor);
  return warning("kernel.cpu_frequency", "governor " + governor + ": the first ticks after a pause run slow",
                 kSetFix);
}

/// Field 40 of /proc/PID/stat, real-time priority; the name before it may hold spaces.
int priority_of(const std::string& stat) {
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(stat.substr(name_end + 1));
  std::string field;
  for (int i = 3; i <= 40; ++i) fields >> field;
  return std::atoi(field.c_str());
}

/// "irq/45-4819c000.i2c", of which old kernels keep 15 characters, belongs to one of these.
bool serves(const std::string& comm, const std::vector<const char*>& devices) {
  const std::size_t dash = comm.find('-');
  if (comm.rfind("irq/", 0) != 0 || dash == std::string::npos) return false;
  const std::string device = comm.substr(dash + 1);
  return std::any_of(devices.begin(), devices.end(), [&](const char* d) { return device.rfind(d, 0) == 0; });
}

/// The sample comes through GPIO and I2C2; Ethernet and MMC can wait.
Finding examine_irq_threads(const Patient& patient) {
  const std::vector<const char*> ours_on{"4819c00", "44e0700", "4804c00", "481ac00", "481ae00"};
  const std::vector<const char*> others_on{"4a10000", "4806000", "481d800", "4781000"};
  int ours = INT_MAX;
  int others = 0;
  std::string lowest;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(patient.path("/proc"), error)) {
    const std::string comm = first_line(entry.path().string() + "/comm");
    const bool is_ours = serves(comm, ours_on);
    if (!is_ours && !serves(comm, others_on)) continue;
    const int priority = priority_of(first_line(entry.path().string() + "/stat"));
    if (!is_ours) others = std::max(others, priority);
    if (is_ours && priority < ours) {
      ours = priority;
      lowest = comm;
    }
  }
  if (ours == INT_MAX)
    return skipped("kernel.irq_threads", "no interrupt threads: only PREEMPT_RT kernels have them");
  if (ours > others)
    return passed("kernel.irq_threads", "I2C2 and GPIO at " + std::to_string(ours) +
                                            ", Ethernet and MMC at " + std::to_string(others));
  return warning("kernel.irq_threads",
                 lowest + " has priority " + std::to_string(ours) + ", Ethernet or MMC " +
                     std::to_string(others) + ": they delay samples",
                 kSetFix);
}

/// The PWM units keep their duty whatever becomes of the kernel; a reset switches their pads back.
Finding examine_watchdog(const Patient& patient) {
  const std::string dir = patient.path("/sys/class/watchdog/watchdog0");
  const std::string state = first_line(dir + "/state");
  if (state == "active")
    return passed("kernel.watchdog",
                  first_line(dir + "/identity") + ", " + first_line(dir + "/timeout") + " s");
  if (state.empty())
    return warning("kernel.watchdog", "no hardware watchdog: a kernel that hangs keeps the motors' last duty",
                   "sudo modprobe omap_wdt && echo omap_wdt | sudo tee /etc/modules-load.d/watchdog.conf");
  return warning(
      "kernel.watchdog",
      "the hardware watchdog is " + state + ": a kernel that hangs keeps the motors' last duty",
      "sudo mkdir -p /etc/systemd/system.conf.d && printf '[Manager]\\nRuntimeWatchdogSec=5\\n' | sudo tee "
      "/etc/systemd/system.conf.d/equipoise.conf && sudo systemctl daemon-reexec");
}

}  // namespace

void examine_schedule(const Patient& patient, Findings* findings) {
  if (patient.board == nullptr) return;
  findings->push_back(examine_governor(patient));
  findings->push_back(examine_irq_threads(patient));
  findings->push_back(examine_watchdog(patient));
}

}  // namespace equipoise::app::doctor
