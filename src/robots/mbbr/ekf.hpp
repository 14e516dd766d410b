// The MBBR's default filter: the corrected model, discretised by Heun's third-order rule, with what differs
// from robot to robot as states: the IMU's mount, gyro bias, radii, torques that the model does not know.
// In: Measurement, the input applied since the last one -> out: state at the sample's time, normalised
// innovation of every row, variances. Encoders enter wheel by wheel, so that a lost wheel is a skipped row;
// missed ticks are predicted. Source: docs/derivation.md; [T] 5.1.6, 6.1. RT-safe.
#pragma once

#include "equipoise/estimate/packed_filter.hpp"
#include "equipoise/estimate/time_base.hpp"
#include "generated/mbbr_filter.hpp"
#include "robots/mbbr/high_yaw.hpp"
#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// States: the 10 observable ones; mount angles about body x, y (sensor against body); gyro bias x, y; how
/// much more the wheels turn than the configured radii say; disturbance of u, its x, y standing in the
/// inertial frame. The encoders' sums e are as counted, so that a change of the scale leaves them alone.
/// Bias z: from rest only, in motion roller tilt fakes yaw.
class MbbrEkfModel {
 public:
  static constexpr int kStates = 18;
  static constexpr int kInputs = 3;
  static constexpr int kOutputs = 8;
  enum State : int {
    kThetaX,
    kThetaY,
    kE,
    kThetaDotX = 5,
    kThetaDotY,
    kThetaDotZ,
    kPhiDotX,
    kPhiDotY,
    kMountX,
    kMountY,
    kBiasX,
    kBiasY,
    kWheelScale,  // r / r_w of the robot over the configured one, less 1
    kDisturbance
  };
  enum Output : int { kGyro, kWheel = 3, kAccel = 6 };  // three, three, two rows
  static constexpr int kTurning = kE;                   // angles that grow without bound
  static constexpr int kTurnings = 3;

  MbbrEkfModel(const MbbrParameters& p, double disturbance_time_constant_s);
  void predict(const Vec<18>& x, const Vec3& u, Vec<18>& x_next, Mat<18, 18>& F) const noexcept;
  Mat<18, 3> input_matrix() const noexcept;
  void measure(const Vec<18>& x, const Vec3& u, Vec<8>& y, Mat<8, 18>& H) const noexcept;
  /// For the generated form of the filter, noises left open.
  generated::MbbrFilter::Constants<double> constants() const noexcept;
  /// What the samples have of the turning angles.
  Mat<8, 3> turning_rows() const noexcept;
  /// The observable states after dt, without a Jacobian.
  MbbrObservable::State ahead(const MbbrObservable::State& x, const Vec3& u, double dt) const noexcept;

 private:
  MbbrCoefficients c_;
  Mat3 wheels_from_ball_;
  Vec2 lever_arm_;
  double keep_;  // of the disturbance, per tick
  Mat<10, 3> B_;
};

extern template class PackedFilter<MbbrEkfModel, generated::MbbrFilter>;

class MbbrEkf {
 public:
  using Model = MbbrEkfModel;
  using Filter = PackedFilter<Model, generated::MbbrFilter>;
  struct Params {
    Filter::Params filter;
    double disturbance_time_constant_s = 1.0;
    double sensor_age_s = 0.0;  // of the IMU's samples against the encoders'
    Precision precision = Precision::kDouble;
    double push_nis = 24.0;  // of the accelerometer, beyond which the robot is pushed
  };

  MbbrEkf(const MbbrParameters& robot, const Params& params);

  /// At rest: tilt from the averaged accelerometer, bias from the averaged gyro.
  void start(const Vec2& tilt, const Vec3& gyro_bias_B_rad_s, const Vec3& wheel_angle_rad) noexcept;
  /// As start(), of a robot that moves as the sample says.
  void start_moving(const Vec2& tilt, const Vec3& gyro_bias_B_rad_s, const Mbbr::Sample& z) noexcept;
  /// A tick without samples; `u` acted in it.
  void predict(const Vec3& u) noexcept;
  /// The samples at the end of the predicted tick. Without any there is nothing to correct: a loop that was
  /// late catches up by predictions.
  void update(const Mbbr::Sample& z) noexcept {
    if (!z.imu_ok && !z.encoders_ok) return miss(z);
    innovate(z);
    correct();
  }
  /// The first half of update(): innovations and their variances, the state as predicted.
  void innovate(const Mbbr::Sample& z) noexcept;
  /// The second half.
  void correct() noexcept {
    filter_.correct();
    filter_.limit(Model::kWheelScale, largest_scale_);
  }
  /// The state of another filter, with this one's noise: a copy of x and P, without constants.
  void adopt(const MbbrEkf& other) noexcept;

  /// Now, that is `sensor_age_s` after the filter's own state.
  MbbrEstimate estimate() const noexcept;
  Vec3 wheel_rate_rad_s() const noexcept;
  Vec3 wheel_angle_rad() const noexcept;

  /// A force at the body's centre of mass acted in the predicted tick.
  void allow_push(double sigma_N) noexcept;
  /// The ball has spun on the floor in it.
  void allow_spin(double sigma_rad) noexcept { filter_.widen(Model::kE + 2, 1, sigma_rad * sigma_rad); }
  /// Wheels have slipped on the ball in it.
  void allow_slip(double sigma_rad) noexcept { filter_.widen(Model::kE, 3, sigma_rad * sigma_rad); }

  static constexpr int kBiases = 2;  // of the gyro, that it estimates
  Vec<kBiases> gyro_biases() const noexcept { return filter_.x().segment<kBiases>(Model::kBiasX); }
  double gyro_bias(int axis) const noexcept { return filter_.x()(Model::kBiasX + axis); }
  /// The gyro's bias is known to so much less.
  void doubt_bias(double sigma_rad_s) noexcept { filter_.widen(Model::kBiasX, 2, sigma_rad_s * sigma_rad_s); }

  /// What start() takes of a tilt.
  static Vec2 lean(const Vec2& tilt_rad) noexcept { return tilt_rad; }
  /// Of u, as estimated.
  Vec3 disturbance() const noexcept { return filter_.x().segment<3>(Model::kDisturbance); }
  const Vec<18>& x() const noexcept { return filter_.x(); }
  Mat<18, 18> P() const noexcept { return filter_.P(); }
  /// gyro x, y, z, wheels, accelerometer x, y: squared innovation over its variance; 0 where not used.
  const std::array<double, 8>& row_nis() const noexcept { return filter_.row_nis(); }
  const std::array<double, 8>& row_innovation() const noexcept { return filter_.row_innovation(); }
  const std::array<double, 8>& row_variance() const noexcept { return filter_.row_variance(); }
  double row_noise(std::size_t row) const noexcept { return filter_.row_noise(row); }
  void set_row_noise(std::size_t row, double variance) noexcept { filter_.set_row_noise(row, variance); }
  /// A wheel did in the last update, or seemed to.
  bool slipped() const noexcept { return slipped_; }
  double tilt_sigma_rad() const noexcept {
    return std::sqrt(filter_.variance(Model::kThetaX) + filter_.variance(Model::kThetaY));
  }

 private:
  /// In the last update, by the accelerometer; 0: none.
  double felt_push_N() const noexcept;
  void miss(const Mbbr::Sample& z) noexcept;

  Params params_;
  MbbrKinematics kinematics_;
  double mass_kg_;
  double largest_scale_;  // three sigmas; what wheels turn beyond is slip, for long where they rub
  Filter filter_;
  Vec2 per_push_;  // change of tilt and ball rate in a tick, per N
  TimeBase<3, 3> time_;
  double gyro_bias_z_ = 0.0;
  double heading_ = 0.0;
  Turn direction_{0.0};  // of it
  Vec2 phi_ = Vec2::Zero();
  bool slipped_ = false;
};

}  // namespace equipoise
