// A filter in single precision beside the one in double precision that balances the robot, on the same
// samples and inputs: standing, driving and turning in turns, so that angles grow without bound.
// EQUIPOISE_PRECISION_S=10800 runs it for hours.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "closed_loop.hpp"

namespace equipoise {
namespace {

/// Io of the loop for one tick.
struct OneSample {
  RawSample raw;
  std::int64_t now_ns;

  int wait_tick(std::int64_t* now) noexcept {
    *now = now_ns;
    return 0;
  }
  RawSample read() noexcept { return raw; }
  int write(const MotorCommand& /*command*/) noexcept { return 0; }
};

/// Of the runtime's pipelines; the one it is derived from is in control.
template <class Pipeline>
class WithShadow : public Pipeline {
 public:
  using Params = typename Pipeline::Params;
  explicit WithShadow(const Params& params)
      : Pipeline(of(params, Precision::kDouble)), single_(of(params, Precision::kSingle)) {}

  typename Pipeline::Result tick(const RawSample& raw, const Command& asked, const LoopState& loop) noexcept {
    single_.applied(this->applied(), this->held());
    OneSample io{raw, loop.now_ns};
    runtime::LoopEnd end;
    runtime::NoSupervisor nobody;
    const auto commands = [&asked](std::int64_t, std::int64_t) { return asked; };
    (void)runtime::run_tick(
        io, single_, commands, [](auto&&...) {}, nobody, &end);
    return Pipeline::tick(raw, asked, loop);
  }
  const auto& in_double() const noexcept { return this->estimators().ekf(); }
  const auto& in_single() const noexcept { return single_.estimators().ekf(); }

 private:
  static Params of(Params params, Precision precision) {
    params.estimators.ekf.precision = precision;
    return params;
  }
  Pipeline single_;
};

double seconds() {
  const char* const asked = std::getenv("EQUIPOISE_PRECISION_S");
  return asked != nullptr ? std::strtod(asked, nullptr) : 100.0;
}

template <class Robot>
class SinglePrecision : public ::testing::Test {};
using Robots = ::testing::Types<ClosedLoopWith<WithShadow<MbbrScheduledPipeline>, MbbrFirmware>,
                                ClosedLoopWith<WithShadow<MipLqrPipeline>, MipFirmware>>;
TYPED_TEST_SUITE(SinglePrecision, Robots);

TYPED_TEST(SinglePrecision, StaysWithinAFifthOfSigma) {
  constexpr double kPhase_s = 10.0;
  constexpr double kReport_s = 600.0;
  const std::array<std::pair<double, double>, 5> phases{
      {{0.0, 0.0}, {0.2, 0.0}, {0.0, 1.0}, {0.1, 1.0}, {-0.2, -0.5}}};  // m/s, turns per second
  TypeParam robot({Fidelity::kBuilt2025, 3});
  robot.balance(2.0);
  const auto& one = robot.pipeline.in_single();
  const auto& two = robot.pipeline.in_double();
  double worst = 0.0;
  Eigen::Index state = 0;
  const long end = std::lround(seconds() * kTickHz);
  const long report = std::lround(std::min(kReport_s, seconds()) * kTickHz);
  for (long k = 1; k <= end; ++k) {
    const double t = static_cast<double>(k) * kTickS;
    const auto& [drive_m_s, yaw_hz] = phases[static_cast<std::size_t>(t / kPhase_s) % phases.size()];
    Command command = TypeParam::armed();
    command.velocity_W_m_s.x() = drive_m_s;
    command.yaw_rate_rad_s = 2.0 * kPi * yaw_hz;
    const auto tick = robot.step(command);
    ASSERT_EQ(tick.arm_state, ArmState::kArmed) << t << " s";
    const auto sigma = two.P().diagonal().cwiseSqrt().eval();
    Eigen::Index largest = 0;
    const double apart = ((one.x() - two.x()).cwiseAbs().array() / sigma.array()).maxCoeff(&largest);
    if (apart > worst) {
      worst = apart;
      state = largest;
    }
    ASSERT_LT(apart, 0.2) << t << " s, state " << largest;
    if (k % report != 0) continue;
    std::printf("%6.0f s: %.1e sigma (state %d), largest angle %.0f rad\n", t, worst, static_cast<int>(state),
                two.x().cwiseAbs().maxCoeff());
    worst = 0.0;
  }
  EXPECT_NE(one.x(), two.x());  // it is single
}

}  // namespace
}  // namespace equipoise
