// Bridges that the guard switches by value files alone.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "app/guard/guard.hpp"

namespace equipoise {
namespace {

TEST(FileBridges, WritesOneNumberToEach) {
  const std::filesystem::path dir =
      std::filesystem::temp_directory_path() / ("bridges-" + std::to_string(getpid()));
  std::filesystem::create_directories(dir);
  const auto value = [&](const char* name) {
    std::string text;
    std::ifstream(dir / name) >> text;
    return text;
  };
  for (const char* name : {"enable", "pwm0", "pwm1"}) std::ofstream(dir / name) << "7\n";
  {
    app::FileBridges bridges(dir / "enable", {dir / "pwm0", dir / "pwm1"});
    EXPECT_EQ(bridges.enable(), 0);
    EXPECT_EQ(value("enable"), "1");
    EXPECT_EQ(value("pwm0"), "7");
    EXPECT_EQ(bridges.off(), 0);
    EXPECT_EQ(value("enable"), "0");
    EXPECT_EQ(value("pwm0"), "0");
    EXPECT_EQ(value("pwm1"), "0");
    EXPECT_EQ(bridges.enable(), 0);
  }
  EXPECT_EQ(value("enable"), "0");  // the end of it

  std::ofstream(dir / "pwm1") << "7\n";
  app::FileBridges failing("", {"/dev/full", dir / "pwm1"});
  EXPECT_EQ(failing.enable(), 0);  // nothing to wake
  EXPECT_EQ(failing.off(), -ENOSPC);
  EXPECT_EQ(value("pwm1"), "0");  // although the first failed
  app::FileBridges no_enable("/dev/full", {dir / "pwm1"});
  EXPECT_EQ(no_enable.enable(), -ENOSPC);
  EXPECT_EQ(no_enable.off(), -ENOSPC);
  EXPECT_THROW(app::FileBridges("", {dir / "none"}), std::runtime_error);
  std::filesystem::remove_all(dir);
}

TEST(FileBridges, CloseWhatTheyHaveOpenedAlsoDescriptorZero) {
  const std::string path =
      std::filesystem::temp_directory_path() / ("bridge-zero-" + std::to_string(getpid()));
  std::ofstream(path) << "7\n";
  const int kept = dup(STDIN_FILENO);
  close(STDIN_FILENO);
  {
    app::FileBridges bridges(path, {path});
    EXPECT_EQ(fcntl(STDIN_FILENO, F_GETFD) & FD_CLOEXEC, FD_CLOEXEC) << "the first that is free";
    EXPECT_EQ(bridges.enable(), 0);
    std::string text;
    std::ifstream(path) >> text;
    EXPECT_EQ(text, "1");
  }
  EXPECT_EQ(fcntl(STDIN_FILENO, F_GETFD), -1);
  const int next = dup(kept);
  EXPECT_EQ(next, STDIN_FILENO);
  const int after = dup(kept);
  close(kept);
  EXPECT_EQ(dup(next), kept) << "nothing else was left open";
  close(kept);
  close(after);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace equipoise
