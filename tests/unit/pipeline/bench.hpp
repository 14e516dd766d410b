// The pipeline between stages that do as a script tells and keep what they were given: two wheels, the sum
// and the difference of whose drives are the inputs.
#pragma once

#include <algorithm>
#include <vector>

#include "equipoise/pipeline.hpp"
#include "equipoise/runtime/loop.hpp"

namespace equipoise::bench {

struct Parameters {};

class Kinematics {
 public:
  explicit Kinematics(const Parameters& /*p*/) noexcept {}
  Vec<2> wheels_from_axes(const Vec<2>& u) const noexcept { return {u(0) + u(1), u(0) - u(1)}; }
  Vec<2> axes_from_wheels(const Vec<2>& w) const noexcept { return {(w(0) + w(1)) / 2, (w(0) - w(1)) / 2}; }
  Vec<2> wheels_of_turn(double yaw_rate_rad_s) const noexcept { return {yaw_rate_rad_s, -yaw_rate_rad_s}; }
  /// The first input goes first.
  Vec<2> allocate(const Vec<2>& u, double limit) const noexcept {
    return Vec<2>::Constant(std::clamp(u(0), -limit, limit));
  }
  Vec<2> friction_input(const FrictionCompensation& c, const Vec<2>& rates) const noexcept {
    return axes_from_wheels(c.compensate(rates));
  }
};

struct Estimate {
  double tilt_rad = 0.0;
  double innovation = 0.0;
};

inline StateView view(const Estimate& x, const Parameters& /*p*/) noexcept {
  StateView v;
  v.theta_rad.x() = x.tilt_rad;
  v.normalized_innovation = x.innovation;
  return v;
}

struct Robot {
  static constexpr int kWheels = 2;
  static constexpr int kInputs = 2;
  using Parameters = bench::Parameters;
  using Kinematics = bench::Kinematics;
  using Estimate = bench::Estimate;
  using Sample = Measurement<kWheels>;
};

struct Update {
  Measurement<2> z;
  Vec<2> u = Vec<2>::Zero();
  bool held = false;
};

struct Script {
  bool isolates = true;
  Estimate x_hat{};
  EstimatorHealth<2> health{};
  Vec<2> u = Vec<2>::Zero();  // the feedback's

  std::vector<Update> updates{};    // of the estimators
  std::vector<double> resets{};     // of the reference: tilt
  std::vector<Command> commands{};  // to the reference
};

class Estimators {
 public:
  struct Params {
    Script* script;
  };
  explicit Estimators(const Params& params) : script_(params.script) {}
  bool isolates() const noexcept { return script_->isolates; }
  bool reads_attitude() const noexcept { return false; }
  EstimatorHealth<2> health() const noexcept { return script_->health; }
  const Estimate& update(const Measurement<2>& z, const Vec<2>& u, bool held) noexcept {
    script_->updates.push_back({z, u, held});
    return script_->x_hat;
  }

 private:
  Script* script_;
};

class ReferenceStage {
 public:
  struct Reference {};
  using Params = Estimators::Params;
  explicit ReferenceStage(const Params& params) : script_(params.script) {}
  void reset(const Estimate& x) noexcept { script_->resets.push_back(x.tilt_rad); }
  Reference update(const Command& command, const Estimate& /*x*/) noexcept {
    script_->commands.push_back(command);
    return {};
  }

 private:
  Script* script_;
};

template <bool SharesDuty>
class Feedback {
 public:
  static constexpr bool kSharesDuty = SharesDuty;
  using Params = Estimators::Params;
  explicit Feedback(const Params& params) : script_(params.script) {}
  Vec<2> update(const ReferenceStage::Reference& /*ref*/) const noexcept { return script_->u; }

 private:
  Script* script_;
};

/// Hardware and supervisor of one tick.
struct Boundary {
  const RawSample& raw;
  std::int64_t now_ns;
  std::uint32_t inhibit;
  int wait_tick(std::int64_t* now) const noexcept {
    *now = now_ns;
    return 0;
  }
  RawSample read() const noexcept { return raw; }
  int write(const MotorCommand& /*command*/) const noexcept { return 0; }
  std::uint32_t begin(std::int64_t /*now_ns*/, const RawSample& /*raw*/) const noexcept { return inhibit; }
  void end(bool /*driven*/, int /*write_error*/) const noexcept {}
};

/// Ticks of a robot that is well; a test changes what it is about.
template <class R = Robot, bool SharesDuty = false>
class Bench {
 public:
  using P = Pipeline<R, Estimators, ReferenceStage, Feedback<SharesDuty>>;
  using Result = typename P::Result;

  static typename P::Params usual() {
    typename P::Params p;
    p.motor.bridge = BridgeType::kDriveBrake;  // linear
    p.motor.nominal_V = 8.0;
    p.motor.torque_constant_N_m_A = 0.1;  // 80 rad/s without load
    p.calibration.battery_V_per_count = 1.0;
    p.calibration.battery_offset_V = 0.0;
    p.calibration.encoder_counts_per_rev = 2.0 * kPi * 100.0;  // a count is 0.01 rad
    p.safety.max_arm_rate_rad_s = 100.0;
    return p;
  }

  /// `isolates`: the estimator tells encoders apart, so that the pipeline shakes no wheel.
  explicit Bench(typename P::Params p = usual(), bool isolates = true)
      : script{isolates}, pipeline(with_script(p, &script)) {
    raw.valid = RIO_IMU | RIO_ENCODERS | RIO_BATTERY;
    raw.accel_counts[2] = 4096.0;
    raw.battery_counts = 8.0;
    command.arm = true;
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  /// A tick. `missed`: ticks that the loop has slept through before. `inhibit`: what stands against the
  /// motors.
  Result step(int missed = 0, std::uint32_t inhibit = 0) {
    now_ns_ += (1 + missed) * std::int64_t{5'000'000};
    raw.t_ns = now_ns_;
    for (std::size_t i = 0; i < 3; ++i) raw.gyro_counts[i] += gyro_noise[i];
    raw.accel_counts[0] += accel_noise;
    for (double& noise : gyro_noise) noise = -noise;
    accel_noise = -accel_noise;
    script.updates.clear();
    script.commands.clear();
    script.resets.clear();
    Boundary boundary{raw, now_ns_, inhibit};
    runtime::LoopEnd end;
    Result result;
    runtime::run_tick(
        boundary, pipeline, [this](std::int64_t, std::int64_t) { return command; },
        [&result](std::int64_t, std::int64_t, const RawSample&, const Command&, const Result& t) {
          result = t;
        },
        boundary, &end);
    return result;
  }
  Result steps(int count) {
    Result t;
    for (int i = 0; i < count; ++i) t = step();
    return t;
  }
  void without(unsigned valid) { raw.valid &= ~valid; }

  Script script;
  P pipeline;
  RawSample raw{};
  Command command;
  std::array<double, 3> gyro_noise{1.0, 1.0, 1.0};  // counts; an axis that stands still is broken
  double accel_noise = 1.0;

 private:
  static typename P::Params with_script(typename P::Params p, Script* script) {
    p.estimators.script = p.reference.script = p.feedback.script = script;
    return p;
  }

  std::int64_t now_ns_ = 1'000'000'000;
};

}  // namespace equipoise::bench
