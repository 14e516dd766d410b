#include "equipoise/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "robots/mbbr/firmware.hpp"

namespace equipoise {
namespace {

using ::testing::HasSubstr;

const std::string kMbbr = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";

std::string error_of(const std::string& path, const std::vector<std::string>& overrides = {}) {
  try {
    load_mbbr(path, overrides);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

/// The shipped file with one text replaced.
class EditedConfig {
 public:
  EditedConfig(const std::string& from, const std::string& to) {
    std::ifstream in(kMbbr);
    std::stringstream text;
    text << in.rdbuf();
    std::string edited = text.str();
    const std::size_t at = edited.find(from);
    EXPECT_NE(at, std::string::npos);
    edited.replace(at, from.size(), to);
    path_ = testing::TempDir() + "edited_" + std::to_string(::getpid()) + "_" + std::to_string(instances_++) +
            ".toml";
    std::ofstream(path_) << edited;
    line_ = 1 + std::count(edited.begin(), edited.begin() + static_cast<std::ptrdiff_t>(at), '\n');
  }
  ~EditedConfig() { std::filesystem::remove(path_); }
  const std::string& path() const { return path_; }
  std::string where() const { return path_ + ":" + std::to_string(line_) + ":"; }

 private:
  std::string path_;
  std::ptrdiff_t line_ = 0;
  static inline int instances_ = 0;
};

TEST(Calibration, ASignIsOneOrMinusOne) {
  for (const char* key : {"encoder_sign", "motor_sign"}) {
    for (const char* bad : {"0", "0.5", "-0.999"}) {
      const std::string setting = std::string("calibration.") + key + "=[1, " + bad + ", 1]";
      EXPECT_THAT(error_of(kMbbr, {setting}), HasSubstr("allowed: 1 or -1")) << setting;
    }
    EXPECT_EQ(error_of(kMbbr, {std::string("calibration.") + key + "=[1, -1, 1]"}), "");
  }
}

TEST(Config, TheShippedFileLoads) {
  const Loaded<MbbrConfig> loaded = load_mbbr(kMbbr, {});
  EXPECT_EQ(loaded.config.robot.m_t, 0.550);
  EXPECT_EQ(loaded.sha256.size(), 64U);
  EXPECT_EQ(loaded.sha256, load_mbbr(kMbbr, {}).sha256);
}

TEST(Config, UnknownKeyNamesFileLineAndTheKeyThatWasMeant) {
  const EditedConfig file("ball_radius_m", "ball_radus_m");
  EXPECT_THAT(error_of(file.path()), HasSubstr("robot.ball_radius_m: missing"));
  const EditedConfig extra("max_tilt_rad = 0.6", "max_tilt_rad = 0.6\nmax_tild_rad = 0.6");
  EXPECT_THAT(error_of(extra.path()),
              HasSubstr("safety.max_tild_rad: unknown key; did you mean max_tilt_rad?"));
}

TEST(Config, OutOfRangeNamesLineAndAllowedRange) {
  const EditedConfig file("max_tilt_rad = 0.6", "max_tilt_rad = 6.0");
  EXPECT_THAT(error_of(file.path()),
              HasSubstr(file.where() + " safety.max_tilt_rad: 6 is out of range; allowed: 0.05 to 1.5"));
}

TEST(Config, WrongTypesAndNanAreRefused) {
  const EditedConfig text("max_tilt_rad = 0.6", "max_tilt_rad = \"steep\"");
  EXPECT_THAT(error_of(text.path()), HasSubstr("expected a number"));
  const EditedConfig nan("max_tilt_rad = 0.6", "max_tilt_rad = nan");
  EXPECT_THAT(error_of(nan.path()), HasSubstr("out of range"));
  const EditedConfig syntax("max_tilt_rad = 0.6", "max_tilt_rad = = 0.6");
  EXPECT_THAT(error_of(syntax.path()), HasSubstr(syntax.where()));
}

TEST(Config, OverridesApplyAndAreChecked) {
  EXPECT_EQ(load_mbbr(kMbbr, {"friction.compensation=0.8"}).config.friction.gain, 0.8);
  EXPECT_NE(load_mbbr(kMbbr, {"friction.compensation=0.8"}).sha256, load_mbbr(kMbbr, {}).sha256);
  EXPECT_EQ(load_mbbr(kMbbr, {"reference.filter_frame=yaw"}).config.reference.frame, FilterFrame::kYaw);
  EXPECT_THAT(error_of(kMbbr, {"friction.compensatio=0.8"}), HasSubstr("no such key"));
  EXPECT_THAT(error_of(kMbbr, {"friction.compensation=9"}), HasSubstr("allowed: 0 to 1.5"));
  EXPECT_THAT(error_of(kMbbr, {"friction"}), HasSubstr("expected key=value"));
}

TEST(Config, AnOverrideOfATableSetsItsKeysAndNoOthers) {
  const MbbrConfig config = load_mbbr(kMbbr, {"safety={max_tilt_rad=0.5, max_stall_s = 2.0}"}).config;
  EXPECT_EQ(config.safety.max_tilt_rad, 0.5);
  EXPECT_EQ(config.safety.max_stall_s, 2.0);
  EXPECT_EQ(config.safety.max_motor_error, load_mbbr(kMbbr, {}).config.safety.max_motor_error);
  EXPECT_THAT(error_of(kMbbr, {"safety={}"}), HasSubstr("--set safety={}: sets nothing"));
  EXPECT_THAT(error_of(kMbbr, {"safety=3"}), HasSubstr("is a table; set one of its keys"));
  EXPECT_THAT(error_of(kMbbr, {"safety={max_tilt=0.5}"}), HasSubstr("no such key"));
}

TEST(Config, AnOverrideReachesAnElementOfAnArray) {
  const auto before = load_mbbr(kMbbr, {}).config;
  const auto after = load_mbbr(kMbbr, {"controller.thesis.gains[2].c1=9.25"}).config;
  ASSERT_GT(after.thesis.schedule.rows, 3U);
  EXPECT_EQ(after.thesis.schedule.row[2][0], 9.25);
  EXPECT_EQ(after.thesis.schedule.row[2][1], before.thesis.schedule.row[2][1]);
  EXPECT_EQ(after.thesis.schedule.row[1][0], before.thesis.schedule.row[1][0]);
  EXPECT_EQ(load_mbbr(kMbbr, {"calibration.gyro_bias_rad_s[1]=0.25"}).config.calibration.gyro_bias_B_rad_s,
            Vec3(0.0, 0.25, 0.0));
  EXPECT_THAT(error_of(kMbbr, {"calibration.gyro_bias_rad_s[3]=0.25"}),
              HasSubstr("gyro_bias_rad_s has 3 elements, from [0] to [2]"));
  EXPECT_THAT(error_of(kMbbr, {"controller.thesis.gains[0].c9=1.0"}), HasSubstr("no such key"));
  EXPECT_THAT(error_of(kMbbr, {"friction.compensation[0]=1.0"}), HasSubstr("compensation is no array"));
  for (const char* index : {"[", "[]", "[-1]", "[1", "[1]2", "[1][0]", "[99999999999999999999]", "[0x1]"}) {
    EXPECT_THAT(error_of(kMbbr, {"calibration.gyro_bias_rad_s" + std::string(index) + "=0.1"}),
                HasSubstr("--set calibration.gyro_bias_rad_s["))
        << index;
  }
}

TEST(Config, WhatNoOverrideCanBeIsRefusedInOneShortLine) {
  std::string deep = "a";
  while (deep.size() < 100000) deep += ".a";
  const std::vector<std::string> texts{deep + "=1",
                                       "motor=" + deep,
                                       "motor={" + deep + "=1}",
                                       "=1",
                                       ".=1",
                                       "..=1",
                                       "motor.=1",
                                       "friction.compensation=0.8\nmotor=1",
                                       std::string("a\0b=1", 6)};
  for (const std::string& text : texts) {
    const std::string error = error_of(kMbbr, {text});
    EXPECT_FALSE(error.empty()) << text.substr(0, 40);
    EXPECT_LT(error.size(), 400U);
  }
}

TEST(Config, ATextAtWhoseZeroCharacterANameWouldEndIsRefusedWithItsLine) {
  for (const char* line : {R"(include = ["motor\u0000.toml"])", R"(base = "mbbr.toml\u0000.old")",
                           R"("a\u0000b" = 1)", R"(a = [{b = "\U00000000"}])"}) {
    const EditedConfig edited("[robot]", std::string(line) + "\n[robot]");
    EXPECT_EQ(error_of(edited.path()), edited.where() + " a text holds a zero character");
  }
}

TEST(Config, AFileThatIsNestedTooDeepIsRefusedWithItsLine) {
  std::string deep = "a";
  while (deep.size() < 100000) deep += ".a";
  const EditedConfig key("[robot]", deep + "=1\n[robot]");
  EXPECT_EQ(error_of(key.path()), key.where() + " more than 100 dots in a line");
  const EditedConfig table("[robot]", "[" + deep + "]\n[robot]");
  EXPECT_EQ(error_of(table.path()), table.where() + " more than 100 dots in a line");
  // Where a string ends is for the parser to say: an escaped quote must not hide the dots.
  const EditedConfig quoted("[robot]", "a = \"\\\"\"" + deep + "\n[robot]");
  EXPECT_EQ(error_of(quoted.path()), quoted.where() + " more than 100 dots in a line");
}

TEST(Config, APipeOrAFolderIsRefusedAtOnce) {
  const std::string pipe = testing::TempDir() + "pipe_" + std::to_string(::getpid());
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(error_of(pipe), pipe + ": is no regular file");
  EXPECT_THAT(error_of(kMbbr, {"include=[\"" + pipe + "\"]"}), HasSubstr(pipe + ": is no regular file"));
  std::filesystem::remove(pipe);
  EXPECT_THAT(error_of(testing::TempDir()), HasSubstr("is no regular file"));
}

TEST(Config, FragmentsReplaceValuesAndOverridesHaveTheLastWord) {
  const std::string fragment = testing::TempDir() + "fragment_" + std::to_string(::getpid()) + ".toml";
  std::ofstream(fragment) << "[motor]\nresistance_ohm = 4.5\ninductance_H = 1e-3\n";
  const std::string include = "include=[\"" + fragment + "\"]";
  const Loaded<MbbrConfig> loaded = load_mbbr(kMbbr, {"motor.inductance_H=2e-3", include});
  EXPECT_EQ(loaded.config.motor.resistance_ohm, 4.5);
  EXPECT_EQ(loaded.config.motor.inductance_H, 2e-3);
  std::ofstream(fragment) << "[motor]\nresistence_ohm = 4.5\n";
  EXPECT_THAT(error_of(kMbbr, {include}), HasSubstr(fragment + ":2: motor.resistence_ohm: no such key"));
  std::ofstream(fragment) << "[motor]\n\nresistance_ohm = -1.0\n";
  EXPECT_THAT(error_of(kMbbr, {include}), HasSubstr(fragment + ":3: motor.resistance_ohm: -1 is out of"));
  std::filesystem::remove(fragment);
  EXPECT_THAT(error_of(kMbbr, {include}), HasSubstr("cannot be opened"));
  EXPECT_THAT(error_of(kMbbr, {"include=3"}), HasSubstr("expected an array of file names"));
}

TEST(Config, AFileWithABaseSaysOnlyWhatDiffers) {
  const std::string path = ::testing::TempDir() + "based.toml";
  const auto based = [&](const std::string& base, const std::string& rest) {
    std::ofstream(path) << "base = \"" << base << "\"\n" << rest;
    return path;
  };
  const Loaded<MbbrConfig> loaded = load_mbbr(based(kMbbr, "[motor]\nresistance_ohm = 5.0\n"), {});
  EXPECT_EQ(loaded.config.motor.resistance_ohm, 5.0);
  EXPECT_EQ(loaded.config.motor.nominal_V, load_mbbr(kMbbr, {}).config.motor.nominal_V);
  EXPECT_EQ(loaded.toml.find("base"), std::string::npos);  // the effective configuration stands alone
  EXPECT_THAT(error_of(based(kMbbr, "[motor]\nresistence_ohm = 5.0\n")),
              HasSubstr(path + ":3: motor.resistence_ohm: no such key"));
  EXPECT_THAT(error_of(based(kMbbr, "[motor]\nresistance_ohm = -1\n")),
              HasSubstr(path + ":3: motor.resistance_ohm: -1 is out of"));
  EXPECT_THAT(error_of(based("gone.toml", "")), HasSubstr("it is the base of " + path));
  EXPECT_THAT(error_of(based("based.toml", "")), HasSubstr("more than 8"));
}

TEST(Config, AMountThatIsNoRotationIsRefused) {
  EXPECT_THAT(error_of(kMbbr, {"calibration.R_BS=[1,0,0,0,1,0,0,0,-1]"}), HasSubstr("not a rotation matrix"));
}

TEST(Config, MissingFileSaysWhatToDo) { EXPECT_THAT(error_of("nowhere.toml"), HasSubstr("--config FILE")); }

TEST(Config, NothingIsDoubtedInSimulationOnly) {
  const MbbrConfig config = load_mbbr(kMbbr, {"safety.detection=false"}).config;
  Choice choice{"ekf", "scheduled", "full"};
  EXPECT_FALSE(MbbrFirmware::apply(config, choice).estimators.detection);
  EXPECT_TRUE(std::isinf(MbbrFirmware::apply(config, choice).safety.max_motor_error));
  EXPECT_TRUE(std::isfinite(MbbrFirmware::apply(config, choice).safety.max_fall_rad));
  choice.fidelity.clear();  // on hardware
  choice.backend = "board";
  EXPECT_THROW(MbbrFirmware::apply(config, choice), ConfigError);
}

}  // namespace
}  // namespace equipoise
