/* serial.h: a UART as raw bytes, 8N1, never blocking: the HC-06 Bluetooth module (9600 baud by default).
 * In: device path, baud rate. Out: bytes read, or -errno: -EAGAIN nothing there, -EIO the other end is gone.
 */
#ifndef EQUIPOISE_DRIVERS_SERIAL_H
#define EQUIPOISE_DRIVERS_SERIAL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct serial {
  int fd;
} serial_t;

int serial_open(serial_t* serial, const char* path,
                uint32_t baud); /* -EINVAL: baud rate not 1200 .. 115200 */
int serial_read(const serial_t* serial, uint8_t* out, size_t size);
int serial_write(const serial_t* serial, const uint8_t* data, size_t size); /* bytes taken, may be fewer */
void serial_close(serial_t* serial);

#ifdef __cplusplus
}
#endif

#endif
