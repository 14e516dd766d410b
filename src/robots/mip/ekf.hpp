// The MIP's default filter: the high-yaw-rate model, discretised by Heun's third-order rule, with what
// differs from robot to robot as states: IMU mount, gyro bias, lever arm, track, and torques not known.
// In: Measurement, the input applied since the last one -> out: state at the sample's time, normalised
// innovation of every row, variances. Encoders enter wheel by wheel, so that a lost wheel is a skipped row;
// missed ticks are predicted. Source: [T] (3.35)-(3.47); corrections in docs/derivation.md. RT-safe.
#pragma once

#include "equipoise/estimate/packed_filter.hpp"
#include "equipoise/estimate/time_base.hpp"
#include "generated/mip_filter.hpp"
#include "robots/mip/mip.hpp"
#include "robots/mip/models.hpp"

namespace equipoise {

struct MipEkfOptions {
  bool estimate_gyro_bias = true;
  bool estimate_mount = true;
  bool know_lever_arm = true;      // the configured IMU position; false: at the centre of mass, as in [T]
  bool estimate_lever_arm = true;  // its y, starting from the above
  bool encoders_slip = true;       // a wheel's may turn alone: encoder_slip.hpp
};

/// States of [T] (3.37), psi as counted by the encoders; mount angles about body x, y, z (sensor against
/// body); bias of gyro x; lever arm y; how much more the wheels turn than the configured track and radius
/// say; disturbance of u. Bias of gyro y and z: from rest only.
class MipEkfModel {
 public:
  static constexpr int kStates = 14;
  static constexpr int kInputs = 2;
  static constexpr int kOutputs = 6;
  enum State : int {
    kTheta,
    kPhi,
    kPsi,
    kThetaDot,
    kPhiDot,
    kPsiDot,
    kMountX,
    kMountY,
    kMountZ,
    kGyroBias,
    kLeverArm,
    kWheelScale,  // track / radius of the robot over the configured one, less 1
    kDisturbance
  };
  enum Output : int { kGyro, kWheel = 3, kAccelY = 5 };  // three, two, one row
  static constexpr int kTurning = kPhi;                  // angles that grow without bound
  static constexpr int kTurnings = 2;
  using Motion = Vec<6>;  // the first six states

  MipEkfModel(const MipParameters& p, const MipEkfOptions& options, double disturbance_time_constant_s);
  void derivative(const Motion& x, const Vec2& u, Motion& x_dot, Mat<6, 6>& A) const noexcept;
  void predict(const Vec<14>& x, const Vec2& u, Vec<14>& x_next, Mat<14, 14>& F) const noexcept;
  Mat<14, 2> input_matrix() const noexcept;
  void measure(const Vec<14>& x, const Vec2& u, Vec<6>& y, Mat<6, 14>& H) const noexcept;
  /// For the generated form of the filter, noises left open.
  generated::MipFilter::Constants<double> constants() const noexcept;
  /// What the samples have of the turning angles.
  Mat<6, 2> turning_rows() const noexcept;
  /// The motion after dt, without a Jacobian.
  Motion ahead(const Motion& x, const Vec2& u, double dt) const noexcept;

 private:
  MipCoefficients c_;
  double yaw_to_wheel_;
  double bias_;  // 1 where estimated, else 0
  double mount_;
  double lever_arm_;
  double keep_;  // of the disturbance, per tick
  Mat<6, 2> B_;
};

extern template class PackedFilter<MipEkfModel, generated::MipFilter>;

class MipEkf {
 public:
  using Model = MipEkfModel;
  using Filter = PackedFilter<Model, generated::MipFilter>;
  struct Params {
    Filter::Params filter;
    MipEkfOptions options;
    double disturbance_time_constant_s = 1.0;
    double sensor_age_s = 0.0;  // of the IMU's samples against the encoders'
    Precision precision = Precision::kDouble;
  };

  MipEkf(const MipParameters& robot, const Params& params);

  /// At rest: lean from the averaged accelerometer, bias from the averaged gyro.
  void start(double lean, const Vec3& gyro_bias_B_rad_s, const Vec2& wheel_angle_rad) noexcept;
  /// As start(), of a robot that moves as the sample says.
  void start_moving(double lean, const Vec3& gyro_bias_B_rad_s, const Mip::Sample& z) noexcept;
  /// A tick without samples; `u` acted in it.
  void predict(const Vec2& u) noexcept;
  /// The samples at the end of the predicted tick. Without any there is nothing to correct: a loop that was
  /// late catches up by predictions.
  void update(const Mip::Sample& z) noexcept {
    if (!z.imu_ok && !z.encoders_ok) return miss(z);
    innovate(z);
    correct();
  }
  /// The first half of update(): innovations and their variances, the state as predicted.
  void innovate(const Mip::Sample& z) noexcept;
  /// The second half.
  void correct() noexcept { filter_.correct(); }
  /// The state of another filter, with this one's noise: a copy of x and P, without constants.
  void adopt(const MipEkf& other) noexcept;

  /// Now, that is `sensor_age_s` after the filter's own state; without a position.
  MipEstimate estimate() const noexcept;
  Vec2 wheel_rate_rad_s() const noexcept;
  Vec2 wheel_angle_rad() const noexcept;

  /// A force at the body's centre of mass acted in the predicted tick.
  void allow_push(double sigma_N) noexcept;
  /// One wheel was hit: the robot yaws.
  void allow_hit(double sigma_N) noexcept {
    filter_.widen(Model::kPsiDot, 1, std::pow(sigma_N * per_hit_, 2));
  }
  /// The robot has turned on the floor in it, otherwise than its wheels say.
  void allow_spin(double sigma_rad) noexcept { filter_.widen(Model::kPsi, 1, sigma_rad * sigma_rad); }
  /// Wheels have slipped on the floor in it.
  void allow_slip(double sigma_rad) noexcept { filter_.widen(Model::kPhi, 2, sigma_rad * sigma_rad); }

  static constexpr int kBiases = 1;  // of the gyro, that it estimates
  Vec<kBiases> gyro_biases() const noexcept { return filter_.x().segment<kBiases>(Model::kGyroBias); }
  double gyro_bias(int axis) const noexcept { return filter_.x()(Model::kGyroBias + axis); }
  /// The gyro's bias is known to so much less.
  void doubt_bias(double sigma_rad_s) noexcept {
    filter_.widen(Model::kGyroBias, 1, sigma_rad_s * sigma_rad_s);
  }

  /// What start() takes of a tilt.
  static double lean(const Vec2& tilt_rad) noexcept { return tilt_rad.x(); }
  /// Of u, as estimated.
  Vec2 disturbance() const noexcept { return filter_.x().segment<2>(Model::kDisturbance); }
  const Vec<14>& x() const noexcept { return filter_.x(); }
  Mat<14, 14> P() const noexcept { return filter_.P(); }
  /// gyro x, y, z, wheels, accelerometer y: squared innovation over its variance; 0 where not used.
  const std::array<double, 6>& row_nis() const noexcept { return filter_.row_nis(); }
  const std::array<double, 6>& row_innovation() const noexcept { return filter_.row_innovation(); }
  const std::array<double, 6>& row_variance() const noexcept { return filter_.row_variance(); }
  double row_noise(std::size_t row) const noexcept { return filter_.row_noise(row); }
  void set_row_noise(std::size_t row, double variance) noexcept { filter_.set_row_noise(row, variance); }
  /// A wheel did in the last update, or seemed to, if they may at all.
  bool slipped() const noexcept { return slipped_; }
  double tilt_sigma_rad() const noexcept { return std::sqrt(filter_.variance(Model::kTheta)); }

 private:
  void miss(const Mip::Sample& z) noexcept;

  MipKinematics kinematics_;
  Filter filter_;
  double per_hit_ = 0.0;  // change of yaw rate in a tick, per N
  Vec2 per_push_;         // change of tilt and wheel rate in a tick, per N
  TimeBase<2, 2> time_;
  bool encoders_slip_;
  bool slipped_ = false;
  Vec2 gyro_bias_yz_ = Vec2::Zero();
  double heading_ = 0.0;
  bool pushed_ = false;
  int settling_ = 0;   // ticks left until a push is told
  int without_y_ = 0;  // ticks left in which the gyro's y is not heard
};

}  // namespace equipoise
