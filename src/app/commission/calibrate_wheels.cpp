#include "app/commission/calibrate_wheels.hpp"

#include <algorithm>
#include <cmath>

#include "app/import/wheel_order.hpp"
#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

// Of the stall torque: 0.8 A of the MBBR's 2.4 A. A drive/coast bridge needs a larger duty for it.
constexpr double kMaxDrive = 0.35;
constexpr double kRamp_s = 0.5;              // from 0 to kMaxDrive
constexpr double kMoved_turns = 1.0 / 36.0;  // 10 degrees: more than any gear's play
constexpr double kMaxTravel_turns = 0.5;
constexpr double kShareOfOthers = 0.2;  // a second wheel that moves by this share moves too
constexpr double kMaxBodyRate_rad_s = 3.0;
constexpr int kStroke_ticks = 12;  // 60 ms
constexpr double kSureSigmas = 6.0;
constexpr double kSureAngle = 0.8;  // cosine between kick and a wheel's axis

/// Travel of every encoder since `start`, turns.
std::array<double, kMaxMotors> travel(const RawSample& start, const RawSample& now,
                                      const WheelLayout& layout) {
  std::array<double, kMaxMotors> turns{};
  for (std::size_t i = 0; i < static_cast<std::size_t>(layout.wheels); ++i)
    turns[i] = (now.encoder_counts[i] - start.encoder_counts[i]) / layout.counts_per_rev;
  return turns;
}

std::size_t largest(const std::array<double, kMaxMotors>& values) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    if (std::abs(values[i]) > std::abs(values[best])) best = i;
  }
  return best;
}

/// Duties for this share of the stall torque of one motor, at rest.
std::array<double, kMaxMotors> only(const WheelLayout& layout, int motor, double drive) {
  std::array<double, kMaxMotors> duties{};
  duties[static_cast<std::size_t>(motor)] = Bridge(layout.motor).invert(drive, 0.0, layout.motor.nominal_V);
  return duties;
}

/// One dead phase of an encoder: its count goes one up and one down for ever, however far the wheel turns.
class DeadPhase {
 public:
  explicit DeadPhase(const RawSample& start) : first_(start), last_(start) {}

  void look(const RawSample& raw) {
    for (std::size_t i = 0; i < kMaxMotors; ++i) {
      if (raw.encoder_counts[i] != last_.encoder_counts[i]) ++changes_[i];
      reach_[i] = std::max(reach_[i], std::abs(raw.encoder_counts[i] - first_.encoder_counts[i]));
    }
    last_ = raw;
  }
  /// From 0; -1: none that changed so often.
  int encoder(int changes) const {
    for (std::size_t i = 0; i < kMaxMotors; ++i) {
      if (changes_[i] >= changes && reach_[i] <= 1.0) return static_cast<int>(i);
    }
    return -1;
  }

 private:
  RawSample first_, last_;
  std::array<int, kMaxMotors> changes_{};
  std::array<double, kMaxMotors> reach_{};
};

/// Raises the duty until a wheel turns; fills duty, encoder, counts_down.
void find_breakaway(ManualDrive& manual, const WheelLayout& layout, WheelFinding* finding) {
  const RawSample start = manual.sample();
  DeadPhase dead_phase(start);
  const int ticks = static_cast<int>(std::lround(kRamp_s * kTickHz));
  for (int tick = 1; tick <= ticks; ++tick) {
    finding->drive = kMaxDrive * tick / ticks;
    const RawSample raw = manual.drive(only(layout, finding->motor, finding->drive));
    dead_phase.look(raw);
    // Hums on its gear's play change a count now and then: wait for the ramp's end, unless the wheel surely
    // spins.
    constexpr int kHums = 6, kSpins = 30;
    if (const int encoder = dead_phase.encoder(tick == ticks ? kHums : kSpins); encoder >= 0) {
      manual.off();
      throw JobError(format(
          "motor %d: encoder %d counts one up and one down for ever: one of its two phases is dead; check "
          "its A and B wires, one at a time",
          finding->motor + 1, encoder + 1));
    }
    const auto turns = travel(start, raw, layout);
    const std::size_t most = largest(turns);
    if (std::abs(turns[most]) < kMoved_turns) continue;
    manual.off();
    for (std::size_t i = 0; i < turns.size(); ++i) {
      if (i != most && std::abs(turns[i]) > kShareOfOthers * std::abs(turns[most])) {
        throw JobError(
            format("motor %d: encoders %d and %d move together; only one wheel may turn: lift the "
                   "robot off the ground",
                   finding->motor + 1, static_cast<int>(most) + 1, static_cast<int>(i) + 1));
      }
    }
    finding->encoder = static_cast<int>(most);
    finding->counts_down = turns[most] < 0.0;
    return;
  }
  manual.off();
  throw JobError(
      format("motor %d: no encoder moves up to %.0f %% torque: battery, motor plug, encoder plug, or the "
             "wheel is held",
             finding->motor + 1, 100.0 * kMaxDrive));
}

struct Kick {
  Vec3 share_B = Vec3::Zero();  // body rate per wheel rate
  double sigmas = 0.0;
};

/// Shakes the wheel forth, back, back and forth, and regresses the gyro on the wheel's rate.
Kick shake(ManualDrive& manual, const WheelLayout& layout, const Calibration& c,
           const WheelFinding& finding) {
  constexpr std::array<double, 4> kSense{1.0, -1.0, -1.0, 1.0};
  const Stillness rest = manual.hold_still(0.5);
  const Vec3 bias = c.R_BS * (c.gyro_rad_s_per_count * rest.gyro);
  const double sigma =
      c.gyro_rad_s_per_count * std::max(rest.gyro_sigma.norm(), 0.5);  // half a count at least
  const double drive = std::min(1.6 * finding.drive, kMaxDrive);
  const double rad_per_count = (finding.counts_down ? -2.0 : 2.0) * kPi / layout.counts_per_rev;
  const auto k = static_cast<std::size_t>(finding.encoder);
  const RawSample start = manual.sample();
  double last = start.encoder_counts[k];
  double rate_squares = 0.0;
  Vec3 products = Vec3::Zero();
  for (const double sense : kSense) {
    for (int i = 0; i < kStroke_ticks; ++i) {
      const RawSample raw = manual.drive(only(layout, finding.motor, sense * drive));
      const Vec3 gyro = c.R_BS * (c.gyro_rad_s_per_count * Eigen::Map<const Vec3>(raw.gyro_counts)) - bias;
      const double rate = rad_per_count * (raw.encoder_counts[k] - last) * kTickHz;
      last = raw.encoder_counts[k];
      rate_squares += rate * rate;
      products += rate * gyro;
      if (gyro.norm() > kMaxBodyRate_rad_s || std::abs(travel(start, raw, layout)[k]) > kMaxTravel_turns) {
        manual.off();
        throw JobError(format("motor %d: the robot swings at %.1f rad/s or its wheel ran off; hold it better",
                              finding.motor + 1, gyro.norm()));
      }
    }
  }
  manual.off();
  Kick kick;
  if (rate_squares > 0.0) {
    kick.share_B = products / rate_squares;
    kick.sigmas = products.norm() / (sigma * std::sqrt(rate_squares));
  }
  return kick;
}

/// Which wheel kicks like this, and whether positive duty turned it backwards.
void judge(const WheelLayout& layout, const Kick& kick, WheelFinding* finding) {
  finding->kick_sigmas = kick.sigmas;
  if (kick.sigmas < kSureSigmas) return;
  // What the wheel gains about its axis, the body loses.
  finding->axis_B = -kick.share_B.cwiseProduct(layout.body_inertia_kg_m2).normalized();
  double best = 0.0;
  int wheel = -1;
  for (int i = 0; i < layout.wheels; ++i) {
    const Vec3 expected =
        -layout.axis_B[static_cast<std::size_t>(i)].cwiseQuotient(layout.body_inertia_kg_m2);
    const double cosine = kick.share_B.dot(expected) / (kick.share_B.norm() * expected.norm());
    if (std::abs(cosine) <= std::abs(best)) continue;
    best = cosine;
    wheel = i;
  }
  if (std::abs(best) < kSureAngle) return;
  finding->turns_backwards = best < 0.0;
  if (layout.told_apart_by_gyro()) finding->wheel = wheel;
}

/// JobError when the axes that the gyro felt are turned about the vertical against the configured ones: no
/// board file can mend that.
void refuse_wrong_azimuth(const WheelLayout& layout, const std::vector<WheelFinding>& findings) {
  if (layout.wheels != 3 || !layout.told_apart_by_gyro()) return;
  Mat3 configured, felt;
  for (int i = 0; i < layout.wheels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!findings[k].axis_B) return;
    configured.col(i) = -layout.axis_B[k];  // the ball's, as wheel_order has them
    felt.col(i) = -*findings[k].axis_B;
  }
  constexpr double kTurned_rad = 20.0 * kPi / 180.0;
  const WheelOrder order = wheel_order(configured, felt);
  if (std::abs(order.azimuth_rad) > kTurned_rad)
    throw JobError("the wheels do not sit as the configuration says" + order.mistake +
                   "; nothing was written");
}

/// For every motor: where `findings` leave a question, the person answers it.
void settle(ManualDrive& manual, const WheelLayout& layout, std::vector<WheelFinding>* findings) {
  for (WheelFinding& f : *findings) {
    if (f.wheel && f.turns_backwards) continue;
    std::string question = format("motor %d moved encoder %d", f.motor + 1, f.encoder + 1);
    question += f.wheel ? "" : "; which turned, " + layout.name(0) + " to " + layout.name(layout.wheels - 1);
    question += f.turns_backwards ? ", first forwards or backwards (already measured; f)"
                                  : ", and which way first: forwards or backwards (f, b)";
    const std::string answer = manual.ask(
        {Request::kLookAtWheel, question + "? e.g. \"" + std::to_string(f.motor + 1) + " f\"", f.motor});
    int wheel = 0;
    char way = 0;
    if (std::sscanf(answer.c_str(), "%d %c", &wheel, &way) != 2 || wheel < 1 || wheel > layout.wheels ||
        (way != 'f' && way != 'b')) {
      throw JobError("\"" + answer + "\": expected wheel and f or b, e.g. 1 f; nothing was written");
    }
    if (!f.wheel) f.wheel = wheel - 1;
    if (!f.turns_backwards) f.turns_backwards = way == 'b';
  }
  std::vector<bool> turned(static_cast<std::size_t>(layout.wheels)), counted(turned);
  for (const WheelFinding& f : *findings) {
    if (turned[static_cast<std::size_t>(*f.wheel)])
      throw JobError(
          format("two motors seem to turn wheel %d; hang the robot up freely and try again", *f.wheel + 1));
    if (counted[static_cast<std::size_t>(f.encoder)])
      throw JobError(format("two motors move encoder %d: a motor plug sits twice, or an encoder is missing",
                            f.encoder + 1));
    turned[static_cast<std::size_t>(*f.wheel)] = counted[static_cast<std::size_t>(f.encoder)] = true;
  }
}

}  // namespace

bool WheelLayout::told_apart_by_gyro() const {
  for (std::size_t i = 0; i < static_cast<std::size_t>(wheels); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (std::abs(axis_B[i].dot(axis_B[j])) > kSureAngle) return false;
    }
  }
  return true;
}

std::string WheelLayout::name(int wheel) const {
  const char* const where = place[static_cast<std::size_t>(wheel)];
  return format("wheel %d", wheel + 1) + (where == nullptr ? "" : format(" (%s)", where));
}

WheelLayout layout_of(const MbbrParameters& robot, const MotorParameters& motor,
                      const Calibration& calibration) {
  WheelLayout layout;
  layout.wheels = Mbbr::kWheels;
  const MbbrKinematics kinematics(robot);
  for (int i = 0; i < layout.wheels; ++i)
    layout.axis_B[static_cast<std::size_t>(i)] = -kinematics.T_ob().col(i);
  layout.body_inertia_kg_m2 = {robot.I_t1, robot.I_t2, robot.I_t3};
  layout.motor = motor;
  layout.counts_per_rev = calibration.encoder_counts_per_rev;
  return layout;
}

WheelLayout layout_of(const MipParameters& robot, const MotorParameters& motor,
                      const Calibration& calibration) {
  WheelLayout layout;
  layout.wheels = Mip::kWheels;
  layout.axis_B.fill(Vec3::UnitX());  // x points along the axle; turning about +x rolls the robot forwards
  layout.place = {"right", "left"};
  layout.body_inertia_kg_m2 = {robot.I_b1, robot.I_b2, robot.I_b3};
  layout.motor = motor;
  layout.counts_per_rev = calibration.encoder_counts_per_rev;
  return layout;
}

WheelFinding pulse(ManualDrive& manual, const WheelLayout& layout, const Calibration& calibration,
                   int motor) {
  WheelFinding finding;
  finding.motor = motor;
  find_breakaway(manual, layout, &finding);
  manual.rest(0.5);
  judge(layout, shake(manual, layout, calibration, finding), &finding);
  manual.rest(0.3);
  return finding;
}

std::vector<WheelFinding> pulse_all(ManualDrive& manual, const WheelLayout& layout,
                                    const Calibration& calibration) {
  std::vector<WheelFinding> findings;
  findings.reserve(static_cast<std::size_t>(layout.wheels));
  for (int i = 0; i < layout.wheels; ++i) findings.push_back(pulse(manual, layout, calibration, i));
  refuse_wrong_azimuth(layout, findings);
  settle(manual, layout, &findings);
  return findings;
}

std::string describe(const WheelFinding& f) {
  std::string text = format("motor %d: moves at %.0f %% torque, encoder %d counts %s", f.motor + 1,
                            100.0 * f.drive, f.encoder + 1, f.counts_down ? "down" : "up");
  text += f.wheel ? format(", wheel %d", *f.wheel + 1) : ", wheel unknown";
  if (f.turns_backwards) text += *f.turns_backwards ? " turns backwards" : " turns forwards";
  return text + format(" (seen by the gyro: %.0f sigma)", f.kick_sigmas);
}

std::string complaint(const std::vector<WheelFinding>& findings) {
  std::string text;
  const auto add = [&text](const std::string& line) { text += (text.empty() ? "" : "; ") + line; };
  for (const WheelFinding& f : findings) {
    if (*f.wheel != f.motor) add(format("motor %d turns wheel %d", f.motor + 1, *f.wheel + 1));
    if (f.encoder != f.motor) add(format("motor %d moves encoder %d", f.motor + 1, f.encoder + 1));
    if (*f.turns_backwards) add(format("motor %d turns backwards", f.motor + 1));
    if (f.counts_down != *f.turns_backwards) add(format("encoder %d counts backwards", f.encoder + 1));
  }
  return text;
}

EncoderFinding turn_by_hand(ManualDrive& manual, const WheelLayout& layout, int wheel, int turns) {
  const RawSample start = manual.sample();
  manual.ask({Request::kTurnWheel,
              "turn " + layout.name(wheel) + format(" forwards by %d whole turns, then press Enter", turns),
              wheel, turns});
  const auto moved = travel(start, manual.sample(), layout);
  const std::size_t most = largest(moved);
  if (std::abs(moved[most]) < 0.5)
    throw JobError(format("no encoder moved when wheel %d was turned: check its plug", wheel + 1));
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (i != most && std::abs(moved[i]) > kShareOfOthers * std::abs(moved[most]))
      throw JobError(format("encoders %d and %d both moved; turn one wheel alone", static_cast<int>(most) + 1,
                            static_cast<int>(i) + 1));
  }
  return {static_cast<int>(most), moved[most] * layout.counts_per_rev / turns};
}

}  // namespace equipoise::app
