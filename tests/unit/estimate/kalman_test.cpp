#include "equipoise/estimate/kalman.hpp"

#include <gtest/gtest.h>

#include <random>

#include "robots/mbbr/dynamics.hpp"
#include "robots/mbbr/ekf.hpp"
#include "robots/mbbr/high_yaw.hpp"
#include "robots/mbbr/published.hpp"
#include "support/oracle.hpp"

namespace equipoise {
namespace {

KalmanFilter<MbbrPublishedModel>::Params published_tuning() {
  KalmanFilter<MbbrPublishedModel>::Params p;
  p.Q << 1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 0.1, 0.1, 2.0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3;  // [T] (6.31)
  p.R << 2.08e-6, 2.08e-6, 2.08e-6, 7.62e-5, 7.62e-5, 7.62e-5, 1.41, 1.41;           // [T] (6.23)
  return p;
}

TEST(KalmanFilter, FollowsThePrintedFiltersTrace) {
  KalmanFilter<MbbrPublishedModel> filter({}, published_tuning());
  std::array<bool, 8> all;
  all.fill(true);
  const auto rows = test::oracle_rows("ekf_published_trace");
  ASSERT_EQ(rows.size(), 400U);
  for (const auto& row : rows) {
    const Vec3 u = test::vector_of<3>(row, "u");
    filter.predict(u);
    filter.update(u, test::vector_of<8>(row, "y"), all);
    ASSERT_LT((filter.x() - test::vector_of<13>(row, "x")).cwiseAbs().maxCoeff(), 1e-8);
    ASSERT_LT((filter.P().diagonal() - test::vector_of<13>(row, "P_diag")).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(KalmanFilter, CovarianceStaysSymmetricToTheBitAndPositive) {
  KalmanFilter<MbbrPublishedModel> filter({}, published_tuning());
  std::array<bool, 8> all;
  all.fill(true);
  for (const auto& row : test::oracle_rows("ekf_published_trace")) {
    const Vec3 u = test::vector_of<3>(row, "u");
    filter.predict(u);
    filter.update(u, test::vector_of<8>(row, "y"), all);
  }
  EXPECT_TRUE(filter.P() == filter.P().transpose());
  EXPECT_GT(filter.P().diagonal().minCoeff(), 0.0);
}

/// Numerical Jacobians of a model.
template <class Model, int n, int m>
void expect_jacobians_match(const Model& model, const Vec<n>& x, const Vec3& u, double tolerance,
                            int columns = n) {
  Vec<n> f0;
  Mat<n, n> F;
  Vec<m> y0;
  Mat<m, n> H;
  model.predict(x, u, f0, F);
  model.measure(x, u, y0, H);
  constexpr double h = 1e-6;
  for (int j = 0; j < columns; ++j) {
    Vec<n> fp, fm;
    Vec<m> yp, ym;
    Mat<n, n> unused_F;
    Mat<m, n> unused_H;
    const Vec<n> dx = h * Vec<n>::Unit(j);
    model.predict(x + dx, u, fp, unused_F);
    model.predict(x - dx, u, fm, unused_F);
    model.measure(x + dx, u, yp, unused_H);
    model.measure(x - dx, u, ym, unused_H);
    EXPECT_LT((F.col(j) - (fp - fm) / (2 * h)).cwiseAbs().maxCoeff(), tolerance) << "state " << j;
    EXPECT_LT((H.col(j) - (yp - ym) / (2 * h)).cwiseAbs().maxCoeff(), tolerance) << "state " << j;
  }
}

/// The scale's column of F is the derivative of the sum about z, and nothing else.
void expect_scale_is_learnt_about_z(const MbbrEkfModel& model, const Vec<18>& x, const Vec3& u) {
  using M = MbbrEkfModel;
  constexpr double h = 1e-6;
  Vec<18> f0, fp, fm;
  Mat<18, 18> F, unused_F;
  model.predict(x, u, f0, F);
  model.predict(x + h * Vec<18>::Unit(M::kWheelScale), u, fp, unused_F);
  model.predict(x - h * Vec<18>::Unit(M::kWheelScale), u, fm, unused_F);
  const double z = (fp - fm)(M::kE + 2) / (2 * h);
  EXPECT_GT(std::abs(z), 0.01);
  EXPECT_NEAR(F(M::kE + 2, M::kWheelScale), z, 1e-9);
  EXPECT_EQ(F(M::kWheelScale, M::kWheelScale), 1.0);
  EXPECT_NEAR(F.col(M::kWheelScale).cwiseAbs().sum(), 1.0 + std::abs(z), 1e-9);
  Vec<8> y;
  Mat<8, 18> H;
  model.measure(x, u, y, H);
  EXPECT_EQ(H.col(M::kWheelScale).norm(), 0.0);
}

TEST(MbbrModels, AnalyticJacobiansAreTheDerivatives) {
  const Vec3 u(0.2, -0.1, -0.4);
  Vec<13> x13;
  x13 << 0.05, -0.03, 0.4, 1.0, -2.0, 0.3, 0.2, 6.0, 4.0, -3.0, 0.1, 0.2, 0.3;
  expect_jacobians_match<MbbrPublishedModel, 13, 8>({}, x13, u, 1e-7);
  expect_jacobians_match<MbbrModel13, 13, 8>(MbbrModel13(MbbrParameters{}), x13, u, 1e-7);
  // With a straight mount and no disturbance: their products with small states are left out of F and H.
  Vec<18> x18 = Vec<18>::Zero();
  x18(MbbrEkfModel::kWheelScale) = 0.03;
  x18.head<10>() << 0.05, -0.03, 1.0, -2.0, 0.3, 0.3, 0.2, 6.0, 4.0, -3.0;
  MbbrParameters beside;
  beside.l_a << 0.03, -0.02, 0.13;
  expect_jacobians_match<MbbrEkfModel, 18, 8>(MbbrEkfModel(beside, 1.0), x18, u, 1e-7,
                                              MbbrEkfModel::kWheelScale);
  expect_jacobians_match<MbbrEkfModel, 18, 8>(MbbrEkfModel(beside, 1.0), Vec<18>::Zero(), Vec3::Zero(), 1e-7);
  expect_scale_is_learnt_about_z(MbbrEkfModel(beside, 1.0), x18, u);
  Vec<8> x8;
  x8 << 0.05, -0.03, 1.0, -2.0, 0.3, 0.2, 4.0, -3.0;
  expect_jacobians_match<MbbrLinearModel, 8, 6>(MbbrLinearModel(MbbrParameters{}, true), x8,
                                                Vec3(0.2, -0.1, 6.0), 1e-7);
  expect_jacobians_match<MbbrLinearModel, 8, 6>(MbbrLinearModel::published(), x8, Vec3(0.2, -0.1, 6.0), 1e-7);
}

TEST(MbbrModels, CorrectedModelIsTheExactDynamicsForSmallTilt) {
  const MbbrParameters p;
  const MbbrDynamics exact(p);
  const MbbrEkfModel model(p, 1.0);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int k = 0; k < 50; ++k) {
    const double small = 1e-5;
    Vec<10> x;
    x << small * unit(random), small * unit(random), 0, 0, 0, small * unit(random), small * unit(random),
        6.0 * unit(random), 6.0 * unit(random), 6.0 * unit(random);
    const Vec3 u(unit(random), unit(random), unit(random));
    const MbbrMotion m(x.head<2>(), body_rates(x.head<2>(), x.segment<3>(5)), x.tail<2>());
    const Vec3 tau = p.k1 * u - (p.k2_ball + p.mu_v) * MbbrDynamics::encoder_rate_B(m);
    const MbbrAccelerations a = exact.accelerations(m, tau);
    Vec<10> x_dot;
    Mat<10, 10> A;
    MbbrObservable::derivative(mbbr_coefficients(p), x, u, x_dot, A);
    Vec<5> rates;
    rates << MbbrDynamics::theta_ddot(m, a), MbbrDynamics::phi_star_ddot(m, a);
    EXPECT_LT(test::relative_error(x_dot.tail<5>().eval(), rates), 1e-6);
    EXPECT_LT((MbbrObservable::encoder_rate_B(x) - MbbrDynamics::encoder_rate_B(m)).norm(), 1e-8);
    Vec<8> y;
    Mat<8, 18> H;
    Vec<18> state = Vec<18>::Zero();
    state.head<10>() = x;
    model.measure(state, u, y, H);
    EXPECT_LT((y.head<3>() - m.omega_B).norm(), 1e-8);
    EXPECT_LT((y.tail<2>() - exact.accelerometer_B(m, a).head<2>()).norm(), 1e-6);
  }
}

TEST(MbbrModels, ObservableStatesGiveTheSameEstimatesAsThirteen) {
  const MbbrParameters p;
  const MbbrKinematics kinematics(p);
  const double ratio = p.r / p.r_w;
  KalmanFilter<MbbrEkfModel>::Params observable;
  observable.Q.setZero();
  observable.Q.head<10>() << 1e-8, 1e-8, 2e-8, 2e-8, 2e-8, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3;
  observable.R << 2.08e-6, 2.08e-6, 2.08e-6, Vec3::Constant(1.2e-5 * ratio * ratio), 1.41, 1.41;
  observable.input_variance = Vec3::Constant(0.1);
  KalmanFilter<MbbrModel13>::Params p13;
  p13.Q << 1e-8, 1e-8, 1e-8, 1e-8, 1e-8, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-8, 1e-8, 1e-8;  // sums: two of 1e-8
  p13.R << 2.08e-6, 2.08e-6, 2.08e-6, 1.2e-5, 1.2e-5, 1.2e-5, 1.41, 1.41;
  p13.input_variance = observable.input_variance;
  observable.initial_variance.setZero();
  p13.initial_variance.setZero();
  KalmanFilter<MbbrEkfModel> fewer(MbbrEkfModel(p, 1.0), observable);
  KalmanFilter<MbbrModel13> thirteen(MbbrModel13(p), p13);
  std::array<bool, 8> all;
  all.fill(true);
  for (const auto& row : test::oracle_rows("ekf_published_trace")) {
    const Vec3 u = test::vector_of<3>(row, "u");
    Vec<8> y = test::vector_of<8>(row, "y");
    thirteen.predict(u);
    thirteen.update(u, y, all);
    y.segment<3>(3) = kinematics.wheels_from_ball(y.segment<3>(3));
    fewer.predict(u);
    fewer.update(u, y, all);
    ASSERT_LT((fewer.x().head<2>() - thirteen.x().head<2>()).norm(), 1e-10);
    ASSERT_LT((fewer.x().segment<5>(5) - thirteen.x().segment<5>(5)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace equipoise
