// The guard of one run: a child process that holds the bridge enables of a board and its heartbeat page.
// In: board file -> out: the page to beat on; runtime_error when it does not come up. It ends with this
// process, whatever ends that. Start-up only; create it before threads, and before the board is opened.
#pragma once

#include <sys/types.h>

#include <string>

#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/heartbeat.hpp"

namespace equipoise::app {

class GuardProcess : NoCopy {
 public:
  explicit GuardProcess(const std::string& board_path);
  ~GuardProcess();  // tells it to switch off and waits for that

  runtime::HeartbeatPage& page() noexcept { return heartbeat_.page(); }

 private:
  bool ended(int* status);
  void stop();

  pid_t pid_ = 0;
  runtime::SharedHeartbeat heartbeat_;
};

}  // namespace equipoise::app
