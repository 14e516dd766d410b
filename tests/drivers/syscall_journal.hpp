// What the drivers wrote, in order, and system calls that fail on demand. In: nothing, it listens to pread
// and pwrite (linked with --wrap) and to fake_gpio. Out: a journal of "name=value" lines. Not thread-safe:
// one driver thread.
#pragma once

#include <string>
#include <vector>

class SyscallJournal {
 public:
  static SyscallJournal& instance();

  void clear();
  void note(const std::string& line) { lines_.push_back(line); }
  const std::vector<std::string>& lines() const { return lines_; }

  // The next `times` calls on a file whose path ends in `path_end` fail with `error` (0: they transfer
  // nothing).
  void failRead(const std::string& path_end, int error, int times = 1);
  void failWrite(const std::string& path_end, int error, int times = 1);

  // For the wrappers: whether to fail, and with what.
  bool takeFailure(bool write, const std::string& path, int* error);

 private:
  struct Failure {
    bool write;
    std::string path_end;
    int error;
    int times;
  };
  std::vector<std::string> lines_;
  std::vector<Failure> failures_;
};
