// Commands over a serial line and a CAN bus: a pseudo-terminal in the place of the HC-06, a bus in memory.
#include "app/run/wires.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <unistd.h>

#include <chrono>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <thread>

#include "app/cli/commands.hpp"
#include "app/run/can_wire.hpp"
#include "equipoise/runtime/command_receiver.hpp"
#include "equipoise/runtime/command_sender.hpp"

namespace equipoise::app {
namespace {

using runtime::WireSide;

class Master final : public runtime::ByteStream {
 public:
  explicit Master(int fd) : fd_(fd) { fcntl(fd_, F_SETFL, O_NONBLOCK); }
  std::size_t read(std::uint8_t* out, std::size_t size) override {
    const ssize_t n = ::read(fd_, out, size);
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    const ssize_t n = ::write(fd_, data, size);
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  double bytes_per_s() const override { return 11520.0; }

 private:
  int fd_;
};

runtime::CommandKeys keys() { return runtime::CommandKeys::of_robot("mbbr", runtime::CommandKey({1, 2, 3})); }

/// A robot with a command receiver, and a holder of its key at the other end of a wire.
template <class Wire>
class Remote {
 public:
  Remote(std::unique_ptr<runtime::CommandWire> robots, std::unique_ptr<Wire> holders)
      : robot_(keys(), {}, std::move(robots)), wire_(std::move(holders)), sender_(keys(), "", "anna") {}

  void listen(int milliseconds = 20) {
    wire_->listen(milliseconds, [&](const std::uint8_t* data, std::size_t size) {
      const auto length = static_cast<int>(size);
      command_session_t said;
      if (said.decode(data, 0, length) == length && sender_.hear(said)) heard_ = said;
    });
    while (const auto question = sender_.ask()) say(*question);
  }
  /// Until the robot is as wanted, or five seconds.
  template <class Wanted>
  bool wait(Wanted&& wanted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    while (!wanted() && std::chrono::steady_clock::now() < end) listen();
    return wanted();
  }
  bool meet() {
    return wait([&] { return !sender_.links().empty(); });
  }
  runtime::CommandSender::Link& link() { return sender_.links().front(); }
  signed_command_t command(std::int8_t action) {
    return sender_.sign(&link(), link().turn, action, {{0.1, 0.0}, 0.0});
  }
  void say(const signed_command_t& m) { wire_->say(runtime::encoded(m)); }

  runtime::CommandReceiver robot_;
  std::unique_ptr<Wire> wire_;
  runtime::CommandSender sender_;
  command_session_t heard_{};
};

class SerialRemote : public ::testing::Test {
 protected:
  void SetUp() override {
    char name[64] = {};
    ASSERT_EQ(openpty(&master_, &slave_, name, nullptr, nullptr), 0);
    remote_.emplace(open_wire("serial:" + std::string(name) + ":115200", WireSide::kRobot),
                    std::make_unique<runtime::StreamWire>(std::make_unique<Master>(master_)));
    ASSERT_TRUE(remote_->meet());
  }
  void TearDown() override {
    remote_.reset();
    close(master_);
    close(slave_);
  }

  int master_ = -1;
  int slave_ = -1;
  std::optional<Remote<runtime::StreamWire>> remote_;
};

TEST_F(SerialRemote, ObeysTheHolderOfTheKey) {
  auto& r = *remote_;
  EXPECT_FALSE(r.robot_.latest().arm);
  r.say(r.command(signed_command_t::ARM));
  ASSERT_TRUE(r.wait([&] { return r.link().turn == 1; }));
  EXPECT_TRUE(r.robot_.latest().arm);
  r.robot_.tell(ArmState::kArmed);
  r.say(r.command(signed_command_t::DRIVE));
  ASSERT_TRUE(r.wait([&] { return r.link().confirmed == r.link().signed_up_to; }));
  EXPECT_EQ(r.robot_.latest().velocity_W_m_s.x(), 0.1);
  EXPECT_TRUE(r.wait([&] { return r.link().state == command_session_t::ARMED; }));
}

TEST_F(SerialRemote, RefusesForgeriesReplaysAndNoise) {
  auto& r = *remote_;
  const signed_command_t first = r.command(signed_command_t::DRIVE);
  r.say(first);
  ASSERT_TRUE(r.wait([&] { return r.link().confirmed == first.sequence; }));
  constexpr int kAttacks = 1000;
  const std::int64_t refused = r.heard_.refused;
  const std::int64_t accepted = r.heard_.accepted;
  for (int i = 0; i < kAttacks; ++i) {
    signed_command_t m = first;
    if (i % 2 != 0) {
      m.sequence += i;
      m.mac[i % 16] = static_cast<std::uint8_t>(m.mac[i % 16] ^ (1U << (i % 8)));
    }
    r.say(m);
    if (i % 16 == 15) {  // let it hear: a pseudo-terminal holds 4 kB
      const std::int64_t sent = refused + i + 1;
      ASSERT_TRUE(r.wait([&] { return r.heard_.refused >= sent; })) << i;
    }
  }
  EXPECT_TRUE(r.wait([&] { return r.heard_.refused >= refused + kAttacks; }));
  EXPECT_EQ(r.heard_.accepted, accepted);
}

/// A bus in memory: what one port sends the others hear, with room for ten frames like a real interface's.
class Bus {
 public:
  class Port final : public CanBus {
   public:
    explicit Port(Bus* bus) : bus_(bus) { bus_->ports_.push_back(this); }
    bool receive(can_frame* out) override {
      const std::lock_guard lock(bus_->mutex_);
      if (heard_.empty()) return false;
      *out = heard_.front();
      heard_.pop_front();
      return true;
    }
    bool send(const can_frame& frame) override {
      const std::lock_guard lock(bus_->mutex_);
      if (++bus_->sent_ % 11 == 0) return false;  // no room now
      for (Port* port : bus_->ports_)
        if (port != this) port->heard_.push_back(frame);
      return true;
    }

   private:
    Bus* bus_;
    std::deque<can_frame> heard_;
  };
  std::unique_ptr<CanBus> port() { return std::make_unique<Port>(this); }

 private:
  std::mutex mutex_;
  std::vector<Port*> ports_;
  int sent_ = 0;
};

TEST(CanRemote, ObeysTheHolderOfTheKeyAmongGarbage) {
  Bus bus;
  const auto noise = bus.port();
  auto holders = std::make_unique<CanWire>(bus.port(), WireSide::kOwner);
  Remote<CanWire> r(std::make_unique<CanWire>(bus.port(), WireSide::kRobot), std::move(holders));
  std::mt19937 random(3);
  const auto babble = [&] {
    for (std::uint32_t talker = 0; talker < CanWire::kTalkers; ++talker) {
      can_frame frame{};
      frame.can_id = 0x1C0 + static_cast<std::uint32_t>(random() % 0x50U);
      frame.can_dlc = static_cast<std::uint8_t>(random() % 9U);
      for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
      noise->send(frame);
    }
  };
  ASSERT_TRUE(r.meet());
  for (int i = 0; i < 20; ++i) babble();
  for (int i = 0; i < 100 && r.link().turn == 0; ++i) {  // said again until a whole one gets through
    r.say(r.command(signed_command_t::ARM));
    r.listen();
  }
  EXPECT_EQ(r.link().turn, 1);
  EXPECT_TRUE(r.robot_.latest().arm);
}

TEST(CanRemote, TwoTalkersAtOnceAreBothHeard) {
  Bus bus;
  CanWire robot(bus.port(), WireSide::kRobot);
  CanWire a(bus.port(), WireSide::kOwner);
  CanWire b(bus.port(), WireSide::kOwner);
  const std::vector<std::uint8_t> ours(100, 1);
  const std::vector<std::uint8_t> theirs(100, 2);
  const auto nothing = [](const std::uint8_t*, std::size_t) {};
  int heard = 0;
  for (int i = 0; i < 20; ++i) {  // they may have to find out first that they share an identifier
    std::thread other([&] { b.say(theirs); });
    a.say(ours);
    other.join();
    heard = 0;
    for (int k = 0; k < 4; ++k) robot.listen(5, [&](const std::uint8_t*, std::size_t) { ++heard; });
    a.listen(1, nothing);
    b.listen(1, nothing);
  }
  EXPECT_EQ(heard, 2);
}

TEST(Wires, NamesWhatItCannotOpen) {
  const auto complaint = [](const std::string& name) -> std::string {
    try {
      open_wire(name, WireSide::kOwner);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(complaint("serial:/dev/no-such-line:9600"), ::testing::HasSubstr("/dev/no-such-line"));
  EXPECT_THAT(complaint("serial:/dev/null"), ::testing::HasSubstr("serial:DEVICE:BAUD"));
  EXPECT_THAT(complaint("serial:/dev/null:12"), ::testing::HasSubstr("1200 to 115200"));
  EXPECT_THAT(complaint("can:no-such-bus"), ::testing::HasSubstr("no-such-bus"));
}

}  // namespace
}  // namespace equipoise::app
