// A raw CAN socket without a bus, linked in place of the system calls that can_open makes: errors on demand,
// and what was asked for. Plays only while `plays` is set.
#pragma once

#include <linux/can.h>
#include <linux/can/error.h>
#include <net/if.h>

#include <string>

struct FakeCan {
  static FakeCan& instance();

  bool plays = false;
  int socket_error = 0, index_error = 0, flags_error = 0, option_error = 0, bind_error = 0;  // errno
  short flags = IFF_UP;
  int fd = -1, type = 0, protocol = 0;
  std::string interface;
  can_err_mask_t errors = 0;
  sockaddr_can address{};
};
