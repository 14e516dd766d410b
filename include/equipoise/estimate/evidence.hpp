// What samples say for a filter: the log density of its innovations, bounded, since models err and samples
// are shaken (Huber 1965). In: filter after its update, Measurement -> out: nats. What the gyro shakes is
// learnt on the way. RT-safe. Filter: row_innovation, row_variance. Derivation: docs/faults.md.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "equipoise/estimate/used_sensors.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

struct EvidenceParams {
  double encoder_sigma_rad = 0.0;            // counts and play
  double encoder_count_rad = 0.0;            // of a wheel
  double wheel_step_rad = 0.0;               // that a wheel turns in a tick, at most
  double slips = 0.0;                        // share of the wheels' samples
  std::array<double, 3> gyro_sigma_rad_s{};  // of what turns the body beside the model, at least
};

struct SensorFaultsParams {
  EvidenceParams evidence;
  std::array<bool, 3> balances{};  // gyro axes without which the robot falls
  double slowly_rad_s = 0.0;       // turning slower it goes on without one that is dead
  Vec3 axis_sign = Vec3::Ones();   // of the sensor's axis along each of the body's
  bool bias_drifts = false;        // is a hypothesis

  /// One of these does.
  bool balance(std::uint32_t axes) const noexcept {
    for (std::size_t i = 0; i < 3; ++i) {
      if (balances[i] && (axes >> i & 1U) != 0) return true;
    }
    return false;
  }
};

template <class Filter, int Wheels>
class Evidence {
 public:
  using Sample = Measurement<Wheels>;
  using Model = typename Filter::Model;
  static constexpr std::size_t kRows = static_cast<std::size_t>(Model::kOutputs);
  static constexpr std::size_t kWheelRow = static_cast<std::size_t>(Model::kWheel);
  static constexpr std::size_t kAccelRow = kWheelRow + static_cast<std::size_t>(Wheels);

  explicit Evidence(const EvidenceParams& params)
      : p_(params), log_still_(log_normal(0.0, std::pow(kModelError * params.encoder_sigma_rad, 2))) {
    width_.fill(-kDiverged);
    for (std::size_t row = 0; row < kRows; ++row) {
      faulty_[row] = log_anything(row);
      // Of a gross sample of a healthy one. A wheel that slips turns as a faulty encoder's may.
      shaken_[row] = faulty_[row] + std::log(row < 3 ? kShaken : row < kAccelRow ? p_.slips : kFelt);
    }
    // Half of the faulty encoders stand still; one that stood a tick ago is one of these (Bayes).
    const double anything = std::exp(log_anything(kWheelRow));
    const double still = std::exp(log_still_);
    const std::array<double, 2> stands{0.5, still / (still + anything)};
    for (std::size_t stood = 0; stood < 2; ++stood) {
      log_turns_[stood] = std::log((1.0 - stands[stood]) * anything);
      log_stands_[stood] = std::log((1.0 - stands[stood]) * anything + stands[stood] * still);
    }
  }

  /// `sigma_rad_s`: of the gyro, while the robot was at rest.
  void reset(double sigma_rad_s) noexcept {
    const double sigma = std::min(sigma_rad_s, kMostVibration_rad_s);
    vibration_ = sigma * sigma;
    forget();
  }
  /// The samples before the next are not known.
  void forget() noexcept {
    known_ = false;
    stands_.fill(false);
  }

  /// A tick's first: what is expected of the others, and its own.
  double expect(const Filter& f, const Sample& used, const Sample& came) noexcept {
    for (std::size_t row = kWheelRow; row < kAccelRow; ++row) {
      const bool stood = std::exchange(stands_[row], repeats(row, came));
      faulty_[row] = (stands_[row] ? log_stands_ : log_turns_)[stood];
    }
    misfit_ = 0.0;
    shaken_most_ = within_ = 0.0;
    const double density = log_density(f, used, came, [&](std::size_t row, double width, double says) {
      per_area_[row] = 1.0 / (2.0 * kPi * spread(f, row));
      width_[row] = width - 1.0;
      const double peak = -0.5 * width;
      peak_[row] = stands_[row] ? std::max(peak, log_still_) : peak;
      misfit_ += peak_[row] - says;
      if (row >= kWheelRow && row < kAccelRow && peak_[row] - says < 0.5) within_ += peak_[row] - says;
      shaken_most_ += std::max(shaken_[row] - peak_[row], 0.0);
    });
    expected_ = density + misfit_;
    knows_less_ = !(density > kDiverged);
    for (std::size_t row = 0; row < kRows; ++row) {
      knows_less_ = knows_less_ || f.row_variance()[row] > kWidened * variance_[row];
      variance_[row] = f.row_variance()[row];
    }
    return bounded(density);
  }
  /// expect()'s filter has lost its way, or its variances were widened: most() does not hold for those of
  /// before.
  bool knows_less() const noexcept { return knows_less_; }
  /// What it loses by wheels that are off by less than a standard deviation. An eduMIP's are for long, where
  /// it turns or the floor slopes: tick by tick that says the same again, and nothing of the IMU.
  double within_a_sigma() const noexcept { return within_; }
  /// What a filter could say of this tick at most that uses some rows of `all`, and so is surer of none: it
  /// need not run to be refuted.
  double most(const Sample& all, const UsedSensors<Wheels>& used, const Sample& came) const noexcept {
    double sum = 0.0;
    for (std::size_t row = 0; row < kRows; ++row) {
      if (!comes(came, row) || comes(all, row) != used.leaves_out(row)) continue;
      if (!comes(all, row)) return kOutlier;
      sum += faulty_[row] - peak_[row];
    }
    return most_of(sum);
  }
  /// The same of one that uses all, but takes gyro and accelerometer to be so noisy.
  double most(const Sample& all, double gyro_rad_s, double accel_m_s2) const noexcept {
    const double gyro = log_normal(0.0, std::pow(kModelError * gyro_rad_s, 2));
    const double accel = log_normal(0.0, std::pow(kModelError * accel_m_s2, 2));
    double sum = 0.0;
    for (std::size_t row = 0; row < kRows; ++row) {
      if (!comes(all, row) || (row >= kWheelRow && row < kAccelRow)) continue;
      sum += std::min((row < 3 ? gyro : accel) - peak_[row], 0.0);
    }
    return most_of(sum);
  }
  /// The same of one that begins and reads a row otherwise, those before it as expect()'s filter `f`.
  double most(const Filter& f, const Sample& all, std::size_t row, double reads) const noexcept {
    if (!comes(all, row)) return kOutlier;
    const double off = f.row_innovation()[row] + reads - reading(all, row);
    return most_of(std::max(-0.5 * off * off / spread(f, row), shaken_[row] - peak_[row]));
  }
  /// The innovations are larger than noise makes them on the average.
  bool surprises() const noexcept {
    return knows_less_ || misfit_ > kRows / (2.0 * kModelError * kModelError);
  }
  double operator()(const Filter& f, const Sample& used, const Sample& came) const noexcept {
    return bounded(log_density(f, used, came));
  }
  /// What comes and goes from sample to sample is vibration (von Neumann 1941); the median of the gyro's
  /// axes, for one may be faulty.
  void learn_vibration(const Filter& f, const Sample& used) noexcept {
    std::array<double, 3> change{};
    for (std::size_t i = 0; i < 3; ++i) {
      change[i] = f.row_innovation()[i] - innovation_[i];
      innovation_[i] = f.row_innovation()[i];
    }
    if (!(comes(used, 0) && comes(used, 1) && comes(used, 2))) return;
    for (double& c : change) c *= 0.5 * c;
    const auto [a, b, c] = change;
    const double median = std::max(std::min(a, b), std::min(std::max(a, b), c));
    const auto& expected = f.row_variance();
    const double floor = std::max(vibration_, *std::min_element(expected.begin(), expected.begin() + 3));
    const double most = std::min(9.0 * floor, kMostVibration_rad_s * kMostVibration_rad_s);  // 3 sigma
    vibration_ += kVibrationMean * (std::min(median / kMedianOfThree, most) - vibration_);
  }
  /// The tick is over.
  void hear(const Sample& z) noexcept {
    before_ = z;
    known_ = z.encoders_ok;
  }

  /// Of the gyro, one sigma.
  double vibration_rad_s() const noexcept { return std::sqrt(vibration_); }
  /// What is less than a jump of its bias.
  double least_jump_rad_s() const noexcept { return std::max(kLeastJump_rad_s, 3.0 * vibration_rad_s()); }
  bool known() const noexcept { return known_; }
  const Sample& before() const noexcept { return before_; }

  /// Variance of an innovation: what the filter expects, at least what vibrates, and the model's error.
  double spread(const Filter& f, std::size_t row) const noexcept {
    return kModelError * kModelError * std::max(f.row_variance()[row], row < 3 ? vibration_ : 0.0);
  }
  /// What jumps of the gyro, of one `sigma_rad_s`, would explain of this tick's innovations; nats.
  double jump(const Filter& f, const Sample& used, double sigma_rad_s) const noexcept {
    double sum = 0.0;
    for (std::size_t row = 0; row < 3; ++row) {
      if (!comes(used, row)) continue;
      const double v = spread(f, row);
      sum += log_normal(squared(f, row), v + sigma_rad_s * sigma_rad_s) -
             std::max(log_normal(squared(f, row), v), shaken_[row]);
    }
    return std::min(sum, kOutlier);
  }
  static double squared(const Filter& f, std::size_t row) noexcept {
    return f.row_innovation()[row] * f.row_innovation()[row];
  }
  /// Of the gyro; 0 where it does not come.
  static Vec3 gyro_innovation(const Filter& f, const Sample& used) noexcept {
    Vec3 off = Vec3::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      if (comes(used, i)) off(static_cast<int>(i)) = f.row_innovation()[i];
    }
    return off;
  }
  /// Of the gyro's `axes`, at most.
  static double off_rad_s(const Filter& f, const Sample& used, const std::array<bool, 3>& axes) noexcept {
    const Vec3 off = gyro_innovation(f, used).cwiseAbs();
    double most = 0.0;
    for (std::size_t i = 0; i < 3; ++i) most = std::max(most, axes[i] ? off(static_cast<int>(i)) : 0.0);
    return most;
  }
  static bool comes(const Sample& z, std::size_t row) noexcept {
    if (row < 3) return z.imu_ok && z.gyro_axis_ok[row];
    if (row < kAccelRow) return z.encoders_ok && z.wheel_ok[row - kWheelRow];
    return z.imu_ok;
  }
  /// Of gyro and encoders.
  static double reading(const Sample& z, std::size_t row) noexcept {
    return row < 3 ? z.gyro_B_rad_s(static_cast<int>(row))
                   : z.wheel_angle_rad(static_cast<int>(row - kWheelRow));
  }

  /// A sensor that stands still or counts backwards, since it read `from`, may look healthy, too, while
  /// nothing moves much: what speaks against that, nats.
  double unless_faulty(const Filter& f, const Sample& used, const Sample& z, int index,
                       double from) const noexcept {
    const auto row = static_cast<std::size_t>(index);
    if (!comes(used, row)) return 0.0;
    const double innovation = f.row_innovation()[row];
    const double reads = reading(z, row);
    const double moved = reads - from;
    const double backwards = 2.0 * (row < 3 ? reads : moved) - innovation;
    const double faulty = std::min(moved * moved, backwards * backwards);
    return 0.5 * (faulty - innovation * innovation) / spread(f, row);
  }

  static constexpr double kOutlier = 12.0;  // nats, that one tick may say at most

 private:
  static constexpr double kLeastJump_rad_s = 0.1;  // the filter's own bias learns less
  static constexpr double kModelError = 2.0;       // NIS of real logs reaches 4: docs/reality.md
  static constexpr double kShaken = 0.05;          // share of an IMU's samples beyond five sigma, real logs
  static constexpr double kFelt = 0.5;             // of an accelerometer's, that feel what pushes the body
  static constexpr double kVibrationMean = 0.01;   // half a second
  static constexpr double kMedianOfThree = 0.6;    // of squared normal numbers
  static constexpr double kMostVibration_rad_s = 0.1;  // real robots that roll
  static constexpr double kGyroRange_rad_s = 2.0;      // a faulty axis reads anything within: a body's rates
  static constexpr double kAccelRange_m_s2 = 10.0;
  static constexpr double kDiverged = -1e6;
  static constexpr double kWidened = 1.1;    // no tick makes it unsurer by itself
  static constexpr double kRounding = 0.25;  // nats, and that each filter has its own Jacobians

  bool repeats(std::size_t row, const Sample& came) const noexcept {
    return known_ && reading(came, row) == reading(before_, row);
  }

  static double log_normal(double squared, double variance) noexcept {
    return -0.5 * (std::log(2.0 * kPi * variance) + squared / variance);
  }

  /// Of what is used, whose innovation is as likely. An encoder that repeats itself errs as it did a tick
  /// ago: it says how far its wheel has not turned. A gross sample reads as a faulty sensor's.
  double log_healthy(std::size_t row, double log_density, const Vec<Wheels>& turn) const noexcept {
    const double density = std::max(log_density, shaken_[row]);
    if (!stands_[row]) return density;
    const double stays = 1.0 - std::abs(turn(static_cast<int>(row - kWheelRow)));
    return std::max(density, log_still_ + std::log(std::max(stays, 0.0)));
  }
  /// That its wheels turn in a tick; one is a count and the play, within which an encoder may stand still.
  Vec<Wheels> steps(const Filter& f) const noexcept {
    const bool one_stands = std::find(stands_.begin(), stands_.end(), true) != stands_.end();
    if (!one_stands) return Vec<Wheels>::Zero();
    return f.wheel_rate_rad_s() * (kTickS / (p_.encoder_count_rad + p_.encoder_sigma_rad));
  }

  /// Of the rows that came; those that are not used, as a faulty sensor has them. told(row,
  /// log(2 pi variance), density).
  template <class Told>
  double log_density(const Filter& f, const Sample& used, const Sample& came, Told&& told) const noexcept {
    const Vec<Wheels> turn = steps(f);
    double sum = 0.0;
    for (std::size_t row = 0; row < kRows; ++row) {
      if (!comes(came, row)) continue;
      if (!comes(used, row)) {
        sum += faulty_[row];
        continue;
      }
      const double variance = spread(f, row);
      const double width = std::log(2.0 * kPi * variance);
      const double normal = -0.5 * (width + squared(f, row) / variance);
      if (!(normal > kDiverged)) return kDiverged;
      const double density = log_healthy(row, normal, turn);
      sum += density;
      told(row, width, density);
    }
    return sum;
  }

  /// The same with one logarithm of all variances, as VFP takes long for each.
  double log_density(const Filter& f, const Sample& used, const Sample& came) const noexcept {
    const Vec<Wheels> turn = steps(f);
    double sum = 0.0;
    double squares = 0.0;
    double product = 1.0;
    for (std::size_t row = 0; row < kRows; ++row) {
      if (!comes(came, row)) continue;
      if (!comes(used, row)) {
        sum += faulty_[row];
        continue;
      }
      const double variance = spread(f, row);
      const double square = squared(f, row) / variance;
      if (!(square >= 0.0 && square < -kDiverged)) return kDiverged;
      const double area = 2.0 * kPi * variance;
      // Is it no more than of a faulty sensor? The tangent of log(area) at what is expected is above it.
      if (stands_[row] || square + area * per_area_[row] + width_[row] > -2.0 * shaken_[row]) {
        sum += log_healthy(row, -0.5 * (std::log(area) + square), turn);
      } else {
        squares += square;
        product *= area;
      }
    }
    sum -= 0.5 * (std::log(product) + squares);
    return sum > kDiverged ? sum : kDiverged;
  }

  double most_of(double sum) const noexcept { return std::max(sum + shaken_most_ + kRounding, -kOutlier); }

  /// A faulty sensor reads anything in its range.
  double log_anything(std::size_t row) const noexcept {
    if (row < 3) return -std::log(2.0 * kGyroRange_rad_s);
    if (row >= kAccelRow) return -std::log(2.0 * kAccelRange_m_s2);
    return -std::log(2.0 * p_.wheel_step_rad);
  }

  /// At most 100: what is expected may have lost its way.
  double bounded(double log_density) const noexcept {
    return std::clamp(log_density - expected_, -kOutlier, 100.0);
  }

  EvidenceParams p_;
  double log_still_;                      // of an encoder that repeats itself
  double vibration_ = 0.0;                // variance of the gyro
  std::array<double, 3> innovation_{};    // of the gyro, a tick ago
  double expected_ = 0.0;                 // log density of what is expected
  std::array<double, kRows> peak_{};      // of it, by row
  std::array<double, kRows> per_area_{};  // 1 / (2 pi variance)
  std::array<double, kRows> width_{};     // log(2 pi variance) - 1
  double shaken_most_ = 0.0;              // what could be above it
  double misfit_ = 0.0;                   // what it would say more without any innovation
  double within_ = 0.0;
  std::array<double, kRows> variance_{};  // a tick ago
  bool knows_less_ = true;
  // Log densities of a faulty encoder that turns, or stands still, by whether it stood a tick ago.
  std::array<double, 2> log_turns_{}, log_stands_{};
  std::array<double, kRows> faulty_{};  // log densities, of this tick
  std::array<double, kRows> shaken_{};  // of a gross sample
  std::array<bool, kRows> stands_{};    // an encoder, since the tick before
  Sample before_;                       // a tick ago
  bool known_ = false;
};

}  // namespace equipoise
