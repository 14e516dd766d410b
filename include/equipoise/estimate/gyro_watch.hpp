// Does the gyro tell the truth? A rate that no torque explains is left out in its tick; where it is the
// expected one but for a flipped axis or two swapped ones, the gyro lies. What it saw within a few ticks must
// be what the wheels saw: torque turns body and wheels in a known ratio, and about some axes the wheels give
// the rate itself. It lies where that agrees with an axis flipped or two swapped and not as it is, and where
// no single encoder explains what they disagree about, and where it spins while all wheels stand still. A
// push agrees with neither; the accelerometer feels it. A bias that jumps is taken off. In: Measurement,
// rates expected, what the filter knows -> out: the measurement without what lies, and whether the gyro is
// trusted. Limits: chosen on robots 1 to 8 and 300 to 340 of the population. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "equipoise/estimate/bias_jump.hpp"
#include "equipoise/estimate/gyro_history.hpp"
#include "equipoise/estimate/gyro_lie.hpp"
#include "equipoise/estimate/gyro_noise.hpp"
#include "equipoise/estimate/gyro_witness.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

template <int Wheels>
class GyroWatch {
 public:
  using Sample = Measurement<Wheels>;

  explicit GyroWatch(const GyroWatchParams<Wheels>& params) : p_(params) {
    for (Odds& odds : swapped_) odds.setZero();
  }

  void reset() noexcept { *this = GyroWatch(GyroWatchParams<Wheels>(p_)); }

  /// Leaves out what cannot be; the expected rate stands in. `u` acted since the last sample.
  void screen(Sample& z, const Vec3& expected_rad_s, const Vec<Wheels>& u) noexcept {
    left_out_ = false;
    const Vec<Wheels> u_before = std::exchange(u_before_, u_);
    u_ = u;
    if (!z.imu_ok) {
      jump_.drop();
      return;
    }
    z.gyro_B_rad_s -= jump_.bias_rad_s();
    said_rad_s_ = z.gyro_B_rad_s;
    noise_.hear(z.gyro_B_rad_s);
    if (noise_.too_much()) trusted_ = false;
    const Vec3 step = z.gyro_B_rad_s - expected_rad_s;
    const bool odd = step.squaredNorm() > kOdd_rad_s * kOdd_rad_s;
    const bool jolt = z.accel_B_m_s2.squaredNorm() > kMaxAccel_m_s2 * kMaxAccel_m_s2;
    const bool whole = z.gyro_axis_ok[0] && z.gyro_axis_ok[1] && z.gyro_axis_ok[2];
    if (odd || jolt || !whole || suspected_) leave_out(z, step, expected_rad_s, odd, jolt);
    const Vec3 step_before = std::exchange(step_before_, step);
    const Vec3 jump = step - step_before;
    const double turning = kShakes_s * z.gyro_B_rad_s.z();
    if (jump_.examining() || jump.cwiseProduct(p_.per_jump).squaredNorm() > 1.0 + turning * turning)
      examine(z, expected_rad_s, jump, step_before, u_before);
  }

  /// What the gyro says, without axes that are left out, against all wheels, also one that is blamed already:
  /// should the gyro explain more, it was the wrong one.
  void compare(const Sample& z, const GyroWitness<Wheels>& witness) noexcept {
    jump_.feel(witness.accel_nis);
    carried_rad_s2_ = witness.carried_rad_s2;
    accel_nis_ += kAccelMean * (std::min(witness.accel_nis, kLargest) - accel_nis_);
    bool returns = false;  // an axis: what stood in for it is no sample
    for (std::size_t i = 0; i < 3; ++i) returns = returns || (z.gyro_axis_ok[i] && !examined_[i]);
    examined_ = z.gyro_axis_ok;
    const Vec3 said_rad_s = evidence_ > 0.0 && left_out_ ? heard_out(z) : z.gyro_B_rad_s;
    if (!z.imu_ok || !z.encoders_ok || z.ticks > 1 || returns) {
      history_.forget();
      evidence_ = 0.0;
      for (Odds& odds : swapped_) odds = Odds::Zero();
      contradicted_ = spins_held_ = 0;
      if (z.ticks > kStall) settling_ = kSettling;
      return;
    }
    settling_ = std::max(settling_ - 1, 0);
    history_.add(said_rad_s, z.wheel_angle_rad);
    const bool calm = accel_nis_ < kPushed && settling_ == 0;
    const bool examined = history_.samples() >= History::span(kHalf) && calm;
    const Verdict verdict = examined ? judge(witness) : Verdict{};
    evidence_ = verdict.lies ? evidence_ + std::min(verdict.surprise, kMostOfATick) : 0.0;
    contradicted_ = verdict.unexplained > kContradiction ? contradicted_ + 1 : 0;
    if (contradicted_ >= kContradicted) trusted_ = false;
    const bool held =
        p_.max_held_slip_rad_s > 0.0 && std::abs(witness.held_slip_rad_s) > p_.max_held_slip_rad_s;
    spins_held_ = held ? spins_held_ + 1 : 0;
    if (spins_held_ >= kContradicted) trusted_ = false;
    const bool blames_wheel = witness.blamed_wheel >= 0;
    if (evidence_ > (blames_wheel ? kProofOfAnError : kProof)) condemn(nearest_);
    if (history_.samples() == History::kKept && calm && !witness.wheel_stands) weigh(witness);
    blamed_ = blames_wheel ? std::min(blamed_ + 1, kSoon) : 0;
    if (blames_wheel && blamed_ < kSoon &&
        swapped_[static_cast<std::size_t>(witness.blamed_wheel)].maxCoeff() > kRather)
      trusted_ = false;
  }

  bool trusted() const noexcept { return trusted_; }
  /// For longer than noise of a count or two repeats itself.
  bool left_out() const noexcept { return ticks_out_ >= kReported; }
  /// What its bias has jumped by is taken off what it says.
  bool bias_jumped() const noexcept { return jump_.jumps() > 0; }
  int bias_jumps() const noexcept { return jump_.jumps(); }

 private:
  // Swapped axes look like an encoder that counts wrongly within so few ticks; twice as many tell them apart.
  static constexpr std::size_t kSlowHalf = 6;
  using History = GyroHistory<Wheels, kSlowHalf>;
  static constexpr std::size_t kHalf = History::kSum;  // so many ticks are held against as many before
  static constexpr double kSurprise = 60.0;            // squared, in sigmas
  static constexpr double kMostOfATick = 120.0;        // a tick more is needed, whatever the last one says
  static constexpr double kProof = 239.0;          // sum over consecutive ticks: two of the most and a little
  static constexpr double kContradiction = 150.0;  // that no encoder explains; sound robots stay below 80
  static constexpr int kContradicted = 3;          // ticks
  static constexpr double kProofOfAnError = 500.0;
  static constexpr double kMostOfAWeighing = 100.0;
  static constexpr double kDoubt = 4.0;      // a tick, for the encoder
  static constexpr double kRather = 30.0;    // swapped axes; lying encoders of robots 301 to 350: below 18
  static constexpr int kSoon = 400;          // ticks; by then a robot with a swapped gyro lies
  static constexpr double kExplains = 0.25;  // of the surprise is left with another gyro
  static constexpr double kScale = 0.05;     // error of a rate by the wheels: radii, rollers
  static constexpr double kMount = 0.015;    // rad, of the IMU: what an axis sees of the others
  static constexpr double kOdd_rad_s = 1.0;  // of a rate in a tick; hard pushes: 0.7
  static constexpr double kMirrors = 0.2;    // of it is left with another gyro
  static constexpr double kShakes_s = 0.05;  // a turning robot jolts itself: at 3 Hz 1.4 times the jump
  static constexpr double kExplainsAJump = 0.5;  // of it
  static constexpr double kOfNoise = 4.0;        // a jump is larger
  static constexpr int kMirrored = 3;            // ticks
  static constexpr int kMaxImpossible = 3;       // samples in a row
  static constexpr int kGone = 6;  // an axis that was so wrong for so long is not believed when it slows down
  // Ticks without an axis that balances, while it is wrong by so much: a quiet gyro on a robot that stands
  // quite still repeats itself, and harms nobody.
  static constexpr int kMaxWithout = 4;
  static constexpr double kMoves_rad_s = 0.05;
  static constexpr int kMostJumps = 3;  // since reset: there and back, and once more
  static constexpr std::size_t kBeforeAJump = BiasJump::kTicks + BiasJump::kMean;  // samples
  static constexpr int kReported = 4;                                              // ticks
  static constexpr double kMaxAccel_m_s2 = 4.0 * kGravity_m_s2;
  static constexpr int kStall = 4;  // ticks: the robot is caught with full torque, and its ball slips
  static constexpr int kSettling = 20;
  static constexpr double kAccelMean = 0.2;  // about six ticks
  static constexpr double kPushed = 10.0;
  static constexpr double kLargest = 1000.0;

  /// Those that swap the vertical with another, which is what the encoders are compared with.
  static constexpr std::array<std::size_t, 4> kTakenForAnEncoder{4, 5, 7, 8};
  using Odds = Vec<static_cast<int>(kTakenForAnEncoder.size())>;

  /// An axis that balances does not lie twice; others can be done without.
  void condemn(const GyroLie& lie) noexcept {
    suspected_ = true;
    const auto i = static_cast<std::size_t>(lie.i);
    const auto k = static_cast<std::size_t>(lie.k);
    if (p_.balances[i] || p_.balances[k]) trusted_ = false;
    away_[i] = away_[k] = kGone;
  }

  Vec3 believed(const Sample& z, const Vec3& expected_rad_s) const noexcept {
    Vec3 rate = expected_rad_s;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      if (z.gyro_axis_ok[i] && away_[i] < kGone) rate(axis) = z.gyro_B_rad_s(axis);
    }
    return rate;
  }

  /// A gyro that seems to lie is heard to the end: an axis that got impossible meanwhile is the best witness.
  Vec3 heard_out(const Sample& z) noexcept {
    Vec3 rate = z.gyro_B_rad_s;
    for (std::size_t i = 0; i < 3; ++i) {
      if (away_[i] == 0) continue;
      rate(static_cast<int>(i)) = said_rad_s_(static_cast<int>(i));
      examined_[i] = true;
    }
    return rate;
  }

  bool mirrors(const Vec3& gyro_rad_s, const Vec3& expected_rad_s) noexcept {
    const double as_is = (gyro_rad_s - expected_rad_s).norm();
    if (!(as_is > kOdd_rad_s)) return false;
    return left_with_a_lie(gyro_rad_s, expected_rad_s) < kMirrors * as_is;
  }

  /// Of the difference, with the lie taken back that explains most of it.
  double left_with_a_lie(const Vec3& gyro_rad_s, const Vec3& expected_rad_s) noexcept {
    double least = kLargest;
    for (const GyroLie& lie : kGyroLies) {
      const double left = (lie(gyro_rad_s) - expected_rad_s).norm();
      if (left < least) nearest_ = lie;
      least = std::min(least, left);
    }
    return least;
  }

  /// One wheel's encoder may lie instead: what it says is free then.
  double with_another_wheel(const Vec3& left, const Vec3& sigma_rad_s, int wheel) const noexcept {
    const Vec3 a = p_.from_wheels.col(wheel).cwiseQuotient(sigma_rad_s);
    const double share = a.dot(left);
    return left.squaredNorm() - share * share / std::max(a.squaredNorm(), 1e-12);
  }

  /// Of the latest ticks, and what changed since as many before.
  struct Seen {
    Vec3 mean;  // by the gyro
    Vec3 change;
    Vec3 by_wheels;  // change
    Vec3 rate;       // by the wheels
  };

  template <std::size_t Ticks>
  Seen seen(const GyroWitness<Wheels>& witness) const noexcept {
    const auto span = history_.template latest<Ticks>();
    constexpr double half_s = static_cast<double>(Ticks) * kTickS;
    Seen s;
    s.mean = span.mean_rad_s;
    s.change = span.change_rad_s;
    s.by_wheels =
        p_.from_wheels * (1.0 / half_s * span.turned_more_rad - half_s * witness.carried_rad_s2).eval();
    s.rate = witness.rate_rad_s;
    s.rate.z() += 1.0 / half_s * p_.yaw_from_wheels.dot(span.turned_rad);
    return s;
  }

  void leave_out(Sample& z, const Vec3& step, const Vec3& expected_rad_s, bool odd, bool jolt) noexcept {
    mirrored_ = odd && mirrors(believed(z, expected_rad_s), expected_rad_s) ? mirrored_ + 1 : 0;
    if (mirrored_ >= kMirrored) condemn(nearest_);
    const int wrong = static_cast<int>((step.array().abs() > p_.max_step_rad_s.array()).count());
    impossible_ = (wrong > 1 && mirrored_ == 0) || jolt ? impossible_ + 1 : 0;
    if (impossible_ > kMaxImpossible) trusted_ = false;
    suspected_ = true;
    if (impossible_ > 0) {
      z.imu_ok = false;
      return;
    }
    bool needed = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      bool& ok = z.gyro_axis_ok[i];
      int& away = away_[i];
      away = std::abs(step(axis)) > p_.max_step_rad_s(axis) || away >= kGone ? std::min(away + 1, kGone) : 0;
      ok = ok && away == 0 && mirrored_ == 0;  // the filter is kept clean of it while it is examined
      if (ok) continue;
      z.gyro_B_rad_s(axis) = expected_rad_s(axis);
      left_out_ = true;
      needed = needed || (p_.balances[i] && std::abs(step(axis)) > kMoves_rad_s);
    }
    ticks_out_ = left_out_ ? ticks_out_ + 1 : 0;
    without_ = needed ? without_ + 1 : 0;
    if (without_ > kMaxWithout) trusted_ = false;
    suspected_ = left_out_;  // what counts ticks in a row is back at zero
  }

  /// Has it jumped? Not where a lie or a torque explains it, nor where the gyro was further off before or is
  /// suspected already.
  void examine(Sample& z, const Vec3& expected_rad_s, const Vec3& jump_rad_s, const Vec3& step_before_rad_s,
               const Vec<Wheels>& u_before) noexcept {
    const Vec3& before_rad_s = history_.gyro_rad_s();
    const auto explained = [&] {
      const double size = jump_rad_s.norm();
      const auto by = [&](const Vec<Wheels>& du) {
        return jump_rad_s.dot(p_.by_torque * du) > kExplainsAJump * size * size;
      };
      return size < kOfNoise * noise_.rad_s() || size < step_before_rad_s.norm() || by(u_ - u_before_) ||
             by(u_before_ - u_before) ||
             left_with_a_lie(z.gyro_B_rad_s, before_rad_s) < kExplainsAJump * size;
    };
    if (!z.imu_ok || left_out_ || history_.samples() < kBeforeAJump || evidence_ > 0.0 || contradicted_ > 0 ||
        (!jump_.examining() && explained())) {
      jump_.drop();
      return;
    }
    if (!jump_.examine(z.gyro_B_rad_s, before_rad_s, jump_rad_s, p_.sigma_rad_s,
                       [&] { return changed_by_wheels(z); }))
      return;
    z.gyro_B_rad_s = expected_rad_s;
    z.gyro_axis_ok.fill(false);
    if (!jump_.examining()) history_.forget();  // what stood in for the gyro is no sample
    if (jump_.jumps() > kMostJumps) trusted_ = false;
  }

  /// As the wheels see it, of the three ticks up to `z` against the three before the gyro may have jumped.
  Vec3 changed_by_wheels(const Sample& z) const noexcept {
    constexpr double kMean_s = BiasJump::kMean * kTickS;
    constexpr double kApart_s = BiasJump::kTicks * kTickS;
    const Vec<Wheels> turned = history_.turned_more_rad(z.wheel_angle_rad, BiasJump::kMean, BiasJump::kTicks);
    return p_.from_wheels * (turned / kMean_s - kApart_s * carried_rad_s2_);
  }

  /// Gyro against wheels, squared, in sigmas.
  double misfit(const Vec3& change, const Vec3& mean, const Seen& s, const Vec3& sigma_rad_s) const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      if (!examined_[i]) continue;
      const double left = p_.by_rate[i] ? mean(axis) - s.rate(axis) : change(axis) - s.by_wheels(axis);
      const double sigma =
          p_.by_rate[i] ? p_.rate_sigma_rad_s(axis) + kScale * std::abs(s.rate(axis)) + kMount * mean.norm()
                        : sigma_rad_s(axis);
      sum += left * left / (sigma * sigma);
    }
    return sum;
  }

  /// Is it rather the gyro than the encoder? Also before an encoder is blamed: a robot that is balanced with
  /// the wrong sensors hardly turns its wheels later.
  void weigh(const GyroWitness<Wheels>& witness) noexcept {
    if (p_.slow_sigma_rad_s.isZero(0.0) || !examined_[0] || !examined_[1] || !examined_[2]) return;
    const Seen s = seen<kSlowHalf>(witness);
    const double as_is = misfit(s.change, s.mean, s, p_.slow_sigma_rad_s);
    if (as_is <= kDoubt && !weighs_) return;  // nor would it be more with what follows
    Odds lies;
    for (std::size_t k = 0; k < kTakenForAnEncoder.size(); ++k) {
      const GyroLie& lie = kGyroLies[kTakenForAnEncoder[k]];
      lies(static_cast<int>(k)) = misfit(lie(s.change), lie(s.mean), s, p_.slow_sigma_rad_s);
    }
    lies = lies.cwiseMin(kMostOfAWeighing);
    const Vec3 left = (s.change - s.by_wheels).cwiseQuotient(p_.slow_sigma_rad_s);
    weighs_ = false;
    for (int i = 0; i < Wheels; ++i) {
      const double encoder = std::min(as_is, with_another_wheel(left, p_.slow_sigma_rad_s, i));
      Odds& odds = swapped_[static_cast<std::size_t>(i)];
      odds = (odds + Odds::Constant(std::min(encoder, kMostOfAWeighing) - kDoubt) - lies).cwiseMax(0.0);
      weighs_ = weighs_ || odds.maxCoeff() > 0.0;
    }
  }

  struct Verdict {
    double surprise = 0.0;     // squared, in sigmas
    bool lies = false;         // it would be none with a lie taken back
    double unexplained = 0.0;  // is left of it with any encoder free
  };

  Verdict judge(const GyroWitness<Wheels>& witness) noexcept {
    const Seen s = seen<kHalf>(witness);
    const double as_is = misfit(s.change, s.mean, s, p_.sigma_rad_s);
    Verdict verdict;
    if (!(as_is > kSurprise)) return verdict;
    double other = kLargest * kLargest;
    for (const GyroLie& lie : kGyroLies) {
      if (!examined_[static_cast<std::size_t>(lie.i)] || !examined_[static_cast<std::size_t>(lie.k)])
        continue;
      const double left = misfit(lie(s.change), lie(s.mean), s, p_.sigma_rad_s);
      if (left < other) nearest_ = lie;
      other = std::min(other, left);
    }
    Vec3 left = (s.change - s.by_wheels).cwiseQuotient(p_.sigma_rad_s);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      if (p_.by_rate[i] && i != 2)  // no wheel turns about it
        left(axis) = (s.mean(axis) - s.rate(axis)) / p_.rate_sigma_rad_s(axis);
      if (!examined_[i]) left(axis) = 0.0;
    }
    double wheel = kLargest * kLargest;
    for (int i = 0; i < Wheels; ++i) wheel = std::min(wheel, with_another_wheel(left, p_.sigma_rad_s, i));
    verdict.surprise = as_is;
    verdict.lies = other < kExplains * as_is && other < p_.of_an_encoder * wheel;
    const bool rightly = witness.wheel_stands || wheel < kExplains * kSurprise;
    if (witness.blamed_wheel >= 0 && rightly) verdict.lies = false;
    verdict.unexplained = std::min(as_is, wheel);
    return verdict;
  }

  GyroWatchParams<Wheels> p_;
  History history_;
  std::array<bool, 3> examined_{true, true, true};  // axes
  int impossible_ = 0;
  std::array<int, 3> away_{};  // samples in a row with an impossible rate; kGone: for good
  int without_ = 0;
  int settling_ = 0;  // ticks left
  double evidence_ = 0.0;
  // Per lie, against that wheel's encoder; is one of them more than zero?
  std::array<Odds, static_cast<std::size_t>(Wheels)> swapped_;
  bool weighs_ = false;
  int blamed_ = 0;                  // ticks since an encoder is left out
  int contradicted_ = 0;            // ticks in a row
  int spins_held_ = 0;              // ticks in a row: turns, it says, and no wheel does
  int mirrored_ = 0;                // ticks in a row
  GyroLie nearest_ = kGyroLies[0];  // that explains most
  double accel_nis_ = 0.0;
  GyroNoise noise_;
  BiasJump jump_;
  Vec3 said_rad_s_ = Vec3::Zero();   // before axes were left out
  Vec3 step_before_ = Vec3::Zero();  // where the gyro was from what was expected, a tick ago
  Vec<Wheels> carried_rad_s2_ = Vec<Wheels>::Zero();
  bool trusted_ = true;
  Vec<Wheels> u_ = Vec<Wheels>::Zero();
  Vec<Wheels> u_before_ = Vec<Wheels>::Zero();
  bool suspected_ = false;  // an axis is left out, or something counts ticks in a row
  bool left_out_ = false;
  int ticks_out_ = 0;  // with an axis left out, in a row
};

}  // namespace equipoise
