// The doctor's look at a robot's devices, on umockdev's bus: which chip answers, and how it fails.
#include "app/doctor/doctor.hpp"

#include <cerrno>

#include "fake_iio.hpp"
#include "testbed.hpp"

namespace equipoise::app::doctor {
namespace {

class DoctorTest : public Testbed {
 protected:
  void SetUp() override {
    addBoard();
    board_ = load_board(std::string(EQUIPOISE_SOURCE_DIR) + "/config/boards/robotics_cape_mbbr.toml");
    patient_.board = &board_;
  }

  Finding look(const std::string& name) {
    Findings findings;
    examine_buses(patient_, &findings);
    for (const Finding& finding : findings) {
      if (finding.name == name) return finding;
    }
    return {name, Verdict::kSkipped, "not looked at", ""};
  }

  Board board_;
  Patient patient_;
};

TEST_F(DoctorTest, KnowsTheChipThatAnswers) {
  EXPECT_EQ(look("imu.chip").verdict, Verdict::kOk);
  EXPECT_NE(look("imu.chip").what.find("is an MPU-9250 (0x71)"), std::string::npos);
  imu.setWhoAmI(0x73);
  EXPECT_EQ(look("imu.chip").verdict, Verdict::kWarn);
  EXPECT_NE(look("imu.chip").what.find("MPU-9255"), std::string::npos);
  imu.setWhoAmI(0x68);
  EXPECT_EQ(look("imu.chip").verdict, Verdict::kFail);
  EXPECT_NE(look("imu.chip").what.find("answers as 0x68"), std::string::npos);
}

TEST_F(DoctorTest, TellsASilentChipFromABusyOneAndFromABusOfAnotherKind) {
  imu.failNext(EREMOTEIO);
  Finding silent = look("imu.chip");
  EXPECT_EQ(silent.verdict, Verdict::kFail);
  EXPECT_NE(silent.what.find("nothing answers"), std::string::npos);
  EXPECT_EQ(silent.fix, "i2cdetect -y -r 2");
  imu.failNext(EBUSY);
  EXPECT_NE(look("imu.chip").what.find("held by a kernel driver"), std::string::npos);
  plain_i2c = false;
  EXPECT_EQ(look("imu.bus").verdict, Verdict::kFail);
  EXPECT_EQ(look("imu.chip").what, "not looked at");
}

TEST_F(DoctorTest, LooksWithoutChangingTheChip) {
  look("imu.chip");
  EXPECT_TRUE(imu.writes().empty());
}

TEST_F(DoctorTest, FindsEveryDeviceOfTheBoard) {
  Findings findings;
  examine_buses(patient_, &findings);
  for (const Finding& finding : findings) {
    EXPECT_NE(finding.verdict, Verdict::kFail) << finding.name << ": " << finding.what;
  }
}

TEST_F(DoctorTest, RefusesADmpImageOfTheWrongSize) {
  const std::string path = writeFile("dmp.bin", "too short");
  path.copy(board_.wiring.imu.dmp_firmware, sizeof board_.wiring.imu.dmp_firmware - 1);
  const Finding finding = look("imu.dmp");
  EXPECT_EQ(finding.verdict, Verdict::kFail);
  EXPECT_NE(finding.what.find("9 bytes, not 3062"), std::string::npos);
}

TEST_F(DoctorTest, LooksForTheKernelsDeviceWhenTheBoardNamesOne) {
  board_.wiring.imu.driver = BBB_IMU_IIO;
  EXPECT_EQ(look("imu.gyro").verdict, Verdict::kFail);
  EXPECT_NE(look("imu.gyro").what.find("no IIO device mpu9250"), std::string::npos);
  EXPECT_EQ(look("imu.chip").what, "not looked at");
  auto attributes = iio_attributes("mpu9250", {"in_accel", "in_anglvel"}, "be:s16/16>>0");
  attributes["trigger/current_trigger"] = "";
  const std::string dir = addDevice("iio", "2-0068/iio:device4", attributes);
  const FakeIio node(hostPath("/dev/iio:device4"));
  EXPECT_NE(look("imu.gyro").what.find("current_trigger is empty"), std::string::npos);
  EXPECT_NE(look("imu.gyro").fix.find("[imu] trigger"), std::string::npos);
  setAttribute(dir, "trigger/current_trigger", "mpu9250-dev4");
  EXPECT_EQ(look("imu.gyro").verdict, Verdict::kOk);
  removeAttribute(dir, "buffer");
  EXPECT_NE(look("imu.accel").what.find("the driver has no interrupt"), std::string::npos);
}

}  // namespace
}  // namespace equipoise::app::doctor
