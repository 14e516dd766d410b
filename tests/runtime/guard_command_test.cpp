// `equipoise guard` as whoever starts it sees it: what it refuses, where it says so, what it leaves behind.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "equipoise/runtime/heartbeat.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise {
namespace {

class GuardCommand : public ::testing::Test {
 protected:
  struct End {
    int status = -1;
    std::string said;  // on stderr
    std::string complaint;
  };

  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() / ("equipoise-guard-command-" + std::to_string(getpid()));
    std::filesystem::create_directories(dir_);
    for (const char* name : {"enable", "pwm"}) std::ofstream(dir_ / name) << "7\n";
  }
  void TearDown() override {
    if (pid_ > 0) finish(SIGKILL);
    std::filesystem::remove_all(dir_);
  }

  void start(const std::vector<std::string>& arguments) {
    ASSERT_EQ(pipe2(complaint_, O_CLOEXEC), 0);
    const std::string log = dir_ / "stderr";
    pid_ = fork();
    if (pid_ != 0) return;
    const int fd = dup(heartbeat_.fd());  // these two without close-on-exec
    const int complain = dup(complaint_[1]);
    dup2(open(log.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600), STDERR_FILENO);
    std::vector<std::string> all = {"equipoise", "guard"};
    for (const std::string& argument : arguments)
      all.push_back(argument == "PAGE"   ? std::to_string(fd)
                    : argument == "PIPE" ? std::to_string(complain)
                                         : argument);
    std::vector<char*> argv;
    for (std::string& argument : all) argv.push_back(argument.data());
    argv.push_back(nullptr);
    execv(EQUIPOISE_BINARY, argv.data());
    _exit(127);
  }
  End finish(int signal = 0) {
    if (signal != 0) kill(pid_, signal);
    End end;
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = 0;
    if (WIFEXITED(status)) end.status = WEXITSTATUS(status);
    close(complaint_[1]);
    char text[512];
    const ssize_t size = read(complaint_[0], text, sizeof text);
    close(complaint_[0]);
    if (size > 0) end.complaint.assign(text, static_cast<std::size_t>(size));
    std::getline(std::ifstream(dir_ / "stderr"), end.said, '\0');
    return end;
  }
  End of(const std::vector<std::string>& arguments) {
    start(arguments);
    return finish();
  }
  bool polls(std::uint32_t more = 1) {
    std::int64_t last = heartbeat_.page().guard_ns;
    for (int i = 0; i < 10000 && more > 0; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      if (last == heartbeat_.page().guard_ns) continue;
      last = heartbeat_.page().guard_ns;
      --more;
    }
    return more == 0;
  }
  std::string value(const char* name) const {
    std::string text;
    std::ifstream(dir_ / name) >> text;
    return text;
  }
  std::string path(const char* name) const { return dir_ / name; }

  std::filesystem::path dir_;
  runtime::SharedHeartbeat heartbeat_;
  int complaint_[2] = {-1, -1};
  pid_t pid_ = 0;
};

TEST_F(GuardCommand, NeedsOneWayToSwitchOff) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--heartbeat-fd", "PAGE"},
        {"--heartbeat-fd", "PAGE", "--board", path("pwm"), "--pwm", path("pwm")}}) {
    const End end = of(arguments);
    EXPECT_EQ(end.status, 2);
    EXPECT_NE(end.said.find("either --board FILE or --pwm FILE"), std::string::npos) << end.said;
  }
}

TEST_F(GuardCommand, SaysWhatItCannotOpenOnStderrOrWhereItIsTold) {
  End end = of({"--heartbeat-fd", "PAGE", "--pwm", path("none")});
  EXPECT_EQ(end.status, 2);
  EXPECT_NE(end.said.find(path("none")), std::string::npos) << end.said;
  end = of({"--heartbeat-fd", "PAGE", "--pwm", path("none"), "--complain-fd", "PIPE"});
  EXPECT_EQ(end.status, 1);
  EXPECT_EQ(end.complaint, path("none") + ": cannot be opened for writing by the guard");
  EXPECT_EQ(end.said, "");
  end = of({"--heartbeat-fd", "0", "--pwm", path("pwm"), "--complain-fd", "PIPE"});
  EXPECT_EQ(end.status, 1);
  EXPECT_NE(end.complaint.find("heartbeat page: "), std::string::npos) << end.complaint;
}

TEST_F(GuardCommand, OptionsHaveBounds) {
  const std::set<std::pair<std::string, std::string>> bad = {
      {"--period-ms", "0.4"},    {"--period-ms", "1001"}, {"--silent-ticks", "0"},
      {"--silent-ticks", "101"}, {"--priority", "-1"},    {"--priority", "100"}};
  for (const auto& [option, text] : bad) {
    const End end = of({"--heartbeat-fd", "PAGE", "--pwm", path("pwm"), option, text});
    EXPECT_NE(end.status, 0) << option << " " << text;
    EXPECT_NE(end.said.find(option), std::string::npos) << end.said;
  }
  EXPECT_NE(of({"--pwm", path("pwm")}).said.find("--heartbeat-fd"), std::string::npos);
}

TEST_F(GuardCommand, BoundsThemselvesAreAllowed) {
  for (const auto& [option, text] : {std::pair<std::string, std::string>{"--period-ms", "0.5"},
                                     {"--silent-ticks", "1"},
                                     {"--silent-ticks", "100"},
                                     {"--priority", "0"}}) {
    start({"--heartbeat-fd", "PAGE", "--pwm", path("pwm"), option, text});
    EXPECT_TRUE(polls()) << option << " " << text;
    EXPECT_EQ(finish(SIGTERM).status, 0) << option << " " << text;
  }
}

TEST_F(GuardCommand, ServesNobodyWhoIsNotItsParent) {
  const End end = of({"--heartbeat-fd", "PAGE", "--pwm", path("pwm"), "--parent", "1"});
  EXPECT_EQ(end.status, 0);
  EXPECT_EQ(heartbeat_.page().guard_ns, 0);
}

TEST_F(GuardCommand, LeavesTheBridgesAsleepAndSaysThatItStops) {
  const int manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path("manager").copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(manager, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  setenv("NOTIFY_SOCKET", path("manager").c_str(), 1);
  start({"--heartbeat-fd", "PAGE", "--enable", path("enable"), "--pwm", path("pwm")});
  unsetenv("NOTIFY_SOCKET");
  ASSERT_TRUE(polls(3));
  const End end = finish(SIGTERM);
  EXPECT_EQ(end.status, 0) << end.said;
  EXPECT_EQ(value("enable"), "0");
  EXPECT_EQ(value("pwm"), "0");
  std::vector<std::string> said;
  char text[64];
  for (ssize_t size = 0; (size = recv(manager, text, sizeof text, 0)) > 0;)
    said.emplace_back(text, static_cast<std::size_t>(size));
  close(manager);
  ASSERT_GE(said.size(), 3U);
  EXPECT_EQ(said.front(), "READY=1");
  EXPECT_EQ(said[1], "WATCHDOG=1");
  EXPECT_EQ(said.back(), "STOPPING=1");
}

TEST_F(GuardCommand, ABridgeThatCannotBeSwitchedIsAFailure) {
  start({"--heartbeat-fd", "PAGE", "--pwm", "/dev/full"});
  ASSERT_TRUE(polls());
  const End end = finish(SIGTERM);
  EXPECT_EQ(end.status, 1);
  EXPECT_NE(end.said.find("a bridge could not be switched: No space left on device"), std::string::npos)
      << end.said;
}

TEST_F(GuardCommand, PollsOnceInAPeriodAndNoMoreOften) {
  start({"--heartbeat-fd", "PAGE", "--pwm", path("pwm"), "--period-ms", "100"});
  std::chrono::steady_clock::duration longest{};
  for (int i = 0; i < 3; ++i) {  // of several, for the poll that begins one may be late
    ASSERT_TRUE(polls());
    const auto before = std::chrono::steady_clock::now();
    ASSERT_TRUE(polls(5));
    longest = std::max(longest, std::chrono::steady_clock::now() - before);
  }
  EXPECT_GE(longest, std::chrono::milliseconds(450));
  EXPECT_EQ(finish(SIGTERM).status, 0);
}

TEST_F(GuardCommand, IsAsPatientAsItIsTold) {
  start({"--heartbeat-fd", "PAGE", "--enable", path("enable"), "--pwm", path("pwm"), "--silent-ticks", "80"});
  runtime::HeartbeatPage& page = heartbeat_.page();
  page.want_enable = 1;
  const auto on = [this] { return value("enable") == "1"; };
  for (int i = 0; i < 5000 && !on(); ++i) {
    page.loop_ns = runtime::monotonic_now_ns();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_TRUE(on());
  const std::int64_t last_ns = runtime::monotonic_now_ns();
  page.loop_ns = runtime::monotonic_now_ns();
  for (int i = 0; i < 10000 && page.cut.load() == 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_GE(page.cut_ns.load() - last_ns, 80 * 5'000'000) << "80 ticks of 5 ms";
  EXPECT_EQ(finish(SIGTERM).status, 0);
}

}  // namespace
}  // namespace equipoise
