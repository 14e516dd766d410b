// drivers/gpio.h without a kernel, linked in its place: levels by chip and line, errors and edges on demand.
// Every gpio_set goes into the SyscallJournal as "chip:line=level".
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>

class FakeGpio {
 public:
  using Key = std::pair<std::string, unsigned>;
  struct Line {
    bool held = false;
    bool output = false;
    bool active_low = false;
    bool active = false;
    int edge = -1;       // of an edge line: gpio_edge
    int open_error = 0;  // negative errno
    int use_error = 0;
  };

  static FakeGpio& instance();
  void clear();
  Line& line(const std::string& chip, unsigned offset) { return lines_[{chip, offset}]; }
  const std::map<Key, Line>& lines() const { return lines_; }
  int heldLines() const;

  std::deque<int64_t> edges_ns;  // pending edges of the one edge line
  int edge_error = 0;            // what waiting returns instead
  int64_t last_deadline_ns = 0;

 private:
  std::map<Key, Line> lines_;
};
