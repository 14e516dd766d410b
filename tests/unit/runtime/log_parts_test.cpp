// Names of a log's files, and which of a folder's files are whose.
#include "equipoise/runtime/log_parts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "support/log_folder.hpp"

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

class LogParts : public LogFolder {
 protected:
  std::string file(const std::string& name) const { return holding(name, "x"); }
  std::string part(const std::string& name) const { return holding(name, log_head(9)); }
  std::string holding(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
};

TEST_F(LogParts, HaveFourDigitsBeforeTheSuffixOrMore) {
  EXPECT_EQ(log_part("a/run.lcm", 0), "a/run.lcm");
  EXPECT_EQ(log_part("a/run.lcm", 1), "a/run.0001.lcm");
  EXPECT_EQ(log_part("run.lcm", 12345), "run.12345.lcm");
  EXPECT_EQ(log_part("a.b/run.old.lcm", 2), "a.b/run.old.0002.lcm");
  for (const int number : {0, 1, 9999, 12345}) {
    for (const std::string path : {"run.lcm", "a/run.lcm", "run.log.x"})
      EXPECT_EQ(log_part_number(path, log_part(path, number)), number) << path;
  }
}

TEST_F(LogParts, AreReadInTheOrderOfTheirNumbers) {
  EXPECT_THAT(existing_log_parts(path_), IsEmpty());
  const std::string ten_thousandth = part("run.10000.lcm");
  const std::string second = part("run.0002.lcm");
  const std::string largest = part("run.123456789.lcm");
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(second, ten_thousandth, largest));
  file("run.lcm");
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(path_, second, ten_thousandth, largest));
}

TEST_F(LogParts, OtherFilesAreNone) {
  for (const char* name : {"run.001.lcm", "run.00001.lcm", "run.1234567890.lcm", "run.00x1.lcm",
                           "run.0001.txt", "runs.0001.lcm", "run.0001.lcm.old", "run..lcm", "run.000/.lcm"})
    if (std::string(name).find('/') == std::string::npos) part(name);
  EXPECT_THAT(existing_log_parts(path_), IsEmpty());
  EXPECT_THAT(kept_logs(path_), IsEmpty());
  EXPECT_THAT(existing_log_parts((folder_ / "none" / "run.lcm").string()), IsEmpty());
}

TEST_F(LogParts, AFileOfANumberedNameThatDoesNotGoOnWithTheLogIsNone) {
  file("run.2024.lcm");
  holding("run.20261122.lcm", log_head(0));  // a log of its own
  holding("run.0001.lcm", "");
  fs::create_directory(folder_ / "run.0002.lcm");
  EXPECT_THAT(existing_log_parts(path_), IsEmpty());
  file("run.lcm");
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(path_));
}

TEST_F(LogParts, ANameThatEndsInDigitsIsNoPartOfItself) {
  const std::string numbered = file("run.2026");
  EXPECT_THAT(existing_log_parts(numbered), ElementsAre(numbered));
  const std::string further = part("run.0001.2026");
  EXPECT_THAT(existing_log_parts(numbered), ElementsAre(numbered, further));
}

TEST_F(LogParts, LogsMovedAsideAreListedOldestFirst) {
  const std::string later = file("run.20261122T014503Z.lcm");
  const std::string part = file("run.20261122T014503Z.0001.lcm");
  const std::string earlier = file("run.20251122T014503Z.lcm");
  const std::string second = file("run.20261122T014503Z-2.lcm");
  for (const char* name :
       {"run.20261122 014503Z.lcm", "run.20261122T014503.lcm", "run.2026112T0145030Z.lcm",
        "run.20261122T014503Z-keep-best.lcm", "run.20261122T014503Z.1.lcm", "run.20261122T01450xZ.lcm",
        "run.20261122T014503X.lcm", "run.2026112xT014503Z.lcm"})
    file(name);
  EXPECT_THAT(kept_logs(path_), testing::UnorderedElementsAre(earlier, later, part, second));
  EXPECT_EQ(kept_logs(path_).front(), earlier);
}

TEST_F(LogParts, ALogThatIsMovedAsideIsNamedAfterItsEnd) {
  constexpr std::int64_t kTime_s = 1795311903;  // 2026-11-22 01:45:03 UTC
  const std::string name = kept_name(path_, kTime_s);
  EXPECT_EQ(name, (folder_ / "run.20261122T014503Z.lcm").string());
  file("run.20261122T014503Z.lcm");
  EXPECT_EQ(kept_name(path_, kTime_s), (folder_ / "run.20261122T014503Z-2.lcm").string());
  file("run.20261122T014503Z-2.0001.lcm");
  EXPECT_EQ(kept_name(path_, kTime_s), (folder_ / "run.20261122T014503Z-3.lcm").string());
}

}  // namespace
}  // namespace equipoise::runtime
