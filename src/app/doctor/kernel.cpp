// Kernel, device tree, clocks.
#include <sys/timex.h>

#include <ctime>

#include "app/doctor/doctor.hpp"

namespace equipoise::app::doctor {
namespace {

// BeagleBoard.org's Debian images; their kernels have the eQEP driver that Debian's own armmp kernel lacks.
constexpr const char* kKernelFix =
    "apt-cache search --names-only 'linux-image.*bone-rt'  # install the newest of these, then reboot";

void examine_preemption(const Patient& patient, Findings* findings) {
  const std::string version = first_line(patient.path("/proc/version"));
  if (version.empty()) {
    findings->skip("kernel.preempt_rt", "/proc/version cannot be read");
  } else if (first_line(patient.path("/sys/kernel/realtime")) == "1" ||
             version.find("PREEMPT_RT") != std::string::npos) {
    findings->ok("kernel.preempt_rt", "the kernel is PREEMPT_RT");
  } else if (patient.board == nullptr) {
    findings->ok("kernel.preempt_rt", "no PREEMPT_RT; only a robot needs it");
  } else {
    findings->warn("kernel.preempt_rt", "the kernel is not PREEMPT_RT: ticks will be late under load",
                   kKernelFix);
  }
}

void examine_model(const Patient& patient, Findings* findings) {
  const std::string model = first_line(patient.path("/proc/device-tree/model"));
  if (model.find("Beagle") != std::string::npos) {
    findings->ok("device_tree.model", model);
  } else if (patient.board == nullptr) {
    findings->skip("device_tree.model", model.empty()
                                            ? "no device tree: a machine for simulation, not a robot"
                                            : "\"" + model + "\": not a BeagleBone, nothing known about it");
  } else {
    findings->fail("device_tree.model", "\"" + model + "\" is not a BeagleBone",
                   "run this on the robot: ssh debian@beaglebone.local equipoise doctor --board FILE");
  }
}

void examine_clock(const Patient& patient, Findings* findings) {
  const std::string source =
      first_line(patient.path("/sys/devices/system/clocksource/clocksource0/current_clocksource"));
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  if (source == "jiffies" || resolution.tv_sec != 0 || resolution.tv_nsec > 1000) {
    findings->fail("clock.monotonic",
                   "clock source " + source + ", resolution " + std::to_string(resolution.tv_nsec) + " ns",
                   "boot a kernel with high-resolution timers (CONFIG_HIGH_RES_TIMERS=y)");
  } else {
    findings->ok("clock.monotonic", "clock source " + (source.empty() ? "unknown" : source) +
                                        ", resolution " + std::to_string(resolution.tv_nsec) + " ns");
  }
  timex state{};
  if (adjtimex(&state) < 0 || (state.status & STA_UNSYNC) != 0) {
    findings->warn("clock.wall",
                   "not synchronised: dates of logs and calibrations may be wrong (the board has no battery "
                   "for its clock)",
                   "sudo timedatectl set-ntp true");
  } else {
    findings->ok("clock.wall", "synchronised");
  }
}

}  // namespace

void examine_kernel(const Patient& patient, Findings* findings) {
  examine_preemption(patient, findings);
  examine_model(patient, findings);
  examine_clock(patient, findings);
}

}  // namespace equipoise::app::doctor
