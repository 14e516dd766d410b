// The shake after arming, on wheels of a lag, a size and a drift that the check does not know.
#include "equipoise/actuate/encoder_check.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <string>

namespace equipoise {
namespace {

constexpr int kWheels = 3;
using Check = EncoderCheck<kWheels>;

struct Shaken {
  EncoderFaults faults;
  int ticks = 0;                       // until the check had ended
  std::array<double, kWheels> most{};  // drive given to each wheel
  std::string senses;                  // of the first wheel's drive, a sign per tick
};

/// `seen`: what the encoders tell, of the wheels' angles. `duty`: what the controller adds.
Shaken shake(
    const std::function<void(Vec<kWheels>&)>& seen, double drive = 0.3,
    const std::function<double(int, int)>& duty = [](int, int) { return 0.0; }) {
  Check check(drive);
  Shaken result;
  Vec<kWheels> at_wheels = Vec<kWheels>::Zero();
  Vec<kWheels> speed = Vec<kWheels>::Zero();
  Vec<kWheels> angle = Vec<kWheels>::Zero();
  int tick = 0;
  do {
    Vec<kWheels> told = angle;
    seen(told);
    const Vec<kWheels> added = check.update(true, at_wheels, told);
    for (int wheel = 0; wheel < kWheels; ++wheel) {
      result.most[static_cast<std::size_t>(wheel)] =
          std::max(result.most[static_cast<std::size_t>(wheel)], std::abs(added(wheel)));
      at_wheels(wheel) = added(wheel) + duty(wheel, tick);
    }
    if (tick < Check::kWindow) result.senses += added(0) > 0.0 ? '+' : added(0) < 0.0 ? '-' : '0';
    angle += 0.2 * (speed + 0.5 * at_wheels);
    angle += Vec<kWheels>::Constant(1e-5 * tick * tick);  // balances meanwhile
    speed = 0.75 * (speed + at_wheels);
    ++tick;
  } while (check.running() && tick < 1000);
  result.faults = check.faults();
  result.ticks = tick;
  return result;
}

void sound(Vec<kWheels>&) {}

TEST(EncoderCheck, ShakesOneWheelAfterTheOtherForthAndBackAndFindsSoundOnesSound) {
  const Shaken shaken = shake(sound);
  EXPECT_EQ(shaken.faults.stuck, 0U);
  EXPECT_EQ(shaken.faults.reversed, 0U);
  EXPECT_EQ(shaken.ticks, 1 + 3 * 18);
  EXPECT_EQ(shaken.senses, "++----++++----++00");
  for (const double most : shaken.most) EXPECT_EQ(most, 0.3);
}

TEST(EncoderCheck, NamesEveryWheelThatIsStuckOrReversed) {
  for (int wheel = 0; wheel < kWheels; ++wheel) {
    const Shaken stuck = shake([wheel](Vec<kWheels>& angle) { angle(wheel) = 17.0; });
    EXPECT_EQ(stuck.faults.stuck, 1U << wheel);
    EXPECT_EQ(stuck.faults.reversed, 0U);
    const Shaken reversed = shake([wheel](Vec<kWheels>& angle) { angle(wheel) *= -1.0; });
    EXPECT_EQ(reversed.faults.stuck, 0U);
    EXPECT_EQ(reversed.faults.reversed, 1U << wheel);
  }
  EXPECT_EQ(shake([](Vec<kWheels>& angle) { angle *= -1.0; }).faults.reversed, 7U);
}

TEST(EncoderCheck, AWheelThatMovesAHundredthOfARadianIsNotStuck) {
  const auto moving = [](double travel_rad) {
    int tick = 0;
    return shake(
        [tick, travel_rad](Vec<kWheels>& angle) mutable { angle(0) = tick++ % 2 == 0 ? 0.0 : travel_rad; });
  };
  EXPECT_EQ(moving(0.0099).faults.stuck, 1U);
  EXPECT_EQ(moving(0.01).faults.stuck, 0U);
  EXPECT_EQ(moving(0.0101).faults.stuck, 0U);
}

TEST(EncoderCheck, TheSizeOfTheAnswerDecidesNothing) {
  for (const double size : {0.1, 1.0, 100.0}) {
    EXPECT_EQ(shake([size](Vec<kWheels>& angle) { angle *= size; }).faults.reversed, 0U) << size;
    EXPECT_EQ(shake([size](Vec<kWheels>& angle) { angle *= -size; }).faults.reversed, 7U) << size;
  }
}

TEST(EncoderCheck, NoiseWithoutAnAnswerIsNotAReversedWheel) {
  constexpr int kStarts = 400;
  for (const double drive : {0.1, 0.3, 1.0}) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> noise(-1.0, 1.0);
    int named = 0;
    for (int start = 0; start < kStarts; ++start) {
      const Shaken shaken = shake([&](Vec<kWheels>& angle) { angle(0) = noise(random); }, drive);
      named += shaken.faults.reversed != 0 ? 1 : 0;
    }
    EXPECT_LT(named, kStarts / 25) << "correlated below -0.6 by chance, at " << drive;
  }
}

/// The verdict needs all of the window: wherever a reading is wild, nothing is left to tell.
TEST(EncoderCheck, EveryReadingOfTheWindowWeighs) {
  for (int wild = 0; wild < Check::kWindow; ++wild) {
    for (const double jump_rad : {-100.0, 100.0}) {
      int call = 0;
      const Shaken shaken = shake([&](Vec<kWheels>& angle) {
        angle(0) *= -1.0;
        if (call++ == 1 + wild) angle(0) += jump_rad;  // a window begins with the second call
      });
      EXPECT_EQ(shaken.faults.reversed, 0U) << wild;
      EXPECT_EQ(shaken.faults.stuck, 0U) << wild;
    }
  }
}

/// A large cubic is what balancing does meanwhile: it decides nothing.
TEST(EncoderCheck, WhatBalancingAddsDecidesNothing) {
  for (const double size : {-3.0, 3.0}) {
    for (const bool reversed : {false, true}) {
      int tick = 0;
      const Shaken shaken = shake([&](Vec<kWheels>& angle) {
        const double t = (tick++ + 17) % 18 / 9.0 - 1.0;  // a window begins with the second call
        if (reversed) angle(1) *= -1.0;
        angle += Vec<kWheels>::Constant(size * (1.0 + t - t * t + t * t * t));
      });
      EXPECT_EQ(shaken.faults.reversed, reversed ? 2U : 0U) << size;
      EXPECT_EQ(shaken.faults.stuck, 0U);
    }
  }
}

/// A controller that is misled by a reversed encoder shakes its wheel itself, before its turn.
TEST(EncoderCheck, AWheelDrivenAsHardIsJudgedBeforeItsTurn) {
  const auto reversed_last = [](Vec<kWheels>& angle) { angle(2) *= -1.0; };
  const auto faults_after_one_window = [&](double amplitude) {
    Check check(0.3);
    Vec<kWheels> at_wheels = Vec<kWheels>::Zero();
    Vec<kWheels> speed = Vec<kWheels>::Zero();
    Vec<kWheels> angle = Vec<kWheels>::Zero();
    for (int tick = 0; tick <= Check::kWindow; ++tick) {
      Vec<kWheels> told = angle;
      reversed_last(told);
      const Vec<kWheels> added = check.update(true, at_wheels, told);
      at_wheels = added;
      at_wheels(2) += amplitude * ((tick + 2) / 4 % 2 == 0 ? 1.0 : -1.0);
      angle += 0.2 * (speed + 0.5 * at_wheels);
      speed = 0.7 * (speed + at_wheels);
    }
    return check.faults().reversed;
  };
  EXPECT_EQ(faults_after_one_window(0.6), 4U);
  EXPECT_EQ(faults_after_one_window(0.15), 0U);  // too little to say
  // Numpy: of duties of 1 the travel less its cubic has squares whose sum has the root 5.326.
  EXPECT_EQ(faults_after_one_window(0.97 * 7.0 * 0.3 / 5.326), 0U);
  EXPECT_EQ(faults_after_one_window(1.03 * 7.0 * 0.3 / 5.326), 4U);
}

TEST(EncoderCheck, DisarmingForgetsAndArmingShakesAnew) {
  Check check(0.3);
  const Vec<kWheels> zero = Vec<kWheels>::Zero();
  for (int tick = 0; tick < 100; ++tick) (void)check.update(true, zero, zero);
  EXPECT_EQ(check.faults().stuck, 7U);
  EXPECT_FALSE(check.running());
  EXPECT_TRUE(check.update(true, zero, zero).isZero(0.0));
  EXPECT_TRUE(check.update(false, zero, zero).isZero(0.0));
  EXPECT_EQ(check.faults().stuck, 0U);
  EXPECT_FALSE(check.running());
  EXPECT_EQ(check.update(true, zero, zero)(0), 0.3);
  EXPECT_TRUE(check.running());
}

TEST(EncoderCheck, WithoutADriveThereIsNone) {
  Check check(0.0);
  const Vec<kWheels> zero = Vec<kWheels>::Zero();
  for (int tick = 0; tick < 100; ++tick) {
    EXPECT_TRUE(check.update(true, zero, zero).isZero(0.0));
    EXPECT_FALSE(check.running());
  }
  EXPECT_EQ(check.faults().stuck, 0U);
}

}  // namespace
}  // namespace equipoise
