// A test's folder with the path of a log in it; gone afterwards.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <string>

namespace equipoise {

class LogFolder : public testing::Test {
 protected:
  LogFolder() {
    char name[] = "/tmp/equipoise-log-XXXXXX";
    folder_ = mkdtemp(name);
    path_ = (folder_ / "run.lcm").string();
  }
  /// What a file of a log begins with; a log's later parts begin with a later event.
  static std::string log_head(unsigned char first_event) {
    return std::string("\xED\xA1\xDA\x01\0\0\0\0\0\0\0", 11) + static_cast<char>(first_event);
  }
  ~LogFolder() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
  std::string path_;
};

}  // namespace equipoise
