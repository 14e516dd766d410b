// A robot under a person's hands: calibration and bring-up look and pulse through the hardware boundary.
// In: open backend, someone to ask -> out: samples, averages. Motors are off after every call but drive(), in
// the destructor, and whenever an exception leaves; Ctrl-C is such an exception. Not RT-safe.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

#include "app/io/hardware.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/heartbeat.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

/// The robot or the person did not do what the job needs: exit code 1, nothing is written.
struct JobError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What the person is asked to do: the text for them, the rest for a simulated hand.
struct Request {
  enum Act { kLookAtWheel, kFaceUp, kUpright, kTip, kTurnWheel };
  Act act;
  std::string text;
  int index = 0;  // face, wheel or motor
  int turns = 0;
};

/// Says it and waits; false: the person wants to stop. What was typed goes to `answer`.
using Ask = std::function<bool(const Request& request, std::string* answer)>;

/// Means of samples in counts, sensor axes, and the gyro's spread.
struct Stillness {
  Vec3 gyro = Vec3::Zero();
  Vec3 gyro_sigma = Vec3::Zero();
  Vec3 accel = Vec3::Zero();
  Vec3 gyro_drift = Vec3::Zero();                   // second half's mean minus the first half's
  std::array<double, kMaxMotors> encoder_travel{};  // largest minus smallest count
  double temperature_degC = 0.0;                    // 0: unknown
};

class ManualDrive : NoCopy {
 public:
  /// `heartbeat`: of the guard that holds the bridges; nullptr: nobody does.
  ManualDrive(rio_t io, Ask ask, runtime::HeartbeatPage* heartbeat = nullptr)
      : hardware_(io), ask_(std::move(ask)), heartbeat_(heartbeat) {}
  ~ManualDrive() { (void)motors_off(); }

  /// Next tick's sample, all of it valid; JobError after a few that are not, or after Ctrl-C.
  RawSample sample();
  /// As sample(), under these duties. The motors stay on until the next call of anything else.
  RawSample drive(const std::array<double, kMaxMotors>& duty);
  void off();
  /// Waits with motors off.
  void rest(double seconds);
  Stillness hold_still(double seconds);
  /// JobError when the person stops.
  std::string ask(const Request& request);

 private:
  RawSample next();
  int motors_off() noexcept;
  /// Once per tick; JobError when the guard is dead.
  void beat();

  Hardware hardware_;
  Ask ask_;
  runtime::HeartbeatPage* heartbeat_;
  double temperature_degC_ = 0.0;
};

}  // namespace equipoise::app
