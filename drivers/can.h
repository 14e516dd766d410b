/* can.h: classic CAN through a SocketCAN raw socket, never blocking, with the bus state from error frames.
 * In: the controller's address ("481d0000") or its interface's name, frames. Out: frames; 0 or -errno. A full
 * transmit queue (-ENOBUFS) is normal under load: the frame is counted and dropped. D_CAN of the AM335x is
 * classic CAN only, so FD frames are not enabled. */
#ifndef EQUIPOISE_DRIVERS_CAN_H
#define EQUIPOISE_DRIVERS_CAN_H

#include <linux/can.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum can_bus_state { CAN_BUS_ACTIVE, CAN_BUS_WARNING, CAN_BUS_PASSIVE, CAN_BUS_OFF };

typedef struct can_port {
  int fd;
  enum can_bus_state state;
  uint8_t tx_errors; /* the controller's error counters, where it reports them */
  uint8_t rx_errors;
  uint32_t dropped;     /* frames not sent: queue full */
  uint32_t bus_offs;    /* times the bus was lost */
  uint32_t rx_overruns; /* frames the controller lost */
} can_port_t;

/* -ENODEV: no such interface; -ENETDOWN: not up */
int can_open(can_port_t* port, const char* interface);

/* -ENOBUFS or -EAGAIN: dropped and counted; -ENETDOWN: interface down; -EINVAL: longer than 8 bytes. While
 * the bus is off the kernel drops what it takes: the state tells. */
int can_send(can_port_t* port, const struct can_frame* frame);

/* 0: *out is a data or remote frame; -EAGAIN: none. Error frames update the state and are not returned; at
 * most 64 are taken per call. */
int can_receive(can_port_t* port, struct can_frame* out);

void can_update_state(can_port_t* port, const struct can_frame* error); /* pure */
void can_close(can_port_t* port);

#ifdef __cplusplus
}
#endif

#endif
