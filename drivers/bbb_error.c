#define _GNU_SOURCE /* strerrorname_np */
#include "bbb_error.h"

#include <stdio.h>
#include <string.h>

/* What an owner can do about it; NULL where the error's own text says it. */
static const char* hint(int code) {
  switch (code) {
    case -ENODEV:
      return "driver or device tree node missing, or chip not answering as itself";
    case -ENXIO:
    case -EREMOTEIO:
      return "chip does not acknowledge: power, wiring, address";
    case -EBUSY:
      return "held by another process or a kernel driver";
    case -EACCES:
    case -EPERM:
      return "no permission: group or udev rule";
    case -EILSEQ:
      return "firmware read-back differs";
    case -ENODATA:
    case -EFBIG:
      return "DMP firmware must be exactly 3062 bytes";
    case -EINVAL:
      return "value refused: range, or a period that differs from the other channel of the module";
    default:
      return NULL;
  }
}

int bbb_explain(bbb_error_t* error, int code, const char* what, const char* device, const char* advice) {
  if (error == NULL) return code;
  error->code = code;
  const char* name = strerrorname_np(-code);
  snprintf(error->text, sizeof error->text, "%s: %s: %s (%s)%s%s", what, device, strerror(-code),
           name == NULL ? "?" : name, advice == NULL ? "" : ": ", advice == NULL ? "" : advice);
  return code;
}

int bbb_fail(bbb_error_t* error, int code, const char* what, const char* device) {
  return bbb_explain(error, code, what, device, hint(code));
}
