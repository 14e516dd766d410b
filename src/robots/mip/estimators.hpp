// The MIP's estimators, side by side on the same samples.
// In: Measurement, the input applied since the last one -> out: MipEstimate per estimator. Filters without a
// model of the wheels take phi from the encoders, its rate from their slope, and the heading from gyro and
// encoders. While the robot is held (motors off) the lean comes from the averaged accelerometer and the
// filters are kept at rest. Source: [T] 3.3. RT-safe.
#pragma once

#include <array>

#include "equipoise/estimate/kalman.hpp"
#include "robots/common/fault_tolerant.hpp"
#include "robots/mip/ekf.hpp"
#include "robots/mip/mip.hpp"
#include "robots/mip/models.hpp"
#include "robots/mip/published.hpp"

namespace equipoise {

enum class MipEstimatorId : int {
  kComplementary,
  kComplementaryKf,
  kPlanarKf,
  kEkf,
  kEkfPublished,
  kAttitude,
  kTruth
};
inline constexpr std::array<const char*, 7> kMipEstimatorNames{
    "complementary", "complementary_kf", "planar_kf", "ekf", "ekf_published", "attitude", "truth"};

struct MipEstimatorParams {
  MipEstimatorId active = MipEstimatorId::kEkf;
  bool compare = false;                  // run all of them, not only the active one
  bool detection = true;                 // false: every sensor is used as it comes
  Vec3 gyro_axis_sign = Vec3::Ones();    // of the sensor's axis along each of the body's
  double complementary_weight = 0.98;    // of the gyro, (3.29)
  double heading_time_constant_s = 0.5;  // gyro above, encoders below
  KalmanFilter<MipInclinometerModel>::Params complementary_kf;
  KalmanFilter<MipPlanarModel>::Params planar_kf;
  MipEkf::Params ekf;
  KalmanFilter<MipPublishedModel>::Params ekf_published;
  MipParameters robot;
};

/// Runs the active estimator, or all of them.
class MipEstimators : public FaultTolerant<Mip, MipEkf, MipEstimatorParams, kMipEstimatorNames> {
 public:
  explicit MipEstimators(const Params& params);

  /// `held`: motors off, the robot is not balancing.
  const MipEstimate& update(const Mip::Sample& z, const Vec2& u, bool held) noexcept;

  /// The default filter of a robot that moves already; tilt and bias from elsewhere.
  void start_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s, const Mip::Sample& z) noexcept;

  bool reads_attitude() const noexcept { return runs(Id::kAttitude); }

 private:
  void start(const Mip::Sample& z) noexcept;
  void from_wheels_and_gyro(Id id, const Mip::Sample& z) noexcept;
  void complementary(const Mip::Sample& z) noexcept;
  void complementary_kf(const Mip::Sample& z) noexcept;
  void planar_kf(const Mip::Sample& z, const Vec2& u) noexcept;
  void step_ekf(const Mip::Sample& z, const Vec2& u) noexcept;
  void ekf_published(const Mip::Sample& z, const Vec2& u) noexcept;
  void attitude(const Mip::Sample& z) noexcept;

  KalmanFilter<MipInclinometerModel> complementary_kf_;
  KalmanFilter<MipPlanarModel> planar_kf_;
  KalmanFilter<MipPublishedModel> ekf_published_;
  double heading_ = 0.0;        // of gyro and encoders
  double gyro_previous_ = 0.0;  // x, of the last tick
  double inclination_previous_ = 0.0;
};

}  // namespace equipoise
