// Every fault in every phase of flight through the boundary, and a short soak: nothing unsafe.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

namespace {

class Campaign : public ::testing::TestWithParam<const char*> {};

TEST_P(Campaign, NoFaultInAnyPhaseIsUnsafe) {
  const std::string config = std::string(EQUIPOISE_SOURCE_DIR) + "/config/" + GetParam() + ".toml";
  const std::string json = ::testing::TempDir() + "campaign-" + GetParam() + ".json";
  const std::string command = std::string(EQUIPOISE_BINARY) + " campaign --config " + config +
                              " --soak-hours 0.05 --json " + json + " > " + json + ".txt";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream file(json);
  const nlohmann::json result = nlohmann::json::parse(file);
  EXPECT_GE(result["case_count"].get<int>(), 60);
  EXPECT_EQ(result["unsafe"].get<int>(), 0);
  EXPECT_EQ(result["soak"]["unsafe"].get<int>(), 0);
  EXPECT_EQ(result["soak"]["unexplained"].get<int>(), 0);
  std::set<std::string> kinds;
  int disarmed = 0;
  for (const nlohmann::json& each : result["cases"]) {
    EXPECT_FALSE(each["unsafe"].get<bool>()) << each.dump();
    kinds.insert(each["fault"].get<std::string>());
    disarmed += each["disarmed"].get<bool>() ? 1 : 0;
  }
  EXPECT_GE(kinds.size(), 20U);
  EXPECT_GE(disarmed, 30);  // the faults do reach the firmware
  std::filesystem::remove(json);
  std::filesystem::remove(json + ".txt");
}

INSTANTIATE_TEST_SUITE_P(Robots, Campaign, ::testing::Values("mbbr", "edumip"));

}  // namespace
