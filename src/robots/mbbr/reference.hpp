// References and state errors of the MBBR. In: command, estimate -> out: the errors that the feedback
// multiplies. Commands are slew-limited and integrated to phi_ref and theta_z_ref, [T] (6.11); the outer loop
// turns the ball rate error into a lean, (6.13) with a plus sign (lean towards the travel); its rate is a
// backward difference, (6.12); the rate error that is fed back is low-pass filtered, section 6.2.1. The two
// filters run on vectors in the inertial frame unless `frame` says `yaw`, where they lag by the spin.
// RT-safe.
#pragma once

#include <algorithm>
#include <limits>

#include "equipoise/control/gain_schedule.hpp"
#include "equipoise/control/governor.hpp"
#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

enum class RateFeedback { kBody, kEuler };
enum class FilterFrame { kInertial, kYaw };

/// Columns of the schedule over |yaw rate|.
struct MbbrReferenceParams {
  enum Column : std::size_t { kSlcGain, kSlcPole, kLowPassRadS, kColumns };
  GainSchedule<kColumns> schedule;  // at: yaw rate, rad/s; [T] Table 6.3 and section 6.2.1
  double slc_unit = 0.000985;       // rad per rad/s, (6.13)
  double slc_sign = 1.0;            // -1 reproduces (6.13) as printed
  RateFeedback rate_feedback = RateFeedback::kBody;
  FilterFrame frame = FilterFrame::kInertial;
  double max_acceleration_m_s2 = 0.5;  // of the velocity command
  double max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  double max_yaw_acceleration_rad_s2 = 2.0 * kPi;
  double floor_yaw_acceleration_rad_s2 =
      std::numeric_limits<double>::infinity();                                  // that does not spin the ball
  double feasible_acceleration_m_s2 = std::numeric_limits<double>::infinity();  // of this robot
  DutyBudget budget;
  double ball_radius_m = 0.032;

  double yaw_acceleration_rad_s2() const noexcept {
    return std::min(max_yaw_acceleration_rad_s2, floor_yaw_acceleration_rad_s2);
  }
};

struct MbbrReference {
  Vec2 theta_xy = Vec2::Zero();        // lean, yaw frame
  Vec2 rate_xy = Vec2::Zero();         // its rate: body rates or Euler rates, as configured
  Vec2 phi = Vec2::Zero();             // inertial
  Vec2 phi_ddot_star = Vec2::Zero();   // inertial acceleration, resolved in the yaw frame
  Vec2 phi_dddot_star = Vec2::Zero();  // its inertial rate, resolved alike
  Vec2 phi_dot_star = Vec2::Zero();    // yaw frame
  double theta_z = 0.0;
  double yaw_rate = 0.0;
  // Errors, reference minus estimate, yaw frame, [T] (6.6)-(6.9)
  Vec2 d_theta = Vec2::Zero();
  Vec2 d_rate = Vec2::Zero();
  Vec2 d_phi = Vec2::Zero();
  Vec2 d_phi_dot = Vec2::Zero();  // low-pass filtered
  Vec2 d_phi_dot_unfiltered = Vec2::Zero();
  double d_theta_z = 0.0;
  double d_yaw_rate = 0.0;
};

/// Robot-neutral view of where the robot should be.
StateView view(const MbbrReference& ref, const MbbrParameters& p) noexcept;

class MbbrReferenceStage {
 public:
  using Params = MbbrReferenceParams;
  using Reference = MbbrReference;
  explicit MbbrReferenceStage(const MbbrReferenceParams& params) : p_(params) {}

  /// Start from where the robot is: called while the motors are off.
  void reset(const MbbrEstimate& x_hat) noexcept;

  MbbrReference update(const Command& command, const MbbrEstimate& x_hat) noexcept;

 private:
  MbbrReferenceParams p_;
  Turn heading_zero_{0.0};  // heading at the last heading reset
  SmoothVelocity<2> drive_W_;
  double yaw_rate_ = 0.0;
  Vec2 phi_ref_ = Vec2::Zero();
  double theta_z_ref_ = 0.0;
  Vec2 lean_ = Vec2::Zero();           // in p_.frame
  Vec2 low_pass_ = Vec2::Zero();       // in p_.frame
  Vec2 lean_previous_ = Vec2::Zero();  // inertial for body rates, yaw frame for Euler rates
};

}  // namespace equipoise
