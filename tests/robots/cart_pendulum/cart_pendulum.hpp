// A third robot, to prove that a robot is a folder: a pendulum on a cart with four driven wheels, in one
// plane. Frames: x forward, z up; the pendulum carries the IMU at its pivot and leans about y, positive
// forward. The encoders sit on the cart: wheel angle = travel / radius. Estimator, reference and feedback in
// their simplest form. RT-safe.
#pragma once

#include <array>

#include "equipoise/estimate/health.hpp"
#include "equipoise/estimate/rest_tilt.hpp"
#include "equipoise/pipeline.hpp"

namespace equipoise {

struct CartPendulumParameters {
  double cart_mass_kg = 0.6;
  double pendulum_mass_kg = 0.4;
  double com_height_m = 0.12;
  double inertia_kg_m2 = 0.002;
  double wheel_radius_m = 0.03;
};

class CartPendulumKinematics {
 public:
  explicit CartPendulumKinematics(const CartPendulumParameters& /*p*/) noexcept {}
  Vec<4> wheels_from_axes(const Vec<1>& u) const noexcept { return Vec<4>::Constant(u(0)); }
  Vec<4> wheels_of_turn(double /*yaw_rate_rad_s*/) const noexcept { return Vec<4>::Zero(); }
  Vec<4> allocate(const Vec<1>& u, double limit) const noexcept {
    return wheels_from_axes(u).cwiseMax(-limit).cwiseMin(limit);
  }
  Vec<1> axes_from_wheels(const Vec<4>& w) const noexcept { return Vec<1>::Constant(w.mean()); }
  template <class Compensation>
  Vec<1> friction_input(const Compensation& c, const Vec<4>& rates) const noexcept {
    return axes_from_wheels(c.compensate(rates));
  }
};

struct CartPendulumEstimate {
  double lean = 0.0;
  double lean_rate = 0.0;
  double wheel = 0.0;
  double wheel_rate = 0.0;
};

struct CartPendulum {
  static constexpr int kWheels = 4;
  static constexpr int kInputs = 1;
  using Parameters = CartPendulumParameters;
  using Kinematics = CartPendulumKinematics;
  using Estimate = CartPendulumEstimate;
  using Sample = Measurement<kWheels>;
};

inline StateView cart_pendulum_view(const CartPendulumEstimate& x, double radius_m) noexcept {
  StateView v;
  v.theta_rad.y() = x.lean;
  v.omega_B_rad_s.y() = x.lean_rate;
  v.phi_rad.x() = x.wheel;
  v.phi_dot_rad_s.x() = x.wheel_rate;
  v.position_W_m.x() = radius_m * x.wheel;
  return v;
}
inline StateView view(const CartPendulumEstimate& x, const CartPendulumParameters& p) noexcept {
  return cart_pendulum_view(x, p.wheel_radius_m);
}

inline bool recall(const StateView&, CartPendulumEstimate*) noexcept { return false; }

inline StateErrors errors(const StateView& x, const StateView& truth,
                          const CartPendulumParameters&) noexcept {
  const double lean = x.theta_rad.y() - truth.theta_rad.y();
  const double rate = x.phi_dot_rad_s.x() - truth.phi_dot_rad_s.x();
  return {lean * lean, rate * rate, 1};
}

class CartPendulumEstimators {
 public:
  enum class Id : int { kComplementary, kTruth };
  static constexpr std::array<const char*, 2> kNames{"complementary", "truth"};
  static constexpr std::size_t kCount = kNames.size();
  struct Params {
    Id active = Id::kComplementary;
    bool compare = false;
    double gyro_weight = 0.995;
  };

  explicit CartPendulumEstimators(const Params& params) : p_(params) {}

  void observe_truth(const CartPendulumEstimate& truth) noexcept { of(Id::kTruth) = truth; }
  bool runs(Id id) const noexcept { return id == p_.active || p_.compare; }
  const CartPendulumEstimate& estimate(Id id) const noexcept {
    return estimates_[static_cast<std::size_t>(id)];
  }

  /// A complementary filter has no opinion of its encoders.
  bool isolates() const noexcept { return false; }
  bool reads_attitude() const noexcept { return false; }
  EstimatorHealth<CartPendulum::kWheels> health() const noexcept { return {}; }

  const CartPendulumEstimate& update(const CartPendulum::Sample& z, const Vec<1>&, bool held) noexcept {
    CartPendulumEstimate& x = of(Id::kComplementary);
    if (z.encoders_ok) {
      x.wheel = z.wheel_angle_rad.mean();
      x.wheel_rate = z.wheel_rate_rad_s.mean();
    }
    if (z.imu_ok && held) {
      x.lean = rest_.update(z.accel_B_m_s2).y();
      x.lean_rate = z.gyro_B_rad_s.y();
    } else if (z.imu_ok) {
      const double gravity = std::atan2(z.accel_B_m_s2.x(), -z.accel_B_m_s2.z());
      x.lean_rate = z.gyro_B_rad_s.y();
      x.lean = p_.gyro_weight * (x.lean + kTickS * x.lean_rate) + (1.0 - p_.gyro_weight) * gravity;
    }
    return estimate(p_.active);
  }

 private:
  CartPendulumEstimate& of(Id id) noexcept { return estimates_[static_cast<std::size_t>(id)]; }

  Params p_;
  RestTilt rest_;
  std::array<CartPendulumEstimate, kCount> estimates_{};
};

struct CartPendulumReference {
  CartPendulumEstimate wanted;
  CartPendulumEstimate error;  // wanted minus estimate
};

inline StateView view(const CartPendulumReference& ref, const CartPendulumParameters& p) noexcept {
  return cart_pendulum_view(ref.wanted, p.wheel_radius_m);
}

class CartPendulumReferenceStage {
 public:
  using Reference = CartPendulumReference;
  struct Params {
    double max_acceleration_m_s2 = 0.3;
    double wheel_radius_m = 0.03;
  };
  explicit CartPendulumReferenceStage(const Params& params) : p_(params) {}

  void reset(const CartPendulumEstimate& x) noexcept { wanted_ = {0.0, 0.0, x.wheel, 0.0}; }

  CartPendulumReference update(const Command& command, const CartPendulumEstimate& x) noexcept {
    const double step = p_.max_acceleration_m_s2 * kTickS / p_.wheel_radius_m;
    const double ahead = command.velocity_W_m_s.x() / p_.wheel_radius_m - wanted_.wheel_rate;
    wanted_.wheel_rate += std::fmax(-step, std::fmin(step, ahead));
    wanted_.wheel += kTickS * wanted_.wheel_rate;
    return {wanted_, {-x.lean, -x.lean_rate, wanted_.wheel - x.wheel, wanted_.wheel_rate - x.wheel_rate}};
  }

 private:
  Params p_;
  CartPendulumEstimate wanted_;
};

class CartPendulumFeedback {
 public:
  static constexpr bool kSharesDuty = true;
  struct Params {
    double lean = 0.0;
    double wheel = 0.0;
    double lean_rate = 0.0;
    double wheel_rate = 0.0;
  };
  explicit CartPendulumFeedback(const Params& params) : k_(params) {}

  Vec<1> update(const CartPendulumReference& ref) const noexcept {
    const CartPendulumEstimate& e = ref.error;
    return Vec<1>::Constant(
        -(k_.lean * e.lean + k_.lean_rate * e.lean_rate + k_.wheel * e.wheel + k_.wheel_rate * e.wheel_rate));
  }

 private:
  Params k_;
};

using CartPendulumPipeline =
    Pipeline<CartPendulum, CartPendulumEstimators, CartPendulumReferenceStage, CartPendulumFeedback>;

}  // namespace equipoise
