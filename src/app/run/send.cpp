#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>

#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/cli/key_file.hpp"
#include "app/run/wires.hpp"
#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

using runtime::CommandKey;
using Clock = std::chrono::steady_clock;

struct Arguments {
  std::string key;
  std::string url = runtime::kDefaultTelemetryUrl;
  double drive_mps = 0.0;
  double sideways_mps = 0.0;
  double yaw_hz = 0.0;
  double duration_s = 0.2;
  double timeout_s = 2.0;
  bool arm = false;
  bool heading_reset = false;
};

/// The robot at the other end of the wire.
class Robot {
 public:
  explicit Robot(const std::string& url) : wire_(open_wire(url, runtime::WireSide::kOwner)) {}

  void listen(int milliseconds) {
    wire_->listen(milliseconds, [this](const std::uint8_t* data, std::size_t size) {
      command_session_t heard;
      const auto length = static_cast<int>(size);
      if (heard.decode(data, 0, length) == length) session_ = heard;
    });
  }
  const std::optional<command_session_t>& session() const { return session_; }
  void send(const signed_command_t& message) { runtime::say(*wire_, message); }
  double interval_s() const { return wire_->interval_s(); }

 private:
  std::unique_ptr<runtime::CommandWire> wire_;
  std::optional<command_session_t> session_;
};

Clock::time_point after(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

int send(const Arguments& a) {
  const CommandKey key = load_key(a.key);
  Robot robot(a.url);
  watch_interrupts();
  for (const auto limit = after(a.timeout_s); !robot.session();) {
    if (Clock::now() > limit || interrupted.load())
      throw std::runtime_error("no robot that takes commands is heard on " + a.url +
                               " (it needs equipoise run --command-key FILE)");
    robot.listen(20);
  }
  signed_command_t m{};
  std::memcpy(m.session, robot.session()->session, sizeof m.session);
  m.sequence = robot.session()->last_sequence;
  m.velocity_W_m_s[0] = a.drive_mps;
  m.velocity_W_m_s[1] = a.sideways_mps;
  m.yaw_rate_rad_s = 2.0 * kPi * a.yaw_hz;
  m.arm = a.arm ? 1 : 0;
  m.heading_reset = a.heading_reset ? 1 : 0;
  const auto end = after(a.duration_s);
  std::int64_t sent = 0;
  do {
    ++m.sequence;
    key.sign(&m);
    robot.send(m);
    m.heading_reset = 0;
    ++sent;
    for (const auto next = after(robot.interval_s()); Clock::now() < next;) robot.listen(10);
  } while (Clock::now() < end && !interrupted.load());
  for (const auto limit = after(a.timeout_s); robot.session()->last_sequence < m.sequence;) {
    if (Clock::now() > limit)
      throw std::runtime_error("the robot took none or not all of " + std::to_string(sent) +
                               " commands; has it the same key?");
    robot.listen(20);
  }
  std::printf("%lld commands accepted\n", static_cast<long long>(sent));
  return 0;
}

}  // namespace

void add_keygen(Subcommand app) {
  const Subcommand command = app.subcommand("keygen", "Makes the key that senders and robot share");
  auto path = std::make_shared<std::string>();
  command.option("file", *path, "new file, for its owner only; copy it to the robot").required();
  command.action([=] {
    create_key(*path);
    std::printf("%s\n", path->c_str());
    return 0;
  });
}

void add_send(Subcommand app) {
  const Subcommand command = app.subcommand("send", "Commands a robot that runs with --command-key");
  auto a = std::make_shared<Arguments>();
  command.option("--key", a->key, "key file, see keygen").required();
  command.option("--url", a->url, std::string("the robot's --command-url: ") + kWireHelp).show_default();
  command.option("--drive-mps", a->drive_mps, "forward, m/s").range(-2.0, 2.0);
  command.option("--sideways-mps", a->sideways_mps, "to the left, m/s").range(-2.0, 2.0);
  command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second").range(-5.0, 5.0);
  command.flag("--arm,!--disarm", a->arm, "motors on; off is the default");
  command.flag("--heading-reset", a->heading_reset, "forward is where the robot points now");
  command.option("--duration-s", a->duration_s, "repeat for this long, s")
      .show_default()
      .range(0.0, 360000.0);
  command.option("--timeout-s", a->timeout_s, "longest wait for the robot, s")
      .show_default()
      .range(0.1, 60.0);
  command.action([=] { return send(*a); });
}

}  // namespace equipoise::app
