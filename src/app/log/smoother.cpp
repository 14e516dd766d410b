#include "app/log/smoother.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "app/import/signals.hpp"
#include "equipoise/estimate/rest_bias.hpp"

namespace equipoise::app {
namespace {

using State = Vec<6>;  // up in body axes, gyro bias
using Matrix6 = Mat<6, 6>;

constexpr double kGyroDensity =
    kPi / 180.0 * 0.01;                  // rad/s per root Hz: MPU-6050 and 9250, 0.005 to 0.01 deg/s
constexpr double kBiasWalk = 1e-4;       // rad/s per root second: a few hundredths of deg/s in a minute
constexpr double kFirstBias = 0.1;       // rad/s, uncalibrated
constexpr double kFirstYawBias = 0.005;  // gravity says nothing of it; taken off at rest
constexpr double kRollingBand_Hz = 6.0;  // of the wheels' accelerations: encoders count in steps
constexpr int kBlock = 100;              // ticks, longer than the body's vibration and sway
constexpr double kFirst = 1.0;           // (m/s2)^2 of a sample: 0.1 m/s2 over a block
constexpr int kPasses = 5;               // after which the blocks' variances stay

Mat3 cross(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// First-order low-pass forwards and backwards: no lag. The ends go on mirrored through themselves, so that a
/// log that begins in motion does not begin with a jerk.
std::vector<Vec2> without_lag(const std::vector<Vec2>& signal) {
  const std::size_t n = signal.size();
  const std::size_t pad = std::min<std::size_t>(kBlock, n - 1);
  std::vector<Vec2> x;
  for (std::size_t k = pad; k > 0; --k) x.emplace_back(2.0 * signal.front() - signal[k]);
  x.insert(x.end(), signal.begin(), signal.end());
  for (std::size_t k = 1; k <= pad; ++k) x.emplace_back(2.0 * signal.back() - signal[n - 1 - k]);
  const double share = 1.0 - std::exp(-2.0 * kPi * kRollingBand_Hz * kTickS);
  for (std::size_t k = 1; k < x.size(); ++k) x[k] = x[k - 1] + share * (x[k] - x[k - 1]);
  for (std::size_t k = x.size() - 1; k > 0; --k) x[k - 1] = x[k] + share * (x[k - 1] - x[k]);
  return {x.begin() + static_cast<std::ptrdiff_t>(pad), x.begin() + static_cast<std::ptrdiff_t>(pad + n)};
}

std::vector<Vec2> slope(const std::vector<Vec2>& x) {
  std::vector<Vec2> out(x.size(), Vec2::Zero());
  for (std::size_t k = 1; k + 1 < x.size(); ++k) out[k] = (x[k + 1] - x[k - 1]) / (2.0 * kTickS);
  if (x.size() < 3) return out;
  out.front() = out[1];
  out.back() = out[x.size() - 2];
  return out;
}

/// Specific force without what rolling and turning add at the IMU; the floor's plane, in axes that yaw along.
std::vector<Vec3> felt_gravity(const std::vector<SmootherSample>& s, double radius_m, double imu_height_m) {
  std::vector<Vec2> rolling;
  std::vector<Vec2> rate;
  for (const SmootherSample& each : s) {
    rolling.push_back(each.rolling_rad);
    rate.push_back(each.gyro_rad_s.head<2>());
  }
  rate = without_lag(rate);
  const std::vector<Vec2> turn = slope(rate);
  std::vector<Vec2> velocity = slope(without_lag(without_lag(rolling)));
  for (std::size_t k = 0; k < s.size(); ++k) {
    const Vec2 turned = velocity[k] + rate[k];
    velocity[k] = radius_m * Vec2(turned.y(), -turned.x());
  }
  const std::vector<Vec2> change = slope(velocity);
  std::vector<Vec3> out;
  for (std::size_t k = 0; k < s.size(); ++k) {
    const double yaw = s[k].gyro_rad_s.z();
    const Vec2 axle = change[k] + yaw * Vec2(-velocity[k].y(), velocity[k].x());
    const Vec2 lever = Vec2(turn[k].y(), -turn[k].x()) + yaw * rate[k];
    const Vec2 felt = axle + imu_height_m * lever;
    out.push_back(s[k].accel_m_s2 - Vec3(felt.x(), felt.y(), 0.0));
  }
  return out;
}

/// `z` measures the states from `first` on, times `scale`.
void correct(State* x, Matrix6* P, int first, double scale, const Vec3& z, const Vec3& variance) {
  const Mat3 S = scale * scale * P->block<3, 3>(first, first) + Mat3(variance.asDiagonal());
  const Mat<6, 3> K = scale * P->middleCols<3>(first) * S.inverse();
  *x += K * (z - scale * x->segment<3>(first));
  *P -= scale * K * P->middleRows<3>(first);
  *P = 0.5 * (*P + P->transpose().eval());
}

struct Step {
  State x_predicted, x;
  Matrix6 P_predicted, P, F;
};

struct Smooth {
  State x;
  Matrix6 P;
};

/// `variance`: of a sample of gravity, per block.
std::vector<Smooth> pass(const std::vector<SmootherSample>& s, const std::vector<Vec3>& gravity,
                         const std::vector<double>& variance) {
  std::vector<Step> steps(s.size());
  State x = State::Zero();
  Vec3 first = Vec3::Zero();
  for (std::size_t k = 0; k < std::min<std::size_t>(s.size(), kBlock); ++k) first += gravity[k];
  x.head<3>() = first.norm() > 0.0 ? Vec3(first.normalized()) : Vec3(Vec3::UnitZ());
  Matrix6 P = Matrix6::Zero();
  P.diagonal() << 0.1, 0.1, 0.1, Vec3(kFirstBias, kFirstBias, kFirstYawBias).cwiseAbs2();
  Matrix6 Q = Matrix6::Zero();
  Q.diagonal() << Vec3::Constant(kGyroDensity * kGyroDensity * kTickS),
      Vec3::Constant(kBiasWalk * kBiasWalk * kTickS);
  Vec3 gyro = s.front().gyro_rad_s;
  RestBias rest;
  for (std::size_t k = 0; k < s.size(); ++k) {
    Step& step = steps[k];
    const Vec3 before = gyro;
    if (s[k].imu_ok) gyro = s[k].gyro_rad_s;
    const Vec3 rate = 0.5 * (before + gyro) - x.tail<3>();
    step.F.setIdentity();
    if (k > 0) {
      step.F.topLeftCorner<3, 3>() =
          Eigen::AngleAxisd(-kTickS * rate.norm(), rate.stableNormalized()).toRotationMatrix();
      step.F.topRightCorner<3, 3>() = -kTickS * cross(x.head<3>());
      x.head<3>() = step.F.topLeftCorner<3, 3>() * x.head<3>();
      P = step.F * P * step.F.transpose() + Q;
    }
    step.x_predicted = x;
    step.P_predicted = P;
    if (s[k].imu_ok) correct(&x, &P, 0, kGravity_m_s2, gravity[k], Vec3::Constant(variance[k / kBlock]));
    const Vec3 bias = rest.update(gyro);
    if (rest.stands()) correct(&x, &P, 3, 1.0, bias, rest.scatter_rad_s().cwiseAbs2());
    step.x = x;
    step.P = P;
  }
  std::vector<Smooth> out(s.size());
  out.back() = {steps.back().x, steps.back().P};
  for (std::size_t k = s.size() - 1; k > 0; --k) {
    const Step& step = steps[k - 1];
    const Step& next = steps[k];
    const Matrix6 gain = step.P * next.F.transpose() * next.P_predicted.inverse();
    out[k - 1].x = step.x + gain * (out[k].x - next.x_predicted);
    out[k - 1].P = step.P + gain * (out[k].P - next.P_predicted) * gain.transpose();
  }
  return out;
}

/// What one sample's white noise would have to be to make the means of blocks as uncertain as they are; where
/// samples scatter more than in the median block, as much more: a robot that skids says less of gravity.
std::vector<double> variances_of(const std::vector<Vec3>& gravity, const std::vector<Smooth>& smooth) {
  constexpr double kLeast = 1e-4;  // (m/s2)^2
  std::vector<double> scatter;
  double of_means = 0.0;
  for (std::size_t k = 0; k < smooth.size(); k += kBlock) {
    const std::size_t end = std::min(smooth.size(), k + kBlock);
    const auto n = static_cast<double>(end - k);
    Vec2 sum = Vec2::Zero();
    double squares = 0.0;
    for (std::size_t i = k; i < end; ++i) {
      const Vec2 off = (gravity[i] - kGravity_m_s2 * smooth[i].x.head<3>()).head<2>();
      sum += off;
      squares += off.squaredNorm();
    }
    of_means += sum.squaredNorm() / (2.0 * n);
    scatter.push_back(std::max(kLeast, (squares - sum.squaredNorm() / n) / (2.0 * n)));
  }
  if (scatter.size() < 3) return std::vector<double>(scatter.size(), kFirst);
  const double usual = median(scatter);
  double times = 0.0;
  for (double& each : scatter) times += each = std::max(1.0, each / usual);
  for (double& each : scatter) each *= std::max(kLeast, of_means / times);
  return scatter;
}

}  // namespace

Smoothed smooth(const std::vector<SmootherSample>& samples, double radius_m, double imu_height_m) {
  const std::vector<Vec3> gravity = felt_gravity(samples, radius_m, imu_height_m);
  std::vector<double> variance(samples.size() / kBlock + 1, kFirst);
  std::vector<Smooth> smooth;
  for (int i = 0; i < kPasses; ++i) {
    smooth = pass(samples, gravity, variance);
    variance = variances_of(gravity, smooth);
  }
  Smoothed out;
  for (const auto& [x, P] : smooth) {
    out.tilt_rad.emplace_back(std::atan2(x.y(), x.z()), -std::atan2(x.x(), std::hypot(x.y(), x.z())));
    out.tilt_variance.emplace_back(P(1, 1), P(0, 0));
    out.bias_rad_s.emplace_back(x.tail<3>());
  }
  return out;
}

}  // namespace equipoise::app
