// While the object lives, rename() fails with this error. Stands before libc's rename() in the program of the
// one source that includes it.
#pragma once

#include <fcntl.h>

#include <cerrno>
#include <cstdio>

namespace equipoise {

inline int rename_error = 0;  // 0: it works

class FailingRename {
 public:
  explicit FailingRename(int error) { rename_error = error; }
  ~FailingRename() { rename_error = 0; }
  FailingRename(const FailingRename&) = delete;
  FailingRename& operator=(const FailingRename&) = delete;
};

}  // namespace equipoise

extern "C" int rename(const char* from, const char* to) noexcept {
  if (equipoise::rename_error == 0) return renameat(AT_FDCWD, from, AT_FDCWD, to);
  errno = equipoise::rename_error;
  return -1;
}
