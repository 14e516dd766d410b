/* adc.h: one input of the AM335x ADC through Linux IIO, by the device's name ("TI-am335x-adc").
 * Out: counts, 12 bit, 1.8 V full scale. A read takes a conversion (tens of us) in one system call. */
#ifndef EQUIPOISE_DRIVERS_ADC_H
#define EQUIPOISE_DRIVERS_ADC_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { ADC_MAX_COUNT = 4095 };

typedef struct adc {
  int fd;
} adc_t;

int adc_open(adc_t* adc, const char* device,
             unsigned channel);                  /* -ENODEV: no device; -ENOENT: no such channel */
int adc_read(const adc_t* adc, int32_t* counts); /* -ERANGE: outside 0 .. 4095 */
void adc_close(adc_t* adc);

#ifdef __cplusplus
}
#endif

#endif
