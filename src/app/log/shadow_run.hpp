// The body of shadow_log(), for one pipeline. In: its parameters, ticks of a log -> out: Shadow. Included by
// shadow.cpp only.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <tuple>

#include "app/log/shadow.hpp"
#include "app/log/smoother.hpp"
#include "app/text/reasons.hpp"
#include "app/trial/firmware_of.hpp"
#include "equipoise/plant/coulomb.hpp"
#include "equipoise/runtime/loop.hpp"
#include "robots/mbbr/estimators.hpp"
#include "robots/mip/estimators.hpp"

namespace equipoise::app {

struct MipShadowModel {
  static constexpr std::array<const char*, 6> kRows{"gyro_x",  "gyro_y",  "gyro_z",
                                                    "wheel_1", "wheel_2", "accel_y"};
  static constexpr int kAxes = 1;  // tilt and rolling, about x and y
  using Motion = MipEkfModel::Motion;

  explicit MipShadowModel(const MipEstimatorParams& p)
      : model(p.robot, p.ekf.options, p.ekf.disturbance_time_constant_s),
        kinematics(p.robot),
        keep(std::exp(-kTickS / p.ekf.disturbance_time_constant_s)) {}
  static Motion start(const MipEstimate& x, const MipEkf&) {
    Motion m;
    m << x.theta, x.phi, x.psi, x.theta_dot, x.phi_dot, x.psi_dot;
    return m;
  }
  static Vec2 tilt(const Motion& m) { return {m(0), 0.0}; }
  static Vec2 rolled(const Motion& m) { return {m(1), 0.0}; }
  static Vec2 rolling_rate(const Motion& m) { return {m(4), 0.0}; }
  Vec2 rolling(const Vec2& wheels) const { return {kinematics.phi(wheels), 0.0}; }
  Vec2 rubbing_rate(const Motion& m) const { return kinematics.wheels(m(4), m(5)); }  // each gear
  Vec2 input_of(const Vec2& friction) const { return kinematics.axes_from_wheels(friction); }

  MipEkfModel model;
  MipKinematics kinematics;
  double keep;
};

struct MbbrShadowModel {
  static constexpr std::array<const char*, 8> kRows{"gyro_x",  "gyro_y",  "gyro_z",  "wheel_1",
                                                    "wheel_2", "wheel_3", "accel_x", "accel_y"};
  static constexpr int kAxes = 2;
  using Observable = MbbrObservable;
  using Motion = Observable::State;

  explicit MbbrShadowModel(const MbbrEstimatorParams& p)
      : model(p.robot, p.ekf.disturbance_time_constant_s),
        kinematics(p.robot),
        keep(std::exp(-kTickS / p.ekf.disturbance_time_constant_s)) {}
  static Motion start(const MbbrEstimate& x, const MbbrEkf& f) {
    Motion m = f.x().head<10>();
    m.head<2>() = x.theta_xy;
    m.segment<3>(MbbrEkfModel::kThetaDotX) = x.theta_dot;
    m.tail<2>() = x.phi_dot_star;
    return m;
  }
  static Vec2 tilt(const Motion& m) { return m.head<2>(); }
  static Vec2 rolled(const Motion& m) { return m.segment<2>(MbbrEkfModel::kE) - m.head<2>(); }
  static Vec2 rolling_rate(const Motion& m) { return Observable::encoder_rate_B(m).head<2>(); }
  Vec2 rolling(const Vec3& wheels) const { return kinematics.ball_from_wheels(wheels).head<2>(); }
  static Vec3 rubbing_rate(const Motion& m) { return Observable::encoder_rate_B(m); }  // about each body axis
  static Vec3 input_of(const Vec3& friction) { return friction; }

  MbbrEkfModel model;
  MbbrKinematics kinematics;
  double keep;
};

inline MipShadowModel shadow_model(const MipEstimatorParams& p) { return MipShadowModel(p); }
inline MbbrShadowModel shadow_model(const MbbrEstimatorParams& p) { return MbbrShadowModel(p); }

/// What of a logged tick a shadow run needs.
struct ShadowTick {
  RawSample raw;
  std::int64_t now_ns = 0;
  std::array<double, 3> u{};  // voltage of the axes, until the next tick
  double own_tilt_rad = 0.0;
  bool armed = false;
};

inline std::vector<ShadowTick> shadow_ticks(RunLog& log) {
  std::vector<ShadowTick> out;
  for (runtime::TickRecord r; log.next(&r);) {
    out.push_back({r.raw, r.now_ns, r.u_friction, r.estimate.theta_rad[0],
                   r.arm_state == static_cast<std::int32_t>(ArmState::kArmed)});
  }
  return out;
}

template <class P>
class ShadowRun {
 public:
  using Robot = typename P::RobotType;
  using Model = decltype(shadow_model(std::declval<typename P::Params>().estimators));
  using Motion = typename Model::Motion;
  using Input = typename P::Input;
  using Health = EstimatorHealth<Robot::kWheels>;

  ShadowRun(const typename P::Params& params, double radius_m, double imu_height_m,
            std::vector<ShadowTick> ticks)
      : params_(of_shadow(params)),
        radius_m_(radius_m),
        imu_height_m_(imu_height_m),
        ticks_(std::move(ticks)),
        model_(params.estimators) {}

  /// With the mount at which accelerometer and model agree on the mean, as `calibrate` finds it on the robot.
  Shadow run() {
    Vec2 mount_rad = Vec2::Zero();
    for (int left = kLevellings;; --left) {
      follow();
      const Vec2 off = offset_rad();
      if (left == 0 || !(off.norm() > kLevel_rad)) break;
      mount_rad += off;
      params_.calibration.R_BS =
          Eigen::AngleAxisd(-off.norm(), Vec3(off.x(), off.y(), 0.0).normalized()) * params_.calibration.R_BS;
    }
    out_.mount_rad = mount_rad;
    predict();
    measure_noise();
    return std::move(out_);
  }

 private:
  static constexpr int kLevellings = 20;
  static constexpr double kLevel_rad = 5e-4;
  static constexpr int kBefore = 20;   // ticks that the senses need before a start, and after a fault
  static constexpr int kSettle = 100;  // ticks after a start that the tilt's error does not count
  static constexpr std::uint32_t kNotOurs = kNotRequested | kCommandStale | kOverrun | kStall | kBatteryLow |
                                            kNotCalibrated | kRealtimeMissing | kGuardDead;

  /// Nothing that it asks of the motors happens.
  static typename P::Params of_shadow(typename P::Params p) {
    p.safety.encoder_check_drive = p.safety.encoder_probe_drive = 0.0;
    p.safety.max_stall_s = 1e6;
    return p;
  }

  void follow() {
    out_ = {};
    pipeline_.reset();
    calibrate_all();
    judged_.assign(ticks_.size(), false);
    estimates_.assign(ticks_.size(), {});
    for (std::size_t k = 0; k < ticks_.size(); ++k) tick(k);
  }

  /// Mean of the filter's tilt against the smoother's.
  Vec2 offset_rad() const {
    Vec2 sum = Vec2::Zero();
    double n = 0.0;
    for (std::size_t k = 0; k < ticks_.size(); ++k) {
      if (!judged_[k] || k < estimates_[k].seeded_at + kBefore) continue;
      sum.head<Model::kAxes>() +=
          (Model::tilt(estimates_[k].motion) - smoothed_.tilt_rad[k]).template head<Model::kAxes>();
      n += 1.0;
    }
    return sum / std::max(n, 1.0);
  }

  void calibrate_all() {
    samples_.clear();
    wheels_.clear();
    for (const ShadowTick& t : ticks_) {
      const auto z = calibrate<Robot::kWheels>(t.raw, params_.calibration, false);
      wheels_.push_back(z.wheel_angle_rad);
      samples_.push_back({z.gyro_B_rad_s, -z.accel_B_m_s2, model_.rolling(z.wheel_angle_rad), z.imu_ok});
    }
    smoothed_ = smooth(samples_, radius_m_, imu_height_m_);
  }

  /// What is left of the log's voltage after Coulomb friction, which slows what turns and holds what stands.
  Input net(const std::array<double, 3>& u, const Motion& m, const Input& disturbance) const {
    const Input drive = Eigen::Map<const Input>(u.data());
    const Input beside = drive + disturbance;
    const auto rate = [&](const Input& acts) {
      return model_.rubbing_rate(model_.model.ahead(m, acts, kTickS));
    };
    const Input free = rate(beside);
    Mat<Robot::kInputs, Robot::kInputs> mobility;
    for (int i = 0; i < Robot::kInputs; ++i)
      mobility.col(i) = rate(beside + model_.input_of(Input::Unit(i))) - free;
    return drive + model_.input_of(coulomb_torque<Robot::kInputs>(
                       free, mobility, 1.0, Input::Constant(params_.friction.coulomb_u)));
  }

  void tick(std::size_t k) {
    const ShadowTick& t = ticks_[k];
    if (pipeline_ == nullptr) start(k);
    const bool drives = seeded_ && t.armed;
    if (!t.armed) seeded_ = false;
    if (k > 0) pipeline_->applied(net(ticks_[k - 1].u, motion_, disturbance_), !drives);
    Command command;
    command.arm = drives;
    const LoggedTick logged{t.now_ns, t.raw, 0};
    typename P::Result result;
    const auto keep = [&](const auto&, const auto&, const auto&, const auto&, const auto& r) { result = r; };
    runtime::LoopEnd end;
    runtime::run_tick(
        logged, *pipeline_, [&](std::int64_t, std::int64_t) { return command; }, keep, logged, &end);
    const auto health = pipeline_->estimators().health();
    motion_ = Model::start(result.x_hat, pipeline_->estimators().ekf());
    disturbance_ = pipeline_->estimators().ekf().disturbance();
    const bool armed = drives && result.arm_state == ArmState::kArmed;
    if (armed) judge(k);
    watch(k, result, health);
    if (armed && estimates_[k - 1].seeded_at != seeded_at_) ++out_.starts;
    if (!seeded_ && t.armed && k >= from_ + kBefore) {
      result.z.wheel_rate_rad_s = wheel_rate_rad_s(k);
      pipeline_->estimators().start_moving(smoothed_.tilt_rad[k], smoothed_.bias_rad_s[k], result.z);
      seeded_ = true;
      seeded_at_ = k;
    }
    if (drives && !armed && t.raw.valid != 0) {
      out_.refused |= result.reasons & ~kNotOurs;
      pipeline_.reset();
    }
  }

  /// Across the ticks around this one; at the log's end across those before it.
  Vec<Robot::kWheels> wheel_rate_rad_s(std::size_t k) const {
    const std::size_t last = std::min(k + kBefore / 2, ticks_.size() - 1);
    return (wheels_[last] - wheels_[last - kBefore]) / (kBefore * kTickS);
  }

  /// The smoother's tilt is surer than what a hand gives a robot that is armed.
  void start(std::size_t k) {
    auto& sigma = params_.estimators.ekf.filter.initial_variance;
    sigma.template head<Model::kAxes>() = smoothed_.tilt_variance[k].template head<Model::kAxes>();
    pipeline_ = std::make_unique<P>(params_);
    seeded_ = false;
    from_ = k;
    reasons_ = degraded_ = 0;
  }

  void judge(std::size_t k) {
    judged_[k] = true;
    out_.judged_s += kTickS;
    estimates_[k] = {motion_, disturbance_, seeded_at_};
    const auto& nis = pipeline_->estimators().ekf().row_nis();
    for (std::size_t i = 0; i < nis.size(); ++i)
      if (nis[i] > 0.0) out_.nis[Model::kRows[i]].add(nis[i]);
    if (k < seeded_at_ + kSettle) return;
    const Vec2 tilt = Model::tilt(estimates_[k].motion);
    const Vec2 error = tilt - smoothed_.tilt_rad[k];
    for (int i = 0; i < Model::kAxes; ++i)
      out_.tilt_error_rad[static_cast<std::size_t>(i)].push_back(error(i));
    if (std::isfinite(ticks_[k].own_tilt_rad))
      out_.own_tilt_error_rad.push_back(tilt.x() - ticks_[k].own_tilt_rad);
  }

  /// What is new among reasons and degraded modes.
  void watch(std::size_t k, const typename P::Result& t, const Health& health) {
    const bool fault = t.arm_state == ArmState::kFault;
    const std::uint32_t reasons = fault ? t.reasons & ~kNotOurs : 0;
    const std::uint32_t gaps = ticks_[k].raw.valid == 0 ? kWithoutImu | kWithoutEncoders : 0U;
    const std::uint32_t degraded = t.degraded & ~gaps;
    ShadowAlarm alarm;
    alarm.t_s = 1e-9 * static_cast<double>(ticks_[k].now_ns);
    const auto name = [&](const std::string& each) {
      alarm.hypothesis += (alarm.hypothesis.empty() ? "" : "+") + each;
    };
    for (const std::string& each : reason_names(reasons & ~reasons_)) name(each);
    for (const std::string& each : degraded_names(degraded & ~degraded_)) name(each);
    reasons_ = reasons;
    degraded_ = degraded;
    if (alarm.hypothesis.empty()) return;
    statistic(reasons, health, view(t.x_hat, params_.robot), &alarm);
    if (t.faults.decided) std::tie(alarm.ratio, alarm.bound) = std::tie(t.faults.ratio, t.faults.bound);
    out_.alarms.push_back(alarm);
  }

  /// Where one number decided, that number and its limit.
  void statistic(std::uint32_t reasons, const Health& h, const StateView& x, ShadowAlarm* alarm) const {
    const SafetyParams& p = params_.safety;
    alarm->ratio = alarm->bound = std::nan("");
    const auto is = [&](double value, double limit) {
      alarm->ratio = value;
      alarm->bound = limit;
    };
    if ((reasons & kTilt) != 0) is(x.theta_rad.head<2>().norm(), p.max_tilt_rad);
    if ((reasons & kEstimatorUnhealthy) != 0) is(x.normalized_innovation, p.max_innovation);
    if ((reasons & kEstimatorUnhealthy) != 0 && h.tilt_sigma_rad > p.max_tilt_sigma_rad)
      is(h.tilt_sigma_rad, p.max_tilt_sigma_rad);
    if ((reasons & kMotorFault) != 0) is(h.motor_error, p.max_motor_error);
    if ((reasons & kImuUntrusted) != 0 && h.bias_drift_rad_s > p.max_bias_drift_rad_s)
      is(h.bias_drift_rad_s, p.max_bias_drift_rad_s);
  }

  void predict() {
    for (std::size_t k = 1; k < ticks_.size(); ++k) {
      if (!judged_[k]) continue;
      Motion m = estimates_[k].motion;
      const Motion now = m;
      Input disturbance = estimates_[k].disturbance;
      const Vec2 rate = (smoothed_.tilt_rad[k] - smoothed_.tilt_rad[k - 1]) / kTickS;
      for (std::size_t h = 1; h <= 20; ++h) {
        const std::size_t then = k + h;
        if (then >= ticks_.size() || !judged_[then] || estimates_[then].seeded_at != estimates_[k].seeded_at)
          break;
        m = model_.model.ahead(m, net(ticks_[then - 1].u, m, disturbance) + disturbance, kTickS);
        disturbance *= model_.keep;
        if (h != 1 && h != 20) continue;
        Ahead& a = out_.ahead[h == 1 ? "5ms" : "100ms"];
        const double dt = static_cast<double>(h) * kTickS;
        const Vec2 tilt = smoothed_.tilt_rad[then] - smoothed_.tilt_rad[k];
        const Vec2 rolled = samples_[then].rolling_rad - samples_[k].rolling_rad;
        add(&a.model, Model::tilt(m) - Model::tilt(now) - tilt,
            Model::rolled(m) - Model::rolled(now) - rolled);
        add(&a.persistence, tilt, rolled);
        add(&a.constant_rate, dt * rate - tilt, dt * Model::rolling_rate(now) - rolled);
      }
    }
  }
  static void add(Ahead::Errors* e, const Vec2& tilt, const Vec2& wheel) {
    e->tilt.add(tilt.squaredNorm() / Model::kAxes);
    e->wheel.add(wheel.squaredNorm() / Model::kAxes);
  }

  /// Of samples in a row: the second difference of white noise has six times its variance.
  void measure_noise() {
    constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    for (std::size_t k = 2; k < ticks_.size(); ++k) {
      if (!judged_[k] || !samples_[k].imu_ok || !samples_[k - 1].imu_ok || !samples_[k - 2].imu_ok) continue;
      for (int i = 0; i < 3; ++i) {
        const auto second = [&](auto field) {
          return (samples_[k].*field)(i)-2.0 * (samples_[k - 1].*field)(i) + (samples_[k - 2].*field)(i);
        };
        const std::string axis = kNames[static_cast<std::size_t>(i)];
        out_.noise["gyro_" + axis + "_rad_s"].add(std::pow(second(&SmootherSample::gyro_rad_s), 2) / 6.0);
        out_.noise["accel_" + axis + "_m_s2"].add(std::pow(second(&SmootherSample::accel_m_s2), 2) / 6.0);
      }
    }
  }

  struct Estimated {
    Motion motion;
    Input disturbance;
    std::size_t seeded_at = 0;
  };

  typename P::Params params_;
  double radius_m_, imu_height_m_;
  std::vector<ShadowTick> ticks_;
  Model model_;
  std::vector<SmootherSample> samples_;
  std::vector<Vec<Robot::kWheels>> wheels_;
  Smoothed smoothed_;
  std::vector<bool> judged_;
  std::vector<Estimated> estimates_;
  std::unique_ptr<P> pipeline_;
  bool seeded_ = false;
  std::size_t seeded_at_ = 0, from_ = 0;
  Motion motion_ = Motion::Zero();
  Input disturbance_ = Input::Zero();
  std::uint32_t reasons_ = 0, degraded_ = 0;
  Shadow out_;
};

}  // namespace equipoise::app
