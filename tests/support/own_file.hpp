// A file of this process alone, for tests run side by side; gone at its end.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

namespace equipoise {

inline std::string own_file(const std::string& name, const std::string& content) {
  struct Files {
    std::vector<std::string> paths;
    ~Files() {
      for (const std::string& path : paths) std::remove(path.c_str());
    }
  };
  static Files files;
  files.paths.push_back(::testing::TempDir() + std::to_string(::getpid()) + "_" + name);
  std::ofstream(files.paths.back(), std::ios::binary) << content;
  return files.paths.back();
}

}  // namespace equipoise
