#include "sysfs.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int sysfs_join(char out[SYSFS_PATH_MAX], const char* dir, const char* name) {
  const int n = snprintf(out, SYSFS_PATH_MAX, "%s/%s", dir, name);
  return n < 0 || n >= SYSFS_PATH_MAX ? -ENAMETOOLONG : 0;
}

int sysfs_open(const char* dir, const char* attribute, int flags) {
  char path[SYSFS_PATH_MAX];
  const int status = sysfs_join(path, dir, attribute);
  if (status < 0) return status;
  const int fd = open(path, flags | O_CLOEXEC);
  return fd < 0 ? -errno : fd;
}

int sysfs_read_text(const char* dir, const char* attribute, char* out, size_t size) {
  const int fd = sysfs_open(dir, attribute, O_RDONLY);
  if (fd < 0) return fd;
  const ssize_t n = pread(fd, out, size - 1, 0);
  const int error = errno;
  close(fd);
  if (n < 0) return -error;
  out[n] = '\0';
  out[strcspn(out, "\n")] = '\0';
  return 0;
}

int sysfs_read_number(const char* dir, const char* attribute, int64_t* out) {
  const int fd = sysfs_open(dir, attribute, O_RDONLY);
  if (fd < 0) return fd;
  const int status = sysfs_read_i64(fd, out);
  close(fd);
  return status;
}

static int write_all(int fd, const char* text, size_t length) {
  const ssize_t n = pwrite(fd, text, length, 0);
  if (n < 0) return -errno;
  return (size_t)n == length ? 0 : -EIO;
}

int sysfs_write_text(const char* dir, const char* attribute, const char* text) {
  const int fd = sysfs_open(dir, attribute, O_WRONLY);
  if (fd < 0) return fd;
  const int status = write_all(fd, text, strlen(text));
  close(fd);
  return status;
}

int sysfs_write_number(const char* dir, const char* attribute, uint32_t value) {
  const int fd = sysfs_open(dir, attribute, O_WRONLY);
  if (fd < 0) return fd;
  const int status = sysfs_write_u32(fd, value);
  close(fd);
  return status;
}

int sysfs_write_u32(int fd, uint32_t value) {
  char text[12]; /* digits by hand: snprintf may allocate and takes locale locks */
  char* p = text + sizeof text;
  *--p = '\n';
  do {
    *--p = (char)('0' + value % 10);
    value /= 10;
  } while (value > 0);
  return write_all(fd, p, (size_t)(text + sizeof text - p));
}

int sysfs_read_i64(int fd, int64_t* out) {
  char text[32];
  const ssize_t n = pread(fd, text, sizeof text - 1, 0);
  if (n < 0) return -errno;
  text[n] = '\0';
  const char* p = text;
  const bool negative = *p == '-';
  if (negative) ++p;
  if (*p < '0' || *p > '9') return -EBADMSG;
  uint64_t value = 0; /* 19 digits do not overflow; 64-bit division takes an ARM long */
  for (const char* end = p + 19; *p >= '0' && *p <= '9' && p < end; ++p)
    value = value * 10 + (uint64_t)(*p - '0');
  if ((*p != '\0' && *p != '\n') || value > INT64_MAX) return -EBADMSG;
  *out = negative ? -(int64_t)value : (int64_t)value;
  return 0;
}

/* `text` up to `end` is `device`, or `device` and a dot and more. */
static bool names_device(const char* text, size_t length, const char* device) {
  const size_t n = strlen(device);
  return n > 0 && length >= n && strncmp(text, device, n) == 0 && (length == n || text[n] == '.');
}

static bool path_has_device(const char* path, const char* device) {
  while (*path != '\0') {
    const size_t length = strcspn(path, "/");
    if (names_device(path, length, device)) return true;
    path += length;
    if (*path == '/') ++path;
  }
  return false;
}

static bool entry_is_device(const char* dir, const char* device) {
  char real[PATH_MAX];
  if (realpath(dir, real) != NULL && path_has_device(real, device)) return true;
  char name[64];
  return sysfs_read_text(dir, "name", name, sizeof name) == 0 && names_device(name, strlen(name), device);
}

int sysfs_find(const char* class_dir, const char* prefix, const char* device, char out[SYSFS_PATH_MAX]) {
  DIR* class = opendir(class_dir);
  if (class == NULL) return errno == ENOENT ? -ENODEV : -errno;
  int status = -ENODEV;
  for (const struct dirent* entry = NULL; status < 0 && (entry = readdir(class)) != NULL;) {
    if (entry->d_name[0] == '.' || strncmp(entry->d_name, prefix, strlen(prefix)) != 0) continue;
    if (sysfs_join(out, class_dir, entry->d_name) == 0 && entry_is_device(out, device)) status = 0;
  }
  closedir(class);
  return status;
}
