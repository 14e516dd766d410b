// Gyro bias, six-face fit and mount rotation on made-up samples with known answers.
#include "app/commission/calibrate_imu.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace equipoise::app {
namespace {

using ::testing::HasSubstr;

template <class F>
std::string complaint(F&& f) {
  try {
    f();
  } catch (const JobError& error) {
    return error.what();
  }
  return "accepted";
}

Stillness at_rest(const Vec3& gyro_counts) {
  Stillness still;
  still.gyro = gyro_counts;
  still.gyro_sigma = Vec3::Constant(1.4);
  return still;
}

TEST(GyroBias, IsTheMeanInSensorAxes) {
  const GyroBias bias = gyro_bias(at_rest({16.4, -32.8, 0.0}), Calibration{});
  EXPECT_NEAR(bias.bias_S_rad_s.x(), kPi / 180.0, 1e-12);  // 16.4 counts are 1 deg/s
  EXPECT_NEAR(bias.bias_S_rad_s.y(), -2.0 * kPi / 180.0, 1e-12);
}

TEST(GyroBias, ItsNoiseIsInTheSameUnit) {
  EXPECT_NEAR(gyro_bias(at_rest(Vec3::Zero()), Calibration{}).sigma_S_rad_s.z(), 1.4 / 16.4 * kPi / 180.0,
              1e-12);
}

TEST(GyroBias, OneCountOfAWheelIsRest) {
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    Stillness still = at_rest(Vec3::Zero());
    still.encoder_travel[i] = 1.0;
    EXPECT_EQ(complaint([&] { gyro_bias(still, Calibration{}); }), "accepted");
    still.encoder_travel[i] = 1.1;
    EXPECT_THAT(complaint([&] { gyro_bias(still, Calibration{}); }),
                HasSubstr("wheel " + std::to_string(i + 1) + " turned by 1 counts"));
  }
}

TEST(GyroBias, RefusesMotionAndSaysHowMuch) {
  Stillness shaken = at_rest(Vec3::Zero());
  shaken.gyro_sigma.y() = 3.0 * 16.4;
  EXPECT_THAT(complaint([&] { gyro_bias(shaken, Calibration{}); }),
              HasSubstr("3.00 deg/s of shaking (allowed 0.40), 0.00 deg/s of change (allowed 0.10)"));
  Stillness speeding = at_rest(Vec3::Zero());
  speeding.gyro_drift.z() = -0.5 * 16.4;
  EXPECT_THAT(complaint([&] { gyro_bias(speeding, Calibration{}); }), HasSubstr("0.50 deg/s of change"));
  EXPECT_THAT(complaint([&] {
                gyro_bias(at_rest({0.0, 40.0 * 16.4, 0.0}), Calibration{});
              }),
              HasSubstr("40.0 deg/s at rest is no bias"));
  Stillness rolling = at_rest(Vec3::Zero());
  rolling.encoder_travel[1] = 12.0;
  EXPECT_THAT(complaint([&] { gyro_bias(rolling, Calibration{}); }),
              HasSubstr("wheel 2 turned by 12 counts"));
}

/// 0.4 deg/s of shaking and 0.1 of change are a chip's noise, 25 deg/s its bias; beyond, the robot moved.
TEST(GyroBias, TakesWhatAChipDoesAtRest) {
  const auto told = [](double sigma, double drift, double bias) {
    Stillness still = at_rest({0.0, 0.0, bias * 16.4});
    still.gyro_sigma.setConstant(sigma * 16.4);
    still.gyro_drift.setConstant(drift * 16.4);
    return complaint([&] { gyro_bias(still, Calibration{}); });
  };
  EXPECT_EQ(told(0.39, 0.09, 24.9), "accepted");
  EXPECT_THAT(told(0.41, 0.09, 24.9), HasSubstr("of shaking"));
  EXPECT_THAT(told(0.39, 0.11, 24.9), HasSubstr("of change"));
  EXPECT_THAT(told(0.39, 0.09, 25.1), HasSubstr("is no bias"));
}

// A chip that reads (force + bias) / scale per axis.
const Vec3 kScale(0.97, 1.02, 1.05);
const Vec3 kBias(0.3, -0.2, 0.5);

Vec3 reads(const Vec3& up) { return (kGravity_m_s2 * up.normalized() + kBias).cwiseQuotient(kScale); }

std::vector<Vec3> six_faces() {
  // Held by hand: some degrees off the axes.
  return {reads({1, 0.1, 0}),  reads({-1, 0, 0.1}), reads({0.1, 1, 0}),
          reads({0, -1, 0.1}), reads({0, 0.1, 1}),  reads({0.1, 0, -1})};
}

TEST(SixFaces, FindsScaleAndBiasOfACrookedlyHeldChip) {
  const AccelFit fit = fit_six_faces(six_faces(), reads({1, 1, 1}));
  EXPECT_LT((fit.scale_S - kScale).norm(), 1e-9);
  EXPECT_LT((fit.bias_S_m_s2 - kBias).norm(), 1e-8);
  EXPECT_LT(fit.check_error_m_s2, 1e-8);
}

TEST(SixFaces, ScoresAPoseThatItDidNotFit) {
  const AccelFit fit = fit_six_faces(six_faces(), reads({1, 1, 1}) * 1.01);
  EXPECT_NEAR(fit.check_error_m_s2, 0.01 * kGravity_m_s2, 0.01);
}

TEST(SixFaces, RefusesMissingFacesByName) {
  std::vector<Vec3> faces = six_faces();
  faces[1] = faces[0];
  faces.pop_back();
  EXPECT_THAT(complaint([&] { fit_six_faces(faces, faces[0]); }), HasSubstr("never up: -x, -z;"));
  EXPECT_THAT(complaint([&] { fit_six_faces({}, faces[0]); }),
              HasSubstr("never up: +x, +y, +z, -x, -y, -z;"));
}

TEST(SixFaces, RefusesWhatNoChipDoes) {
  std::vector<Vec3> faces = six_faces();
  faces[0] *= 1.4;
  EXPECT_THAT(complaint([&] { fit_six_faces(faces, faces[1]); }), HasSubstr("implausible fit"));
}

TEST(SixFaces, TakesWhatAChipHas) {
  const auto told = [](double scale, double bias) {
    std::vector<Vec3> faces;
    for (const Vec3& up : {Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1),
                           Vec3(0, 0, -1), Vec3(1, 0.1, 0.2)})
      faces.emplace_back((kGravity_m_s2 * up.normalized() + bias * Vec3::UnitY()) / scale);
    return complaint([&] { fit_six_faces(faces, faces[0]); });
  };
  EXPECT_EQ(told(1.09, 1.9), "accepted");
  EXPECT_EQ(told(0.91, -1.9), "accepted");
  EXPECT_THAT(told(1.11, 0.0), HasSubstr("scale off by 11 %"));
  EXPECT_THAT(told(0.89, 0.0), HasSubstr("scale off by 11 %"));
  EXPECT_THAT(told(1.0, -2.1), HasSubstr("bias 2.10 m/s2"));
}

TEST(FaceUp, NeedsAnAxisWithin25Degrees) {
  EXPECT_EQ(face_up({0, 0, 9.8}), 2);
  EXPECT_EQ(face_up({0, -9.8, 3.0}), 4);
  EXPECT_EQ(face_up({7, 0, 7}), -1);
  const auto tipped = [](double deg) {
    return face_up({-std::cos(deg * kPi / 180.0), 0.0, std::sin(deg * kPi / 180.0)});
  };
  EXPECT_EQ(tipped(24.9), 3);
  EXPECT_EQ(tipped(25.1), -1);
}

TEST(MountRotation, ComesFromGravityAtTwoPoses) {
  const Mat3 R_BS =
      (Eigen::AngleAxisd(0.4, Vec3::UnitX()) * Eigen::AngleAxisd(-1.9, Vec3(1, 2, 3).normalized()))
          .toRotationMatrix();
  for (const Vec3& axis : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY())}) {
    const Mat3 tipped = Eigen::AngleAxisd(0.6, axis).toRotationMatrix();  // body to world
    const Vec3 up_B = kGravity_m_s2 * Vec3::UnitZ();
    const Vec3 tipped_B = tipped.transpose() * up_B;
    const Mat3 found = mount_rotation(R_BS.transpose() * up_B, R_BS.transpose() * tipped_B, axis);
    EXPECT_LT((found - R_BS).norm(), 1e-12) << "tipped about " << axis.transpose();
  }
}

TEST(MountRotation, RefusesTooLittleTiltAndNoGravity) {
  const Vec3 up(0, 0, kGravity_m_s2);
  EXPECT_THAT(complaint([&] { mount_rotation(up, {0.9, 0, 9.75}, Vec3::UnitY()); }), HasSubstr("5 degrees"));
  EXPECT_THAT(complaint([&] { mount_rotation(1.5 * up, up, Vec3::UnitY()); }), HasSubstr("14.7 m/s2"));
  for (int i = 0; i < 20; ++i) {  // a unit vector times itself is 1 up to rounding, either way
    const Vec3 any = kGravity_m_s2 * Vec3(1.0, 2.0 + 0.1 * i, 3.0).normalized();
    EXPECT_THAT(complaint([&] { mount_rotation(any, any, Vec3::UnitY()); }),
                HasSubstr("tipped by 0 degrees"));
    EXPECT_THAT(complaint([&] { mount_rotation(any, -any, Vec3::UnitY()); }),
                HasSubstr("tipped by 180 degrees"));
  }
}

TEST(MountRotation, TakesTiltsOf15To120DegreesAndGravityWithinATenth) {
  const auto told = [](double deg, double size) {
    const double a = deg * kPi / 180.0;
    const Vec3 up(0, 0, size * kGravity_m_s2);
    return complaint(
        [&] { mount_rotation(up, Vec3(0, std::sin(a), std::cos(a)) * kGravity_m_s2, Vec3::UnitX()); });
  };
  for (const double deg : {15.1, 119.9}) EXPECT_EQ(told(deg, 1.0), "accepted") << deg;
  EXPECT_THAT(told(14.9, 1.0), HasSubstr("tipped by 15 degrees where 15 to 120"));
  EXPECT_THAT(told(120.4, 1.0), HasSubstr("tipped by 120 degrees"));
  for (const double size : {0.91, 1.09}) EXPECT_EQ(told(60.0, size), "accepted") << size;
  for (const double size : {0.89, 1.11}) EXPECT_THAT(told(60.0, size), HasSubstr("is not gravity")) << size;
}

}  // namespace
}  // namespace equipoise::app
