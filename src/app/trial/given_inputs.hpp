// What the estimators of one pipeline are given, for those of another that runs beside it with another
// tuning. In: a pipeline -> out: the same with estimators whose inputs can be seen and replaced. Replay only.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "equipoise/pipeline.hpp"

namespace equipoise::app {

/// Estimators that let somebody see, or replace, the input they are given.
template <class Robot, class Base>
class TappedEstimators : public Base {
 public:
  using Base::Base;
  using Tap = std::function<void(Vec<Robot::kInputs>* u, bool* held)>;

  void tap(Tap tap) { tap_ = std::move(tap); }

  const typename Robot::Estimate& update(const typename Robot::Sample& z, const Vec<Robot::kInputs>& u,
                                         bool held) noexcept {
    Vec<Robot::kInputs> given = u;
    bool given_held = held;
    if (tap_) tap_(&given, &given_held);
    return Base::update(z, given, given_held);
  }

 private:
  Tap tap_;
};

template <class P>
struct TappedType;
template <class R, class E, class Reference, class F>
struct TappedType<Pipeline<R, E, Reference, F>> {
  using type = Pipeline<R, TappedEstimators<R, E>, Reference, F>;
};
template <class P>
using Tapped = typename TappedType<P>::type;

template <class P>
typename Tapped<P>::Params tapped(typename P::Params p, bool drives) {
  // What it shakes the wheels with goes nowhere either: no encoder could answer.
  if (!drives) p.safety.encoder_check_drive = 0.0;
  return {p.robot,    p.calibration, p.estimators, p.reference, p.feedback,
          p.friction, p.motor,       p.safety,     p.attitude};
}

/// What the estimators were given in a tick: once, and once more for each tick that the loop had missed.
template <class Input>
class GivenInputs {
 public:
  void begin() noexcept {
    given_.clear();
    taken_ = 0;
  }
  void keep(const Input& u, bool held) { given_.push_back({u, held}); }
  void hand_on(Input* u, bool* held) noexcept {
    if (given_.empty()) return;
    const Given& g = given_[std::min(taken_++, given_.size() - 1)];
    *u = g.u;
    *held = g.held;
  }

 private:
  struct Given {
    Input u;
    bool held;
  };
  std::vector<Given> given_;
  std::size_t taken_ = 0;
};

}  // namespace equipoise::app
