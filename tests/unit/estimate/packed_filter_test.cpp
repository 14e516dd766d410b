// The generated filter against the readable one. EQUIPOISE_FILTER_STEPS=1000000 makes the long comparison
// longer.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "robots/mbbr/config.hpp"
#include "robots/mbbr/ekf.hpp"

namespace equipoise {
namespace {

using Model = MbbrEkfModel;
using Dense = KalmanFilter<Model>;

struct Pair {
  MbbrConfig config = load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config;
  Model model = beside_the_axis();
  Dense dense{model, config.estimators.ekf.filter};
  MbbrPackedFilter packed = packed_filter(model, config.estimators.ekf.filter);

  Model beside_the_axis() {
    config.robot.l_a << 0.03, -0.02, config.robot.l_a.z();
    return {config.robot, config.estimators.ekf.disturbance_time_constant_s};
  }

  /// Largest difference, in parts of a number or, of small ones, of its unit.
  double state_error() const {
    const Vec<17> scale = dense.x().cwiseAbs().cwiseMax(1.0);
    return ((packed.x() - dense.x()).array() / scale.array()).abs().maxCoeff();
  }
  /// In parts of the two standard deviations.
  double covariance_error() const {
    const Vec<17> inverse = dense.P().diagonal().cwiseSqrt().cwiseInverse();
    return (inverse.asDiagonal() * (packed.P() - dense.P()) * inverse.asDiagonal()).cwiseAbs().maxCoeff();
  }
  double innovation_error() const {
    double worst = 0.0;
    for (std::size_t i = 0; i < 8; ++i) {
      const double nis = dense.row_nis()[i];
      worst = std::max(worst, std::abs(packed.row_nis()[i] - nis) / std::max(1.0, nis));
    }
    const double mean = dense.normalized_innovation();
    return std::max(worst, std::abs(packed.normalized_innovation() - mean) / std::max(1.0, mean));
  }
};

/// Sways, rolls and turns both ways up to 1 Hz, with a crooked, biased IMU.
Vec<17> truth(double t_s) {
  Vec<17> x;
  x << 0.05 * std::sin(2.0 * t_s), 0.04 * std::cos(1.7 * t_s), 3.0 * std::sin(0.5 * t_s),
      2.0 * std::cos(0.4 * t_s), 20.0 * std::cos(0.3 * t_s), 0.1 * std::cos(2.0 * t_s),
      -0.07 * std::sin(1.7 * t_s), 6.0 * std::sin(0.3 * t_s), 1.5 * std::cos(0.5 * t_s),
      -0.8 * std::sin(0.4 * t_s), 0.02, -0.03, 0.004, -0.003, 0.05, -0.02, 0.01;
  return x;
}

long steps() {
  const char* const asked = std::getenv("EQUIPOISE_FILTER_STEPS");
  return asked != nullptr ? std::strtol(asked, nullptr, 10) : 100'000;
}

TEST(MbbrPackedFilter, AgreesWithTheReadableFormThroughMasksAndJumps) {
  Pair filter;
  filter.dense.reset(truth(0.0));
  filter.packed.reset(truth(0.0));
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const Vec<8> sigma = filter.config.estimators.ekf.filter.R.cwiseSqrt();
  double worst_x = 0.0;
  double worst_P = 0.0;
  double worst_nis = 0.0;
  int blind = 0;
  const long end = steps();
  for (long k = 1; k <= end; ++k) {
    const Vec3 u = 0.2 * Vec3(noise(random), noise(random), noise(random));
    Vec<8> y;
    Mat<8, 17> H;
    filter.model.measure(truth(static_cast<double>(k) * kTickS), u, y, H);
    for (int i = 0; i < 8; ++i) y(i) += sigma(i) * noise(random);
    if (unit(random) < 0.002) y(static_cast<int>(8.0 * unit(random))) += 2.0;  // a sample that lies
    if (unit(random) < 0.001) blind = 20;
    std::array<bool, 8> use{};
    for (bool& row : use) row = blind == 0 && unit(random) > 0.1;
    blind = std::max(0, blind - 1);
    for (std::size_t i = 0; i < 8; ++i) {
      if (!use[i] && unit(random) < 0.01) y(static_cast<int>(i)) = std::nan("");  // not to be looked at
    }
    filter.dense.predict(u);
    filter.packed.predict(u);
    if (unit(random) < 0.005) {
      filter.dense.widen(Model::kThetaDotX, 2, 0.02);
      filter.packed.widen(Model::kThetaDotX, 2, 0.02);
    }
    filter.dense.update(u, y, use);
    filter.packed.update(u, y, use);
    worst_x = std::max(worst_x, filter.state_error());
    worst_nis = std::max(worst_nis, filter.innovation_error());
    if (k % 16 == 0) worst_P = std::max(worst_P, filter.covariance_error());
    ASSERT_LT(worst_x, 1e-9) << k;
    ASSERT_LT(worst_nis, 1e-7) << k;
  }
  EXPECT_LT(worst_P, 1e-8);
  ASSERT_TRUE(filter.dense.x().allFinite());
  RecordProperty("steps", static_cast<int>(end));
  std::printf("%ld steps: states %.1e, covariance %.1e, innovations %.1e\n", end, worst_x, worst_P,
              worst_nis);
}

TEST(MbbrPackedFilter, HoldsEveryEntryOfTheProcessNoise) {
  Pair filter;
  const Vec<17> small = Vec<17>::Constant(1e-30);
  filter.config.estimators.ekf.filter.initial_variance = small;
  filter.dense = Dense(filter.model, filter.config.estimators.ekf.filter);
  filter.packed = packed_filter(filter.model, filter.config.estimators.ekf.filter);
  filter.dense.predict(Vec3::Zero());
  filter.packed.predict(Vec3::Zero());
  EXPECT_LT(filter.covariance_error(), 1e-12);
}

}  // namespace
}  // namespace equipoise
