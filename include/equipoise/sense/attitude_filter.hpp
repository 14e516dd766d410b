// Our own attitude from gyro and accelerometer, magnetometer optional: in place of the IMU's packets (DMP).
// In: rate, specific force (body axes), every tick -> out: R_EB as a quaternion, gyro bias. Specific force is
// averaged in a frame that only the gyro turns, so that motion cancels out of it (Laidig and Seel, VQF,
// 2023); what rotation adds at the IMU's lever arm is taken out first. Gyro bias: averaged at rest, otherwise
// a Kalman filter on the inclination's drift. RT-safe.
#pragma once

#include <Eigen/Geometry>

#include "equipoise/samples.hpp"

namespace equipoise {

struct AttitudeFilterParams {
  bool own = false;                   // use it; false: the attitude packets
  Vec3 lever_arm_B_m = Vec3::Zero();  // from the point that moves least to the IMU
  double tick_s = kTickS;
  double accel_time_constant_s = 3.5;  // of the average
  double mag_time_constant_s = 9.0;
  double bias_sigma_initial_rad_s = 0.5 * kPi / 180.0;
  double bias_sigma_rest_rad_s = 0.03 * kPi / 180.0;
  double bias_sigma_motion_rad_s = 0.1 * kPi / 180.0;
  double bias_forgetting_s = 100.0;  // time in which the bias may wander by 0.1 deg/s
  double bias_limit_rad_s = 2.0 * kPi / 180.0;
  // Deviation from the average below which it may be at rest: four sigma of an MPU-9250 (data sheet: 0.1
  // deg/s at 92 Hz). A balancing robot sways slowly; what passes for rest is averaged into the bias.
  double rest_rate_rad_s = 0.4 * kPi / 180.0;
  double rest_accel_m_s2 = 0.5;
  double rest_after_s = 0.4;        // a robot stands for half a second before it arms
  double mag_norm_tolerance = 0.1;  // share; beyond it the field is disturbed and not used
  double mag_dip_tolerance_rad = 10.0 * kPi / 180.0;
};

/// Second-order Butterworth low-pass of a vector, started with a plain mean.
template <int N>
class VectorLowPass {
 public:
  VectorLowPass(double time_constant_s, double tick_s) noexcept;
  const Vec<N>& update(const Vec<N>& x) noexcept;

 private:
  double b0_, a1_, a2_;
  int warm_up_;
  int samples_ = 0;
  Vec<N> sum_ = Vec<N>::Zero();
  Vec<N> s1_ = Vec<N>::Zero(), s2_ = Vec<N>::Zero(), y_ = Vec<N>::Zero();
};

class AttitudeFilter {
 public:
  using Params = AttitudeFilterParams;
  explicit AttitudeFilter(const Params& params) noexcept;

  void update(const Vec3& gyro_B_rad_s, const Vec3& specific_force_B_m_s2) noexcept;
  /// After update(), when there is a new sample; any unit. Turns the heading to magnetic north (y).
  void update_magnetometer(const Vec3& field_B) noexcept;

  Eigen::Quaterniond q_EB() const noexcept { return (q_EI_ * q_IB_).normalized(); }
  const Vec3& gyro_bias_B_rad_s() const noexcept { return bias_; }

 private:
  void detect_rest(const Vec3& gyro, const Vec3& force) noexcept;
  void correct_inclination(const Vec3& force) noexcept;
  void estimate_bias(const Vec3& up_E) noexcept;

  Params p_;
  Eigen::Quaterniond q_IB_ = Eigen::Quaterniond::Identity();  // by the gyro alone
  Eigen::Quaterniond q_EI_ = Eigen::Quaterniond::Identity();  // slow correction
  Vec3 gyro_previous_ = Vec3::Zero();
  bool started_ = false;
  VectorLowPass<3> force_average_;
  VectorLowPass<9> rotation_average_;
  VectorLowPass<2> turned_bias_average_;
  VectorLowPass<3> gyro_slow_, gyro_fast_, force_slow_, force_fast_;  // of rest
  Vec3 rest_gyro_mean_ = Vec3::Zero();
  double rest_s_ = 0.0;
  bool at_rest_ = false;
  Vec3 bias_ = Vec3::Zero();
  Mat3 P_;
  double field_norm_ = 0.0;
  double field_dip_ = 0.0;
  double mag_s_ = 0.0;
};

/// The stage of the tick: attitude and freshness as the packets would bring them.
template <class Sample>
void apply(AttitudeFilter& filter, Sample& z) noexcept {
  if (z.imu_ok) filter.update(z.gyro_B_rad_s, -z.accel_B_m_s2);
  const Mat3 R = filter.q_EB().toRotationMatrix();
  z.attitude_rad = {std::atan2(R(2, 1), R(2, 2)), std::asin(std::fmax(-1.0, std::fmin(1.0, -R(2, 0)))),
                    std::atan2(R(1, 0), R(0, 0))};
  z.attitude_ok = z.imu_ok;
}

}  // namespace equipoise
