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

TEST_F(Manager, ThatIsNotThereOrHasTooLongANameIsNotToldAnything) {
  unsetenv("NOTIFY_SOCKET");
  notify_service_manager("READY=1");
  setenv("NOTIFY_SOCKET", std::string(1000, 'x').c_str(), 1);
  notify_service_manager("READY=1");
  EXPECT_TRUE(heard().empty());
}

}  // namespace
}  // namespace equipoise::app
