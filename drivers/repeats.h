/* repeats.h: a live sensor has noise; one that repeats itself is stuck. In: six axes of a sample. Out:
 * whether as many in a row were the same. Real-time safe. */
#ifndef EQUIPOISE_DRIVERS_REPEATS_H
#define EQUIPOISE_DRIVERS_REPEATS_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef struct repeats {
  uint16_t stuck_after; /* identical samples in a row; 0: never */
  uint16_t count;
  int32_t last[6];
} repeats_t;

static inline bool repeats_stuck(repeats_t* repeats, const int32_t axes[6]) {
  if (memcmp(axes, repeats->last, sizeof repeats->last) != 0) {
    repeats->count = 0;
    memcpy(repeats->last, axes, sizeof repeats->last);
  } else if (repeats->count < UINT16_MAX) {
    ++repeats->count;
  }
  return repeats->stuck_after > 0 && repeats->count >= repeats->stuck_after;
}

#endif
