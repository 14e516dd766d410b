// A rigid-body engine written in Python. In: make(dimensions as JSON, in, out) -> (start, step), Python
// functions that read `in` and fill `out` -> out: Engine. Called under Python's lock. Simulation only.
#pragma once

#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <atomic>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "equipoise/plant/engine.hpp"

namespace equipoise::python {

namespace nb = nanobind;

/// Calls Python where nothing may be thrown: what it throws first is thrown after it, and ends the run by
/// `stop`.
class Guarded {
 public:
  explicit Guarded(std::atomic<bool>* stop = nullptr) : stop_(stop) {}

  template <class F>
  void keep(F&& f) {
    try {
      f();
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
      if (stop_ != nullptr) *stop_ = true;
    }
  }
  void rethrow() {
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  std::atomic<bool>* stop_;
  std::exception_ptr failure_;
};

class PythonEngine : public Engine {
 public:
  PythonEngine(const nb::object& make, const nlohmann::json& dimensions, Guarded* guarded)
      : guarded_(*guarded) {
    const auto view = [](auto& numbers) {  // not a copy
      return nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<1>>(numbers.data(), {numbers.size()}),
                      nb::rv_policy::reference);
    };
    const nb::tuple both = nb::cast<nb::tuple>(make(dimensions.dump(), view(in_), view(out_)));
    start_ = both[0];
    step_ = both[1];
  }
  void start(const Mat3& R_WB, EngineMotion* motion) override {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out_.data()) = R_WB;
    start_();
    read(motion);
  }
  void step(const Vec3& torque, const Vec2& push_W_N, const Vec2& drag_W_N, EngineMotion* motion) override {
    Eigen::Map<Vec<7>> in(in_.data());
    in.head<3>() = torque;
    in.segment<2>(3) = push_W_N;
    in.tail<2>() = drag_W_N;
    guarded_.keep([this] { step_(); });
    read(motion);
  }

 private:
  void read(EngineMotion* m) const {
    const double* at = out_.data();
    m->R_WB = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(at);
    at += 9;
    for (Vec3* v : {&m->omega_B_rad_s, &m->specific_force_B_m_s2, &m->joint_rate_rad_s, &m->position_W_m,
                    &m->velocity_W_m_s}) {
      *v = Eigen::Map<const Vec3>(at);
      at += 3;
    }
  }

  Guarded& guarded_;
  std::array<double, 7> in_{};    // joint torques (3), push (2), force on ball or axle (2)
  std::array<double, 24> out_{};  // R_WB by rows, then the vectors of EngineMotion
  nb::object start_, step_;
};

}  // namespace equipoise::python
