// Whoever commands a running robot: signed messages (CommandReceiver), or a device in a hand (app/remote).
// In: the loop's calls -> out: the newest command, its age_s since somebody last asked for it. A remote that
// is lost gets older, and safety ramps the motion to a stop. RT-safe.
#pragma once

#include "equipoise/actuate/safety.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::runtime {

class Remote : NoCopy {
 public:
  virtual ~Remote() = default;

  /// Once per tick.
  virtual Command latest() noexcept = 0;
  /// What safety made of it.
  virtual void tell(ArmState state) noexcept = 0;
};

}  // namespace equipoise::runtime
