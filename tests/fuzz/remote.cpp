// Any text is a remote or a ConfigError, and any bytes on the HC-06's line do no more than press its buttons.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "app/remote/frame_device.hpp"
#include "app/remote/frame_learning.hpp"
#include "equipoise/config.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace equipoise::app;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  std::vector<FrameBinding> frames{{HandAction::kForward, "~F\n"}, {HandAction::kArm, "~~A"}};
  try {
    const RemoteFile file = parse_remote(bytes, "fuzz.toml");
    if (file.events.empty() && file.frames.empty()) std::abort();
    if (!file.frames.empty()) frames = file.frames;
  } catch (const equipoise::ConfigError&) {
  }
  FrameMatcher matcher(frames);
  ButtonPad pad(0.5);
  for (const char byte : bytes)
    if (const auto action = matcher.push(byte)) pad.press(*action, 1.0);
  const Hand hand = pad.hand(1.0);
  for (const double share : {hand.forward, hand.left, hand.turn})
    if (!(share >= -1.0 && share <= 1.0)) std::abort();
  if (size < 2) return 0;  // portions are never empty
  const LearntButton learnt = learn_button({{0.0, bytes.substr(0, size / 2)}, {1.0, bytes.substr(size / 2)}});
  if (learnt.error.empty() && (learnt.frame.empty() || learnt.frame.size() > 32)) std::abort();
  return 0;
}
