// The generated filters against the readable dense form, with masks, faulty samples and widened variances;
// single precision against double.
// EQUIPOISE_FILTER_STEPS=1000000 makes the comparison longer.
#include "equipoise/estimate/packed_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "robots/mbbr/config.hpp"
#include "robots/mbbr/ekf.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/ekf.hpp"

namespace equipoise {
namespace {

/// IMU beside the axis; sways, rolls and turns both ways up to 1 Hz.
struct MbbrCase {
  using Model = MbbrEkfModel;
  using Filter = MbbrEkf::Filter;
  static constexpr int kRates = Model::kThetaDotX;

  MbbrConfig config = load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config;
  Filter::Params params = config.estimators.ekf.filter;

  Model model() const {
    MbbrParameters robot = config.robot;
    robot.l_a.head<2>() << 0.03, -0.02;
    return {robot, config.estimators.ekf.disturbance_time_constant_s};
  }
  static Vec<18> truth(double t) {
    Vec<18> x;
    x << 0.05 * std::sin(2.0 * t), 0.04 * std::cos(1.7 * t), 3.0 * std::sin(0.5 * t), 2.0 * std::cos(0.4 * t),
        20.0 * std::cos(0.3 * t), 0.1 * std::cos(2.0 * t), -0.07 * std::sin(1.7 * t), 6.0 * std::sin(0.3 * t),
        1.5 * std::cos(0.5 * t), -0.8 * std::sin(0.4 * t), 0.02, -0.03, 0.004, -0.003, 0.01, 0.05, -0.02,
        0.01;
    return x;
  }
};

/// Sways, rolls and turns both ways up to 10 rad/s.
struct MipCase {
  using Model = MipEkfModel;
  using Filter = MipEkf::Filter;
  static constexpr int kRates = Model::kThetaDot;

  MipConfig config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  Filter::Params params = config.estimators.ekf.filter;

  Model model() const {
    return {config.robot, config.estimators.ekf.options, config.estimators.ekf.disturbance_time_constant_s};
  }
  static Vec<14> truth(double t) {
    Vec<14> x;
    x << 0.05 * std::sin(2.0 * t), 3.0 * std::sin(0.5 * t), 33.0 * std::sin(0.3 * t), 0.1 * std::cos(2.0 * t),
        1.5 * std::cos(0.5 * t), 10.0 * std::cos(0.3 * t), 0.02, -0.03, 0.01, 0.004, 0.002, 0.01, 0.05, -0.02;
    return x;
  }
};

template <class Case>
class PackedFilterTest : public ::testing::Test {
 protected:
  using Model = typename Case::Model;
  using Dense = KalmanFilter<Model>;
  using Packed = typename Case::Filter;
  static constexpr int n = Dense::n;
  static constexpr int m = Dense::m;
  static constexpr int p = Dense::p;

  Case robot_;
  Model model_ = robot_.model();
  Dense dense_{model_, robot_.params};
  Packed packed_{model_, robot_.params};

  /// In parts of a number or, of small ones, of its unit.
  double state_error() const {
    const Vec<n> scale = dense_.x().cwiseAbs().cwiseMax(1.0);
    return ((packed_.x() - dense_.x()).array() / scale.array()).abs().maxCoeff();
  }
  /// In parts of the two standard deviations.
  double covariance_error() const {
    const Vec<n> inverse = dense_.P().diagonal().cwiseSqrt().cwiseInverse();
    return (inverse.asDiagonal() * (packed_.P() - dense_.P()) * inverse.asDiagonal()).cwiseAbs().maxCoeff();
  }
  double innovation_error() const {
    const double mean = dense_.normalized_innovation();
    double worst = std::abs(packed_.normalized_innovation() - mean) / std::max(1.0, mean);
    for (std::size_t i = 0; i < m; ++i) {
      const double nis = dense_.row_nis()[i];
      worst = std::max(worst, std::abs(packed_.row_nis()[i] - nis) / std::max(1.0, nis));
      if (std::isnan(dense_.row_innovation()[i])) continue;  // of a sample that does not count
      worst = std::max(worst, std::abs(packed_.row_innovation()[i] - dense_.row_innovation()[i]));
      worst = std::max(worst, std::abs(packed_.row_variance()[i] / dense_.row_variance()[i] - 1.0));
    }
    return worst;
  }
};

using Robots = ::testing::Types<MbbrCase, MipCase>;
TYPED_TEST_SUITE(PackedFilterTest, Robots);

long steps() {
  const char* const asked = std::getenv("EQUIPOISE_FILTER_STEPS");
  return asked != nullptr ? std::strtol(asked, nullptr, 10) : 20'000;
}

TYPED_TEST(PackedFilterTest, AgreesWithTheDenseFormThroughMasksAndJumps) {
  constexpr int kOutputs = TestFixture::m;
  using Input = Vec<TestFixture::p>;
  using Samples = Vec<kOutputs>;
  auto& dense = this->dense_;
  auto& packed = this->packed_;
  dense.reset(TypeParam::truth(0.0));
  packed.reset(TypeParam::truth(0.0));
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const Samples sigma = this->robot_.params.R.cwiseSqrt();
  double worst_x = 0.0;
  double worst_P = 0.0;
  double worst_nis = 0.0;
  int blind = 0;
  const long end = steps();
  for (long k = 1; k <= end; ++k) {
    const Input u = Input::NullaryExpr([&] { return 0.2 * noise(random); });
    Samples y;
    Mat<kOutputs, TestFixture::n> H;
    this->model_.measure(TypeParam::truth(static_cast<double>(k) * kTickS), u, y, H);
    for (int i = 0; i < kOutputs; ++i) y(i) += sigma(i) * noise(random);
    if (unit(random) < 0.002) y(static_cast<int>(kOutputs * unit(random))) += 2.0;  // a sample that lies
    if (unit(random) < 0.001) blind = 20;
    std::array<bool, kOutputs> use{};
    for (bool& row : use) row = blind == 0 && unit(random) > 0.1;
    blind = std::max(0, blind - 1);
    for (std::size_t i = 0; i < kOutputs; ++i) {
      if (!use[i] && unit(random) < 0.01) y(static_cast<int>(i)) = std::nan("");  // not to be looked at
    }
    dense.predict(u);
    packed.predict(u);
    if (unit(random) < 0.005) {
      dense.widen(TypeParam::kRates, 2, 0.02);
      packed.widen(TypeParam::kRates, 2, 0.02);
    }
    dense.update(u, y, use);
    packed.update(u, y, use);
    worst_x = std::max(worst_x, this->state_error());
    worst_nis = std::max(worst_nis, this->innovation_error());
    if (k % 16 == 0) worst_P = std::max(worst_P, this->covariance_error());
    ASSERT_LT(worst_x, 1e-9) << k;
    ASSERT_LT(worst_P, 1e-9) << k;
    ASSERT_LT(worst_nis, 1e-8) << k;
  }
  std::printf("%ld steps: states %.1e, covariance %.1e, innovations %.1e\n", end, worst_x, worst_P,
              worst_nis);
}

/// Turning and driving for minutes: thousands of radians on the encoders, which a float resolves to 1e-3.
TYPED_TEST(PackedFilterTest, InSinglePrecisionStaysWithinAFractionOfSigma) {
  constexpr int kTurning = TypeParam::Model::kTurning;
  constexpr int kTurnings = TypeParam::Model::kTurnings;
  constexpr int kOutputs = TestFixture::m;
  constexpr double kDriven = 9000.0;
  typename TestFixture::Packed single(this->model_, this->robot_.params, Precision::kSingle);
  auto& reference = this->packed_;
  const auto far = [](double t) {
    auto x = TypeParam::truth(t);
    for (int i = kTurning; i < kTurning + kTurnings; ++i) x(i) += kDriven;
    return x;
  };
  single.reset(far(0.0));
  reference.reset(far(0.0));
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const Vec<kOutputs> sigma = this->robot_.params.R.cwiseSqrt();
  double worst = 0.0;
  const long end = steps();
  for (long k = 1; k <= end; ++k) {
    const Vec<TestFixture::p> u = Vec<TestFixture::p>::NullaryExpr([&] { return 0.2 * noise(random); });
    Vec<kOutputs> y;
    Mat<kOutputs, TestFixture::n> H;
    this->model_.measure(far(static_cast<double>(k) * kTickS), u, y, H);
    for (int i = 0; i < kOutputs; ++i) y(i) += sigma(i) * noise(random);
    std::array<bool, kOutputs> use{};
    for (bool& row : use) row = unit(random) > 0.02;
    for (auto* filter : {&single, &reference}) {
      filter->predict(u);
      filter->update(u, y, use);
    }
    for (int i = 0; i < TestFixture::n; ++i) {
      const double one_sigma = std::sqrt(reference.variance(i));
      worst = std::max(worst, std::abs(single.x()(i) - reference.x()(i)) / one_sigma);
      ASSERT_NEAR(std::sqrt(single.variance(i)), one_sigma, 0.003 * one_sigma) << k << " state " << i;
    }
    ASSERT_LT(worst, 0.1) << k;
  }
  EXPECT_NE(single.x(), reference.x());  // it is single
  std::printf("%ld steps: %.1e sigma\n", end, worst);
}

/// With S = H P H' + R of the rows that count: the rows' variances have the product det S, the squared
/// innovations the sum nu' S^-1 nu (Kay, Fundamentals of Statistical Signal Processing I, 12.6).
TYPED_TEST(PackedFilterTest, GivesTheLikelihoodOfTheSamplesBeforeItCorrects) {
  constexpr int kStates = TestFixture::n;
  constexpr int kRows = TestFixture::m;
  constexpr int kUsed = kRows - 1;
  auto& filter = this->packed_;
  filter.reset(TypeParam::truth(0.0));
  const Vec<TestFixture::p> u = Vec<TestFixture::p>::Constant(0.1);
  for (int k = 0; k < 20; ++k) filter.predict(u);
  for (std::size_t i = 0; i < kRows; ++i)
    filter.set_row_noise(i, (2.0 + static_cast<double>(i)) * filter.row_noise(i));
  Vec<kRows> expected;
  Mat<kRows, kStates> H;
  this->model_.measure(filter.x(), u, expected, H);
  const Vec<kRows> nu = 0.05 * Vec<kRows>::LinSpaced(-1.0, 2.0);
  const Vec<kStates> x = filter.x();
  const Mat<kStates, kStates> P = filter.P();
  const Vec<kRows> R = this->robot_.params.R.cwiseProduct(Vec<kRows>::LinSpaced(2.0, kRows + 1.0));
  std::array<bool, kRows> use = all_true<kRows>();
  use[kUsed] = false;
  filter.innovate(u, expected + nu, use);
  EXPECT_EQ(filter.x(), x);
  EXPECT_EQ(filter.P(), P);
  // Of no fixed size: such products and decompositions compile once.
  const Eigen::MatrixXd Pht = Eigen::MatrixXd(P) * Eigen::MatrixXd(H).transpose();
  const Eigen::MatrixXd S = Eigen::MatrixXd(H) * Pht + Eigen::MatrixXd(R.asDiagonal());
  const Eigen::LDLT<Eigen::MatrixXd> of_used(S.topLeftCorner(kUsed, kUsed));
  const Eigen::VectorXd weighted = of_used.solve(nu.head(kUsed));
  double product = 1.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < kUsed; ++i) {
    product *= filter.row_variance()[i];
    sum += filter.row_innovation()[i] * filter.row_innovation()[i] / filter.row_variance()[i];
  }
  EXPECT_NEAR(product / of_used.vectorD().prod(), 1.0, 1e-9);
  EXPECT_NEAR(sum / nu.head(kUsed).dot(weighted), 1.0, 1e-9);
  // The row that does not count: what the others leave open of it.
  const Eigen::VectorXd across = S.topRightCorner(kUsed, 1);
  EXPECT_NEAR(filter.row_innovation()[kUsed], nu(kUsed) - across.dot(weighted), 1e-9);
  EXPECT_NEAR(filter.row_variance()[kUsed] / (S(kUsed, kUsed) - across.dot(of_used.solve(across))), 1.0,
              1e-9);
  filter.correct();
  const Eigen::VectorXd gained = Pht.leftCols(kUsed) * weighted;
  EXPECT_LT((filter.x() - x - gained).norm(), 1e-9 * gained.norm());
}

TYPED_TEST(PackedFilterTest, AdoptsTheStateOfAnotherWithItsOwnNoise) {
  const Vec<TestFixture::p> u = Vec<TestFixture::p>::Constant(0.1);
  const Vec<TestFixture::m> y = Vec<TestFixture::m>::Constant(0.01);
  constexpr auto all = all_true<TestFixture::m>();
  for (const Precision precision : {Precision::kSingle, Precision::kDouble}) {
    typename TestFixture::Packed filter(this->model_, this->robot_.params, precision);
    typename TestFixture::Packed fork = filter;
    filter.reset(TypeParam::truth(3000.0));  // angles of which whole turns were taken off
    for (int k = 0; k < 50; ++k) {
      filter.predict(u);
      filter.update(u, y, all);
      fork.predict(-u);
    }
    fork.adopt(filter);
    EXPECT_EQ(fork.row_variance(), filter.row_variance());
    for (auto* both : {&filter, &fork}) {
      both->predict(u);
      both->update(u, y, all);
    }
    EXPECT_EQ(fork.x(), filter.x());
    EXPECT_EQ(fork.P(), filter.P());
    fork.set_row_noise(0, 4.0 * filter.row_noise(0));
    fork.adopt(filter);
    for (auto* both : {&filter, &fork}) both->innovate(u, y, all);
    EXPECT_NEAR(fork.row_variance()[0] - filter.row_variance()[0], 3.0 * filter.row_noise(0),
                1e-5 * filter.row_variance()[0]);
    // In the other precision, to its last digit.
    typename TestFixture::Packed other(
        this->model_, this->robot_.params,
        precision == Precision::kSingle ? Precision::kDouble : Precision::kSingle);
    other.adopt(filter);
    EXPECT_LT((other.x() - filter.x()).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_NEAR(other.variance(0) / filter.variance(0), 1.0, 1e-6);
  }
}

TYPED_TEST(PackedFilterTest, HoldsEveryEntryOfTheProcessNoise) {
  this->robot_.params.initial_variance.setConstant(1e-30);
  this->dense_ = {this->model_, this->robot_.params};
  this->packed_ = {this->model_, this->robot_.params};
  this->dense_.predict(Vec<TestFixture::p>::Zero());
  this->packed_.predict(Vec<TestFixture::p>::Zero());
  EXPECT_LT(this->covariance_error(), 1e-12);
  EXPECT_GT(this->dense_.P().diagonal().minCoeff(), 1e-20);
}

TYPED_TEST(PackedFilterTest, LeadsTheMotionAheadAsTheModelDoes) {
  constexpr int kMotion = TestFixture::Packed::kMotion;
  for (int k = 0; k < 200; ++k) {
    const double dt = kTickS * (k % 7) / 6.0;
    const Vec<TestFixture::p> u = Vec<TestFixture::p>::LinSpaced(std::sin(k), -std::cos(k));
    const Vec<kMotion> before = TypeParam::truth(0.3 * k).template head<kMotion>();
    Vec<kMotion> after = before;
    this->packed_.ahead(u, dt, after);
    const Vec<kMotion> expected = this->model_.ahead(before, u, dt);
    ASSERT_LT((after - expected).norm(), 1e-12 * (1.0 + expected.norm())) << k;
    ASSERT_EQ((after - before).norm() > 1e-6, dt > 0.0) << k;
  }
}

TYPED_TEST(PackedFilterTest, WithoutSamplesChangesNothing) {
  this->packed_.predict(Vec<TestFixture::p>::Zero());
  const auto x = this->packed_.x();
  const auto P = this->packed_.P();
  this->packed_.update(Vec<TestFixture::p>::Zero(), Vec<TestFixture::m>::Constant(std::nan("")), {});
  EXPECT_EQ(this->packed_.x(), x);
  EXPECT_EQ(this->packed_.P(), P);
  EXPECT_EQ(this->packed_.normalized_innovation(), 0.0);
}

/// Once nobody knows to a radian what a wheel alone shows; the dense form keeps it. All else goes on as
/// there.
TYPED_TEST(PackedFilterTest, ForgetsAnAngleThatNoSampleShows) {
  using Angles = typename TypeParam::Model;
  constexpr int kAngles = Angles::kTurnings;
  auto& dense = this->dense_;
  auto& packed = this->packed_;
  auto use = all_true<TestFixture::m>();
  use[Angles::kWheel] = false;
  const auto rows = this->model_.turning_rows();
  const auto of_wheel = [&](const auto& P, int i) {
    const Vec<kAngles> w = rows.row(Angles::kWheel + i);
    return w.dot(P.template block<kAngles, kAngles>(Angles::kTurning, Angles::kTurning) * w);
  };
  const auto seen = [&](const Vec<TestFixture::n>& x) {  // all but the angle of that wheel alone
    Vec<TestFixture::n> other = x;
    other.template segment<kAngles>(Angles::kTurning) =
        rows.template middleRows<kAngles>(Angles::kWheel) * x.template segment<kAngles>(Angles::kTurning);
    other(Angles::kTurning) = 0.0;
    return other;
  };
  dense.reset(TypeParam::truth(0.0)), packed.reset(TypeParam::truth(0.0));
  dense.widen(Angles::kTurning, kAngles, 2.0), packed.widen(Angles::kTurning, kAngles, 2.0);
  const Vec<TestFixture::p> u = Vec<TestFixture::p>::Constant(0.1);
  for (int k = 0; k < 400; ++k) {
    Vec<TestFixture::m> y;
    Mat<TestFixture::m, TestFixture::n> H;
    dense.predict(u);
    packed.predict(u);
    this->model_.measure(TypeParam::truth(k * kTickS), u, y, H);
    dense.update(u, y, use);
    packed.update(u, y, use);
    ASSERT_LT((seen(packed.x()) - seen(dense.x())).norm(), 1e-9 * dense.x().norm()) << k;
    for (int i = 0; i < TestFixture::n; ++i) {
      if (i >= Angles::kTurning && i < Angles::kTurning + kAngles) continue;
      ASSERT_NEAR(packed.variance(i) / dense.P()(i, i), 1.0, 1e-7) << k << " state " << i;
    }
    for (int i = 1; i < kAngles; ++i)
      ASSERT_NEAR(of_wheel(packed.P(), i) / of_wheel(dense.P(), i), 1.0, 1e-7) << k;
    ASSERT_LT(of_wheel(packed.P(), 0), 1.0) << k;
  }
  EXPECT_GT(of_wheel(dense.P(), 0), 1.0);
}

/// Innovations of rows that are not used are told, too: zeros mean that none was computed. It is half of a
/// step.
template <class Ekf, class Sample, class Config>
void expect_a_prediction(const Config& config, Sample z) {
  z.gyro_B_rad_s.setConstant(0.3);
  z.wheel_angle_rad.setConstant(0.2);
  z.imu_ok = z.encoders_ok = true;
  Ekf filter(config.robot, config.estimators.ekf);
  for (int k = 0; k < 3; ++k) {
    filter.predict(Vec<Ekf::Model::kInputs>::Zero());
    filter.update(z);
  }
  EXPECT_NE(filter.row_innovation()[0], 0.0);
  z.imu_ok = z.encoders_ok = false;
  Ekf predicted = filter;
  predicted.predict(Vec<Ekf::Model::kInputs>::Zero());
  filter.predict(Vec<Ekf::Model::kInputs>::Zero());
  filter.update(z);
  EXPECT_EQ(filter.x(), predicted.x());
  EXPECT_EQ(filter.P(), predicted.P());
  for (const double innovation : filter.row_innovation()) EXPECT_EQ(innovation, 0.0);
  for (const double nis : filter.row_nis()) EXPECT_EQ(nis, 0.0);
  filter.predict(Vec<Ekf::Model::kInputs>::Zero());
  z.imu_ok = true;
  filter.update(z);
  EXPECT_NE(filter.x(), predicted.x());
}

TEST(Ekf, ATickWithoutSamplesIsAPrediction) {
  expect_a_prediction<MbbrEkf>(MbbrCase{}.config, Mbbr::Sample{});
  expect_a_prediction<MipEkf>(MipCase{}.config, Mip::Sample{});
}

}  // namespace
}  // namespace equipoise
