// What the drivers wrote, in order, which files they hold open, and system calls that fail on demand. In:
// nothing, it listens to open, close, read, pread and pwrite (linked with --wrap) and to fake_gpio. Out: a
// journal of "name=value" lines. Not thread-safe: one driver thread.
#pragma once

#include <functional>
#include <map>
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
  void failOpen(const std::string& path_end, int error, int times = 1);

  // What the kernel does when a file whose path ends in `path_end` has been written.
  void onWrite(const std::string& path_end, std::function<void()> answer);

  // Files opened and not closed by the drivers and the test, and closes of anything else. Descriptors of the
  // emulated bus are not among them: its threads open and close theirs when they like.
  int openFiles() const { return static_cast<int>(open_.size()); }
  int strayCloses() const { return stray_closes_; }
  int inheritable() const { return inheritable_; }  // files that a program started meanwhile would inherit

  // For the wrappers.
  bool isOpen(int fd) const { return open_.count(fd) != 0; }
  void opened(int fd, const std::string& path = "") { open_[fd] = path; }
  std::string pathOf(int fd) const { return open_.at(fd); }  // as it was asked for
  void openedInheritable() { ++inheritable_; }
  void closed(int fd) { stray_closes_ += open_.erase(fd) == 0 ? 1 : 0; }

  // For the wrappers: whether to fail, and with what.
  enum class Call { kOpen, kRead, kWrite };
  bool takeFailure(Call call, const std::string& path, int* error);
  void written(const std::string& path) const;

 private:
  struct Failure {
    Call call;
    std::string path_end;
    int error;
    int times;
  };
  std::vector<std::string> lines_;
  std::vector<Failure> failures_;
  std::vector<std::pair<std::string, std::function<void()>>> answers_;  // by the path's end
  std::map<int, std::string> open_;
  int stray_closes_ = 0;
  int inheritable_ = 0;
};

// A process that was started without standard input: the next file that it opens is descriptor 0.
class NoStdin {
 public:
  NoStdin();
  ~NoStdin();
  NoStdin(const NoStdin&) = delete;
  NoStdin& operator=(const NoStdin&) = delete;
};
