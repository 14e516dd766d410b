/* sysfs.h: kernel attributes as numbers. In: a class directory and a device's name or address (never its
 * number). Out: directories, kept file descriptors, values. Return 0 (or an fd) or -errno. The functions that
 * take a kept fd are one system call, no allocation; those that take a path are for opening only. */
#ifndef EQUIPOISE_DRIVERS_SYSFS_H
#define EQUIPOISE_DRIVERS_SYSFS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { SYSFS_PATH_MAX = 256 };

/* The first entry of `class_dir` that starts with `prefix` and belongs to `device`: a component of its real
 * path, or its `name` attribute, is `device` or starts with `device` and a dot. -ENODEV: no such device. */
int sysfs_find(const char* class_dir, const char* prefix, const char* device, char out[SYSFS_PATH_MAX]);

int sysfs_join(char out[SYSFS_PATH_MAX], const char* dir, const char* name);
int sysfs_open(const char* dir, const char* attribute, int flags); /* fd or -errno */
int sysfs_read_text(const char* dir, const char* attribute, char* out, size_t size);
int sysfs_read_number(const char* dir, const char* attribute, int64_t* out);
int sysfs_write_text(const char* dir, const char* attribute, const char* text);
int sysfs_write_number(const char* dir, const char* attribute, uint32_t value);

int sysfs_read_i64(int fd, int64_t* out); /* -EBADMSG: not a number */
int sysfs_write_u32(int fd, uint32_t value);

#ifdef __cplusplus
}
#endif

#endif
