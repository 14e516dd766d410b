// The MIP's estimators, side by side on the same samples.
// In: Measurement, the input applied since the last one -> out: MipEstimate per estimator. Filters without a
// model of the wheels take phi from the encoders, its rate from their slope, and the heading from gyro and
// encoders. While the robot is held (motors off) the lean comes from the averaged accelerometer and the
// filters are kept at rest. Source: [T] 3.3. RT-safe.
#pragma once

#include <array>

#include "equipoise/estimate/health.hpp"
#include "equipoise/estimate/kalman.hpp"
#include "equipoise/estimate/rest_bias.hpp"
#include "equipoise/estimate/rest_tilt.hpp"
#include "equipoise/estimate/sensor_faults.hpp"
#include "equipoise/estimate/slow_drift.hpp"
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
class MipEstimators {
 public:
  using Id = MipEstimatorId;
  using Params = MipEstimatorParams;
  static constexpr std::size_t kCount = kMipEstimatorNames.size();
  static constexpr const auto& kNames = kMipEstimatorNames;

  explicit MipEstimators(const Params& params);

  /// Simulation only: what `truth` returns from now on.
  void observe_truth(const MipEstimate& truth) noexcept { estimates_[index(Id::kTruth)] = truth; }

  /// `held`: motors off, the robot is not balancing.
  const MipEstimate& update(const Mip::Sample& z, const Vec2& u, bool held) noexcept;

  /// The default filter of a robot that moves already; tilt and bias from elsewhere.
  void start_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s, const Mip::Sample& z) noexcept;

  bool runs(Id id) const noexcept { return id == params_.active || params_.compare; }
  const MipEstimate& estimate(Id id) const noexcept { return estimates_[index(id)]; }
  /// The default filter: rows, variances, predicted wheel rates.
  const MipEkf& ekf() const noexcept { return ekf_; }
  /// Of the active estimator; only the default filter tells.
  EstimatorHealth<Mip::kWheels> health() const noexcept;
  /// It finds a faulty encoder by itself.
  bool isolates() const noexcept { return params_.active == Id::kEkf; }
  /// Default filters that run: the control's, and those that look for faults; see sensor_faults.hpp.
  int filters() const noexcept { return params_.detection ? static_cast<int>(faults_.kCount) + 2 : 1; }
  bool reads_attitude() const noexcept { return runs(Id::kAttitude); }

 private:
  static std::size_t index(Id id) noexcept { return static_cast<std::size_t>(id); }
  void start(const Mip::Sample& z) noexcept;
  void from_wheels_and_gyro(Id id, const Mip::Sample& z) noexcept;
  void move(Id id) noexcept;
  void complementary(const Mip::Sample& z) noexcept;
  void complementary_kf(const Mip::Sample& z) noexcept;
  void planar_kf(const Mip::Sample& z, const Vec2& u) noexcept;
  void ekf(const Mip::Sample& z, const Vec2& u) noexcept;
  void ekf_published(const Mip::Sample& z, const Vec2& u) noexcept;
  void attitude(const Mip::Sample& z) noexcept;

  Params params_;
  MipKinematics kinematics_;
  KalmanFilter<MipInclinometerModel> complementary_kf_;
  KalmanFilter<MipPlanarModel> planar_kf_;
  MipEkf ekf_;
  SensorFaults<MipEkf, Mip::kWheels> faults_;
  SlowDrift<1> bias_drift_;
  KalmanFilter<MipPublishedModel> ekf_published_;
  RestTilt rest_tilt_;
  RestBias rest_bias_;
  std::array<MipEstimate, kCount> estimates_{};
  double heading_ = 0.0;        // of gyro and encoders
  double gyro_previous_ = 0.0;  // x, of the last tick
  double inclination_previous_ = 0.0;
};

}  // namespace equipoise
