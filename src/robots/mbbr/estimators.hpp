// The MBBR's estimators, side by side on the same samples.
// In: Measurement, the input applied since the last one -> out: MbbrEstimate per estimator. Each integrates
// the inertial ball angles from its own rates, [T] (6.3)-(6.4); the drift is reported, not hidden. While the
// robot is held (motors off) the tilt comes from the averaged accelerometer and the filters are kept at rest.
// RT-safe.
#pragma once

#include <array>

#include "equipoise/estimate/kalman.hpp"
#include "robots/common/fault_tolerant.hpp"
#include "robots/mbbr/ekf.hpp"
#include "robots/mbbr/high_yaw.hpp"
#include "robots/mbbr/mbbr.hpp"
#include "robots/mbbr/published.hpp"

namespace equipoise {

enum class MbbrEstimatorId : int { kEkf, kEkf13Published, kEkf13, kKfAttitude, kTruth };
inline constexpr std::array<const char*, 5> kMbbrEstimatorNames{"ekf", "ekf13_published", "ekf13",
                                                                "kf_attitude", "truth"};

struct MbbrEstimatorParams {
  MbbrEstimatorId active = MbbrEstimatorId::kEkf;
  bool compare = false;                // run all of them, not only the active one
  bool detection = true;               // false: every sensor is used as it comes
  Vec3 gyro_axis_sign = Vec3::Ones();  // of the sensor's axis along each of the body's
  MbbrEkf::Params ekf;
  KalmanFilter<MbbrPublishedModel>::Params ekf13_published;
  KalmanFilter<MbbrModel13>::Params ekf13;
  KalmanFilter<MbbrLinearModel>::Params kf;
  bool kf_yaw_transport = true;  // false: as in [T]
  bool kf_published = false;     // (5.28), (5.29) as published
  MbbrParameters robot;
};

/// Runs the active estimator, or all of them.
class MbbrEstimators : public FaultTolerant<Mbbr, MbbrEkf, MbbrEstimatorParams, kMbbrEstimatorNames> {
 public:
  explicit MbbrEstimators(const Params& params);

  /// `held`: motors off, the robot is not balancing.
  const MbbrEstimate& update(const Mbbr::Sample& z, const Vec3& u, bool held) noexcept;

  /// The default filter of a robot that moves already; tilt and bias from elsewhere.
  void start_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s, const Mbbr::Sample& z) noexcept;

  bool reads_attitude() const noexcept { return runs(Id::kKfAttitude); }

 private:
  void start(const Mbbr::Sample& z) noexcept;
  bool runs_published() const noexcept {
    return runs(Id::kEkf13Published) || runs(Id::kEkf13) || runs(Id::kKfAttitude);
  }
  void published(const Mbbr::Sample& z, const Vec3& u) noexcept;
  void step_ekf(const Mbbr::Sample& z, const Vec3& u) noexcept;
  void integrate(Id id, double heading_rate) noexcept;

  KalmanFilter<MbbrPublishedModel> ekf13_published_;
  KalmanFilter<MbbrModel13> ekf13_;
  KalmanFilter<MbbrLinearModel> kf_;
  double attitude_heading_ = 0.0;  // continuous heading of the attitude source
};

}  // namespace equipoise
