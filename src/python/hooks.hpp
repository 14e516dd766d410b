// A robot's pipeline with somebody else's estimator or feedback in place of its own, in simulation. In:
// functions of a tick -> out: the pipeline, otherwise unchanged; a function that is absent leaves what stands
// there. The own stages run on beside them. Not for the robot: the functions may allocate and wait.
#pragma once

#include <functional>

#include "equipoise/pipeline.hpp"

namespace equipoise::app {

template <class Robot>
using EstimatorHook =
    std::function<typename Robot::Estimate(const typename Robot::Sample& z, const Vec<Robot::kInputs>& u,
                                           bool held, const typename Robot::Estimate& own)>;

/// `own()`: what the robot's feedback would do; who never asks does not pay for it.
template <class Robot>
using OwnFeedback = std::function<Vec<Robot::kInputs>()>;
template <class Robot, class Reference>
using FeedbackHook = std::function<Vec<Robot::kInputs>(const Reference&, const OwnFeedback<Robot>& own)>;

template <class Robot, class Base>
class HookedEstimators : public Base {
 public:
  using Base::Base;

  void replace(EstimatorHook<Robot> hook) { hook_ = std::move(hook); }

  const typename Robot::Estimate& update(const typename Robot::Sample& z, const Vec<Robot::kInputs>& u,
                                         bool held) noexcept {
    x_hat_ = Base::update(z, u, held);
    if (hook_) x_hat_ = hook_(z, u, held, x_hat_);
    return x_hat_;
  }
  bool reads_attitude() const noexcept { return hook_ || Base::reads_attitude(); }
  /// Of the last tick.
  const typename Robot::Estimate& controlling() const noexcept { return x_hat_; }

 private:
  EstimatorHook<Robot> hook_;
  typename Robot::Estimate x_hat_{};
};

template <class Robot, class Reference, class Base>
class HookedFeedback {
 public:
  static constexpr bool kSharesDuty = Base::kSharesDuty;
  struct Params {
    typename Base::Params own;
    FeedbackHook<Robot, Reference> hook;
  };
  explicit HookedFeedback(const Params& params) : own_(params.own), hook_(params.hook) {}

  Vec<Robot::kInputs> update(const Reference& reference) noexcept {
    if (!hook_) return own_.update(reference);
    return hook_(reference, [&] { return own_.update(reference); });
  }

 private:
  Base own_;
  FeedbackHook<Robot, Reference> hook_;
};

template <class P>
struct HookedType;
template <class R, class E, class Reference, class F>
struct HookedType<Pipeline<R, E, Reference, F>> {
  using Feedback = FeedbackHook<R, typename Reference::Reference>;
  using type =
      Pipeline<R, HookedEstimators<R, E>, Reference, HookedFeedback<R, typename Reference::Reference, F>>;
};
template <class P>
using Hooked = typename HookedType<P>::type;

/// What `Hooked<P>` is built from.
template <class P>
typename Hooked<P>::Params hooked(const typename P::Params& p, typename HookedType<P>::Feedback feedback) {
  return {p.robot,    p.calibration, p.estimators, p.reference, {p.feedback, std::move(feedback)},
          p.friction, p.motor,       p.safety,     p.attitude};
}

}  // namespace equipoise::app
