// What the service manager hears of a loop: ready, a beat while it ticks, silence when it hangs, its end.
#include "app/guard/service_notify.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "support/log_folder.hpp"

namespace equipoise::app {
namespace {

class Manager : public LogFolder {
 protected:
  Manager() : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string name = (folder_ / "notify").string();
    std::strcpy(address.sun_path, name.c_str());
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
    setenv("WATCHDOG_USEC", "200000", 1);
  }
  ~Manager() override {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(fd_);
  }
  std::vector<std::string> heard() const {
    std::vector<std::string> all;
    char text[100];
    for (ssize_t n = 0; (n = recv(fd_, text, sizeof text, 0)) > 0;)
      all.emplace_back(text, static_cast<std::size_t>(n));
    return all;
  }
  static void wait(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

  int fd_;
};

TEST_F(Manager, HearsALoopThatTicksAndNotOneThatHangs) {
  {
    ServiceNotify service;
    wait(300);
    EXPECT_TRUE(heard().empty()) << "no tick yet";
    const auto began = std::chrono::steady_clock::now();
    for (int tick = 0; tick < 80; ++tick, wait(5)) service.note(tick);
    const std::vector<std::string> alive = heard();
    const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - began;
    ASSERT_GE(alive.size(), 2U);
    EXPECT_LE(static_cast<double>(alive.size()), passed.count() / 50.0 + 2.0)
        << "four in the watchdog's time";
    EXPECT_EQ(alive.front(), "READY=1\nWATCHDOG=1");
    EXPECT_EQ(alive.back(), "WATCHDOG=1");
    wait(200);  // the last ticks' beat
    (void)heard();
    wait(600);
    EXPECT_TRUE(heard().empty()) << "a loop that hangs is not kept alive";
  }
  EXPECT_EQ(heard(), std::vector<std::string>{"STOPPING=1"});
}

TEST_F(Manager, HearsOnceThatItIsReadyFromTheFirstTickOn) {
  ServiceNotify service;
  const auto comes = [&] {
    std::vector<std::string> told;
    for (int i = 0; told.empty() && i < 400; ++i, wait(5)) told = heard();
    return told;
  };
  service.note(0);
  EXPECT_EQ(comes(), std::vector<std::string>{"READY=1\nWATCHDOG=1"});
  service.note(1);
  EXPECT_EQ(comes(), std::vector<std::string>{"WATCHDOG=1"});
}

TEST_F(Manager, IsFoundUnderANameWithoutAFile) {
  const std::string name = std::string(1, '\0') + "equipoise-test-" + std::to_string(getpid());
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, name.data(), name.size());
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
  ASSERT_EQ(bind(fd, reinterpret_cast<const sockaddr*>(&address), size), 0);
  setenv("NOTIFY_SOCKET", ("@" + name.substr(1)).c_str(), 1);  // as sd_notify(3) writes it
  notify_service_manager("READY=1");
  char text[100];
  const ssize_t length = recv(fd, text, sizeof text, 0);
  EXPECT_EQ(std::string(text, static_cast<std::size_t>(std::max<ssize_t>(length, 0))), "READY=1");
  close(fd);
}

/// Without a watchdog a beat a second is enough, but ready is said at once.
TEST_F(Manager, WithoutAWatchdogHearsAtOnceThatItIsReady) {
  for (const char* allowed : {"none", "", "0", "-5", "soon"}) {
    setenv("WATCHDOG_USEC", allowed, 1);
    if (allowed == std::string("none")) unsetenv("WATCHDOG_USEC");
    (void)heard();  // the end of the one before
    ServiceNotify service;
    const auto began = std::chrono::steady_clock::now();
    std::vector<std::string> told;
    for (int tick = 0; told.empty() && tick < 400; ++tick, wait(5)) {
      service.note(tick);
      told = heard();
    }
    EXPECT_EQ(told, std::vector<std::string>{"READY=1\nWATCHDOG=1"}) << allowed;
    for (int tick = 400; tick < 440; ++tick, wait(5)) service.note(tick);
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began;
    EXPECT_LE(static_cast<double>(heard().size()), passed.count()) << allowed;
  }
}

TEST_F(Manager, ThatDoesNotListenHoldsNobodyUpAndLeavesNothingOpen) {
  const auto descriptors = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  const auto before = descriptors();
  for (int i = 0; i < 2000; ++i) notify_service_manager("WATCHDOG=1");
  EXPECT_EQ(descriptors(), before);
}

TEST_F(Manager, MayHaveANameOf107Characters) {
  const auto told = [](std::size_t length) {
    const std::string name = "@" + std::string(length - 1, 'x');
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data() + 1, length - 1);
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
    EXPECT_EQ(bind(fd, reinterpret_cast<const sockaddr*>(&address), size), 0);
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
    notify_service_manager("READY=1");
    char text[100];
    const ssize_t count = recv(fd, text, sizeof text, 0);
    close(fd);
    return count > 0;
  };
  EXPECT_TRUE(told(107));
  EXPECT_FALSE(told(108)) << "no room for the end of a file's name";
}

TEST_F(Manager, ThatIsNotThereOrHasTooLongANameIsNotToldAnything) {
  unsetenv("NOTIFY_SOCKET");
  notify_service_manager("READY=1");
  setenv("NOTIFY_SOCKET", std::string(1000, 'x').c_str(), 1);
  notify_service_manager("READY=1");
  EXPECT_TRUE(heard().empty());
}

TEST_F(Manager, IsNotNeeded) {
  unsetenv("NOTIFY_SOCKET");
  ServiceNotify service;
  for (int tick = 0; tick < 10; ++tick) service.note(tick);
}

}  // namespace
}  // namespace equipoise::app
