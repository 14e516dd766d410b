// What tools/count_instructions counts: one part of the firmware, a given number of times.
// usage: instruction_count ROBOT CONFIG PART TIMES
//   run      ticks of the simulated robot and the pipeline, armed after 100, turning at 1 Hz
//   ticks    the same, and the recorded samples once more through a fresh pipeline
//   alone-run, alone-ticks  the same without the detector and its filters
//   mode-M   ticks in mode M, played again; count_plugin.c looks at the later half of them, which lie between
//            tick_begins() and tick_ends()
//   filters  ticks; says how often the default filter ran, with the bank that looks for a lying encoder
//   plant-F  ticks of the simulated robot alone, F: its fidelity; it starts anew before it has fallen
//   packed   steps of the default filter as it runs
//   dense    the same steps of the same model in KalmanFilter, Eigen
//   bridge   inversions of the drive/coast bridge within its curved region
//   newton   the same by Newton's method from the printed start, [T] (4.30)-(4.34)
// Differences between two numbers of times leave the start out.
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "equipoise/actuate/drive_coast.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/recorded_samples.hpp"
#include "robots/robot_list.hpp"

// Defined here alone, not inlined: the plugin finds them by name.
extern "C" {
[[gnu::noinline]] void tick_begins() { asm volatile(""); }
[[gnu::noinline]] void tick_ends() { asm volatile(""); }
}

namespace equipoise {
namespace {

constexpr int kArmTick = 100;

Command command_at(int tick) {
  Command command;
  command.arm = tick >= kArmTick;
  command.yaw_rate_rad_s = tick > 2 * kArmTick ? 2.0 * kPi : 0.0;
  return command;
}

/// The simulated robot for a number of ticks; its samples are kept.
template <class World>
struct WorldIo {
  World& world;
  std::vector<RawSample>& samples;
  int left;
  MotorCommand motors{};

  int wait_tick(std::int64_t* now_ns) noexcept {
    if (left-- == 0) return -ESHUTDOWN;
    world.advance(motors);
    samples.push_back(world.sense());
    *now_ns = samples.back().t_ns;
    return 0;
  }
  RawSample read() noexcept { return samples.back(); }
  int write(const MotorCommand& command) noexcept {
    motors = command;
    return 0;
  }
  int motors_off() noexcept { return 0; }
};

template <class Firmware>
void ticks(const std::string& file, int times, const std::string& part) {
  Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = Firmware::kDefaultController;
  choice.fidelity = "built2025";  // what earlier counts were taken in
  const bool alone = part.rfind("alone-", 0) == 0;
  const std::vector<std::string> overrides(alone ? 1 : 0, "safety.detection=false");
  const auto config = Firmware::apply(Firmware::load(file, overrides).config, choice);
  runtime::RecordedSamples recording;
  recording.samples.reserve(static_cast<std::size_t>(times));
  auto world = Firmware::world(config, fidelity_level(choice.fidelity), 1);
  const std::atomic<bool> never{false};
  const auto commands = [](std::int64_t tick, std::int64_t) { return command_at(static_cast<int>(tick)); };
  const auto nobody = [](auto&&...) {};
  Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    WorldIo<decltype(world)> io{world, recording.samples, times};
    (void)runtime::run_loop(io, pipeline, commands, nobody, never);
    if (io.motors.enable == 0) throw ConfigError(file + ": the robot is not balancing at the end of the run");
  });
  if (part == "run" || part == "alone-run") return;
  long filters = 0;
  Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    const auto count = [&](auto&&...) { filters += pipeline.estimators().filters(); };
    if (part == "filters") {
      (void)runtime::run_loop(recording, pipeline, commands, count, never);
    } else {
      (void)runtime::run_loop(recording, pipeline, commands, nobody, never);
    }
  });
  if (part == "filters") std::fprintf(stderr, "filters %ld\n", filters);
}

/// What a robot does, and what happens to it in the tick from which on ticks are counted.
struct Mode {
  const char* name;
  double drive_m_s = 0.0;
  double yaw_hz = 0.0;
  int missed = 0;                                                         // ticks, once
  void (*distort)(RawSample& sample, const RawSample& before) = nullptr;  // from then on
};

constexpr Mode kModes[] = {
    {"disarmed"},
    {"arming"},
    {"standing"},
    {"driving", 0.2},
    {"turning", 0.0, 1.0},
    {"fast", 0.1, 3.0},
    {"stall", 0.1, 1.0, 13},  // longer, and the motors are off
    {"no_imu", 0.1, 0.0, 0,
     [](RawSample& s, const RawSample&) { s.valid &= ~static_cast<decltype(s.valid)>(RIO_IMU); }},
    {"encoder", 0.1, 1.0, 0,
     [](RawSample& s, const RawSample& b) { s.encoder_counts[0] = b.encoder_counts[0]; }},
    {"gyro", 0.1, 1.0, 0, [](RawSample& s, const RawSample& b) { s.gyro_counts[0] = b.gyro_counts[0]; }},
};

/// A world in a mode.
template <class World>
struct ModeIo : WorldIo<World> {
  const Mode& mode;
  int from;
  int tick = 0;

  int wait_tick(std::int64_t* now_ns) noexcept {
    if (tick++ == from)
      for (int i = 0; i < mode.missed; ++i) this->world.advance(this->motors);
    const int result = WorldIo<World>::wait_tick(now_ns);
    if (result == 0 && tick > from && mode.distort != nullptr)
      mode.distort(this->samples.back(), this->samples.rbegin()[1]);
    return result;
  }
};

template <class Firmware>
void in_mode(const std::string& file, int times, const std::string& name) {
  const Mode* mode = nullptr;
  for (const Mode& m : kModes) mode = name == m.name ? &m : mode;
  if (mode == nullptr) throw std::runtime_error(name + ": no mode");
  Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = Firmware::kDefaultController;
  choice.fidelity = "built2025";
  const auto config = Firmware::apply(Firmware::load(file, {}).config, choice);
  const auto commands = [mode](std::int64_t tick, std::int64_t) {
    Command command;
    command.arm = mode != kModes && tick >= kArmTick;
    command.velocity_W_m_s.x() = mode->drive_m_s;
    command.yaw_rate_rad_s = tick > 2 * kArmTick ? 2.0 * kPi * mode->yaw_hz : 0.0;
    return command;
  };
  const int from = name == "arming" ? kArmTick : times / 2;
  auto world = Firmware::world(config, fidelity_level(choice.fidelity), 1);
  runtime::RecordedSamples recording;
  recording.samples.reserve(static_cast<std::size_t>(times));
  const std::atomic<bool> never{false};
  Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    ModeIo<decltype(world)> io{{world, recording.samples, times}, *mode, from};
    (void)runtime::run_loop(
        io, pipeline, commands, [](auto&&...) {}, never);
  });
  Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    const auto begins = [&](std::int64_t tick, std::int64_t now_ns) {
      const Command command = commands(tick, now_ns);
      if (tick >= from) tick_begins();
      return command;
    };
    const auto ends = [from](std::int64_t tick, auto&&...) {
      if (tick >= from) tick_ends();
    };
    (void)runtime::run_loop(recording, pipeline, begins, ends, never);
  });
}

template <class Firmware>
void plant(const std::string& file, const std::string& fidelity, int times) {
  constexpr int kEpisode = 80;
  Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = Firmware::kDefaultController;
  choice.fidelity = fidelity;
  const auto config = Firmware::apply(Firmware::load(file, {}).config, choice);
  const auto start = Firmware::world(config, fidelity_level(fidelity), 1);
  auto world = start;
  MotorCommand motors{};
  motors.enable = 1;
  motors.duty[0] = 0.05;
  for (int k = 0; k < times; ++k) {
    if (k % kEpisode == 0) world = start;
    world.advance(motors);
  }
  if (world.time_s() == 0.0) throw std::runtime_error("the plant stood still");
}

template <class Filter>
void steps(Filter filter, int times) {
  constexpr int p = Filter::p;
  constexpr int m = Filter::m;
  std::array<bool, m> use;
  use.fill(true);
  const Vec<p> u = Vec<p>::LinSpaced(0.1, -0.1);
  const Vec<m> y = Vec<m>::LinSpaced(0.02, -0.02);
  for (int k = 0; k < times; ++k) {
    filter.predict(u);
    filter.update(u, y, use);
  }
  if (!filter.x().allFinite()) throw std::runtime_error("the filter diverged");
}

void filter(const std::string& file, const std::string& form, int times, MbbrFirmware /*robot*/) {
  const MbbrConfig config = load_mbbr(file, {}).config;
  const auto& ekf = config.estimators.ekf;
  const MbbrEkfModel model(config.robot, ekf.disturbance_time_constant_s);
  if (form == "dense") return steps(KalmanFilter<MbbrEkfModel>(model, ekf.filter), times);
  steps(MbbrEkf::Filter(model, ekf.filter, ekf.precision), times);
}

void filter(const std::string& file, const std::string& form, int times, MipFirmware /*robot*/) {
  const MipConfig config = load_mip(file, {}).config;
  const auto& ekf = config.estimators.ekf;
  const MipEkfModel model(config.robot, ekf.options, ekf.disturbance_time_constant_s);
  if (form == "dense") return steps(KalmanFilter<MipEkfModel>(model, ekf.filter), times);
  steps(MipEkf::Filter(model, ekf.filter, ekf.precision), times);
}

/// (4.30)-(4.34) as printed, until a step is below 1e-10; forwards. In 20 steps at most.
double newton(double T_r, double omega_r, double i_over_is) {
  double v = std::log(0.5 * (std::exp(T_r) * (1.0 + omega_r) + 1.0 - omega_r)) / (2.0 * T_r);
  for (int i = 0; i < 20; ++i) {
    const double e = std::exp(v * T_r);
    const double current = v * (1.0 - omega_r) +
                           (1.0 + omega_r) / T_r * std::log(e * (1.0 + omega_r) / (2.0 * e - 1.0 + omega_r));
    const double slope = 2.0 * (e - 1.0) * (1.0 - omega_r) / (2.0 * e + omega_r - 1.0);
    const double step = (current - i_over_is) / slope;
    v -= step;
    if (std::abs(step) < 1e-10) break;
  }
  return v;
}

/// Speeds and commands over the region that the robot uses, the same for both.
void bridges(const std::string& how, int times) {
  const double T_r = MotorParameters().T_r();
  const DriveCoastInverse inverse(T_r);
  std::array<std::array<double, 3>, 64> points{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double omega_r = -0.35 + 0.1 * static_cast<double>(i % 8);
    const double v = (0.1 + 0.1 * static_cast<double>(i / 8)) * 0.5 * (1.0 + omega_r);
    points[i] = {omega_r, drive_coast_mean_current(T_r, omega_r, v), v};
  }
  double worst = 0.0;
  const auto run = [&](const auto& solve) {  // nothing else counts
    for (int k = 0; k < times; ++k) {
      const auto& [omega_r, current, v] = points[static_cast<std::size_t>(k) % points.size()];
      const double error = std::abs(solve(omega_r, current) - v);
      if (!(error <= worst)) worst = error;
    }
  };
  if (how == "newton") {
    run([&](double omega_r, double current) { return newton(T_r, omega_r, current); });
  } else {
    run([&](double omega_r, double current) { return inverse.solve(omega_r, current).u; });
  }
  if (!(worst < 1e-6)) throw std::runtime_error(how + ": wrong by " + std::to_string(worst));
}

template <class Firmware>
void count(const std::string& file, const std::string& part, int times) {
  if (part == "run" || part == "ticks" || part == "filters" || part.rfind("alone-", 0) == 0)
    return ticks<Firmware>(file, times, part);
  if (part.rfind("mode-", 0) == 0) return in_mode<Firmware>(file, times, part.substr(5));
  if (part.rfind("plant-", 0) == 0) return plant<Firmware>(file, part.substr(6), times);
  if (part == "packed" || part == "dense") return filter(file, part, times, Firmware{});
  if (part == "bridge" || part == "newton") return bridges(part, times);
  throw std::runtime_error(part +
                           ": no part; run, ticks, alone-run, alone-ticks, mode-MODE, filters, "
                           "plant-FIDELITY, packed, dense, bridge or newton");
}

}  // namespace
}  // namespace equipoise

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: instruction_count ROBOT CONFIG PART TIMES\n");
    return 2;
  }
  try {
    const std::string file = argv[2];
    equipoise::with_robot(argv[1], file, [&](auto firmware) {
      equipoise::count<decltype(firmware)>(file, argv[3], std::atoi(argv[4]));
    });
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "error: %s\n", problem.what());
    return 1;
  }
  return 0;
}
