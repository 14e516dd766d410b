/* bbb_error.h: fills a bbb_error_t: "motor 2: pwm 48302200 channel 1: no such device (ENODEV): ...". For
 * opening. */
#ifndef EQUIPOISE_DRIVERS_BBB_ERROR_H
#define EQUIPOISE_DRIVERS_BBB_ERROR_H

#include "bbb_config.h"

/* Returns `code`. `what` and `device` name the part and its path or address. */
int bbb_fail(bbb_error_t* error, int code, const char* what, const char* device);
int bbb_explain(bbb_error_t* error, int code, const char* what, const char* device, const char* advice);

#endif
