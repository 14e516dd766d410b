/* serial.h: a UART as raw bytes, 8N1, never blocking: the HC-06 Bluetooth module (9600 baud by default).
 * In: the port's address ("48022000", whatever the kernel numbers it) or path, baud rate. Out: bytes read, or
 * -errno: -EAGAIN nothing there, -EIO the other end is gone. */
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

/* -EINVAL: baud rate not 1200 .. 115200; -ENODEV: no port at this address */
int serial_open(serial_t* serial, const char* port, uint32_t baud);
int serial_read(const serial_t* serial, uint8_t* out, size_t size);
int serial_write(const serial_t* serial, const uint8_t* data, size_t size); /* bytes taken, may be fewer */
void serial_close(serial_t* serial);

#ifdef __cplusplus
}
#endif

#endif
