// Kernel, device tree, clocks.
#include <sys/timex.h>

#include <ctime>

#include "app/doctor/doctor.hpp"

namespace equipoise::app::doctor {
namespace {

// BeagleBoard.org's Debian images; their kernels have the eQEP driver that Debian's own armmp kernel lacks.
constexpr const char* kKernelFix =
    "apt-cache search --names-only 'linux-image.*bone-rt'  # install the newest of these, then reboot";

Finding examine_preemption(const Patient& patient) {
  const std::string version = first_line(patient.path("/proc/version"));
  if (version.empty()) return skipped("kernel.preempt_rt", "/proc/version cannot be read");
  if (first_line(patient.path("/sys/kernel/realtime")) == "1" ||
      version.find("PREEMPT_RT") != std::string::npos)
    return passed("kernel.preempt_rt", "the kernel is PREEMPT_RT");
  if (patient.board == nullptr) return passed("kernel.preempt_rt", "no PREEMPT_RT; only a robot needs it");
  return warning("kernel.preempt_rt", "the kernel is not PREEMPT_RT: ticks will be late under load",
                 kKernelFix);
}

Finding examine_model(const Patient& patient) {
  const std::string model = first_line(patient.path("/proc/device-tree/model"));
  if (model.find("Beagle") != std::string::npos) return passed("device_tree.model", model);
  if (patient.board == nullptr)
    return skipped("device_tree.model", model.empty()
                                            ? "no device tree: a machine for simulation, not a robot"
                                            : "\"" + model + "\": not a BeagleBone, nothing known about it");
  return failure("device_tree.model", "\"" + model + "\" is not a BeagleBone",
                 "run this on the robot: ssh debian@beaglebone.local equipoise doctor --board FILE");
}

Finding examine_monotonic(const Patient& patient) {
  const std::string source =
      first_line(patient.path("/sys/devices/system/clocksource/clocksource0/current_clocksource"));
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  const std::string what = "clock source " + (source.empty() ? "unknown" : source) + ", resolution " +
                           std::to_string(resolution.tv_nsec) + " ns";
  if (source == "jiffies" || resolution.tv_sec != 0 || resolution.tv_nsec > 1000)
    return failure("clock.monotonic", what,
                   "boot a kernel with high-resolution timers (CONFIG_HIGH_RES_TIMERS=y)");
  return passed("clock.monotonic", what);
}

Finding examine_wall_clock() {
  timex state{};
  if (adjtimex(&state) >= 0 && (state.status & STA_UNSYNC) == 0) return passed("clock.wall", "synchronised");
  return warning(
      "clock.wall",
      "not synchronised: dates of logs and calibrations may be wrong (the board has no battery for "
      "its clock)",
      "sudo timedatectl set-ntp true");
}

}  // namespace

void examine_kernel(const Patient& patient, Findings* findings) {
  for (const Finding& each : {examine_preemption(patient), examine_model(patient), examine_monotonic(patient),
                              examine_wall_clock()})
    findings->push_back(each);
}

}  // namespace equipoise::app::doctor
