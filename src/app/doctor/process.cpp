// What this user's processes may do: real-time limits, multicast, keys.
#include <arpa/inet.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "app/doctor/doctor.hpp"
#include "equipoise/runtime/command_key.hpp"
#include "equipoise/runtime/realtime.hpp"

namespace equipoise::app::doctor {
namespace {

constexpr const char* kTelemetryGroup = "239.255.76.67";  // of runtime::kDefaultTelemetryUrl
constexpr int kCapIpcLock = 14;                           // <linux/capability.h>
constexpr int kCapSysNice = 23;

/// The word behind `name` at the start of a line; empty: no line begins so.
std::string word_behind(const std::string& name, const std::string& path) {
  std::ifstream file(path);
  std::string word;
  for (std::string line; word.empty() && std::getline(file, line);)
    if (line.rfind(name, 0) == 0) std::istringstream(line.substr(name.size())) >> word;
  return word;
}

/// Soft limit of /proc/self/limits, e.g. "Max realtime priority"; -1: unlimited.
std::int64_t soft_limit(const Patient& patient, const std::string& name) {
  const std::string value = word_behind(name, patient.path("/proc/self/limits"));
  return value == "unlimited" ? -1 : std::strtoll(value.c_str(), nullptr, 10);
}

bool has_capability(const Patient& patient, int bit) {
  const std::string value = word_behind("CapEff:", patient.path("/proc/self/status"));
  return ((std::strtoull(value.c_str(), nullptr, 16) >> bit) & 1U) != 0;
}

/// `needed` or more, or the capability that makes the limit irrelevant.
Finding examine_limit(const Patient& patient, const std::string& name, const std::string& limit,
                      std::int64_t needed, int capability, const std::string& line) {
  const std::int64_t value = soft_limit(patient, limit);
  const std::string text = value < 0 ? "unlimited" : std::to_string(value);
  if (value < 0 || value >= needed || has_capability(patient, capability))
    return passed(name, limit + " " + text + (has_capability(patient, capability) ? " (privileged)" : ""));
  const std::string what = limit + " is " + text + ", the loop needs " + std::to_string(needed);
  const std::string fix =
      "echo '" + line + "' | sudo tee -a /etc/security/limits.d/equipoise.conf  # then " + "log in again";
  if (patient.board == nullptr) return warning(name, what + " on a robot", fix);
  return failure(name, what, fix);
}

Finding examine_idle(const Patient& patient) {
  if (access(patient.path("/dev/cpu_dma_latency").c_str(), R_OK | W_OK) == 0)
    return passed("limits.cpu_idle", "/dev/cpu_dma_latency may be held");
  return warning("limits.cpu_idle", "/dev/cpu_dma_latency cannot be opened: wake-ups from deep idle are slow",
                 kGroupFix);
}

/// Any route that takes the telemetry group, the default route included.
bool has_route(const Patient& patient, std::string* interface) {
  std::ifstream file(patient.path("/proc/net/route"));
  const std::uint32_t group = inet_addr(kTelemetryGroup);  // network order, as the kernel prints it
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string name, destination, gateway, flags, used, uses, metric, mask;
    if (!(fields >> name >> destination >> gateway >> flags >> used >> uses >> metric >> mask)) continue;
    const auto number = [](const std::string& hex) {
      return static_cast<std::uint32_t>(std::strtoul(hex.c_str(), nullptr, 16));
    };
    if ((group & number(mask)) == number(destination)) {
      *interface = name;
      return true;
    }
  }
  return false;
}

Finding examine_route(const Patient& patient) {
  std::string interface;
  if (has_route(patient, &interface))
    return passed("lcm.route", std::string(kTelemetryGroup) + " goes out through " + interface);
  return warning("lcm.route", std::string("no route to ") + kTelemetryGroup + ": no telemetry, only the log",
                 "sudo ip link set lo up && sudo ip route add 224.0.0.0/4 dev lo");
}

Finding examine_key(const Patient& patient) {
  if (patient.key.empty())
    return skipped("command.key", "no key file given", "equipoise doctor --command-key FILE");
  try {
    runtime::CommandKeys::load(patient.key);
    return passed("command.key", patient.key + " is a key that only its owner reads");
  } catch (const std::runtime_error& error) {
    namespace fs = std::filesystem;
    std::error_code missing;
    const fs::perms mode = fs::status(patient.key, missing).permissions();
    const bool open_to_others = !missing && fs::exists(patient.key) &&
                                (mode & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none;
    return failure("command.key", error.what(),
                   open_to_others
                       ? "chmod 600 " + patient.key
                       : "equipoise keygen NEWFILE  # and give the same file to those who send commands");
  }
}

}  // namespace

void examine_process(const Patient& patient, Findings* findings) {
  constexpr std::int64_t kLocked_bytes = 256 << 20;  // code, stacks and the log queue, generously
  findings->push_back(examine_limit(patient, "limits.rtprio", "Max realtime priority",
                                    runtime::kGuardPriority, kCapSysNice, "@equipoise - rtprio 99"));
  findings->push_back(examine_limit(patient, "limits.memlock", "Max locked memory", kLocked_bytes,
                                    kCapIpcLock, "@equipoise - memlock unlimited"));
  if (patient.board != nullptr) findings->push_back(examine_idle(patient));
  findings->push_back(examine_route(patient));
  findings->push_back(examine_key(patient));
}

}  // namespace equipoise::app::doctor
