#include "can.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "sysfs.h"

enum { ERROR_FRAMES_PER_CALL = 64 };

static int check_interface(int fd, const char* interface, int* index) {
  struct ifreq request;
  memset(&request, 0, sizeof request);
  /* DCAN1 alone is can0, beside DCAN0 can1: its address says which. */
  char dir[SYSFS_PATH_MAX];
  const char* name = interface;
  if (sysfs_find("/sys/class/net", "", interface, dir) == 0) name = strrchr(dir, '/') + 1;
  if (strlen(name) >= sizeof request.ifr_name) return -ENODEV;
  memcpy(request.ifr_name, name, strlen(name));
  if (ioctl(fd, SIOCGIFINDEX, &request) < 0) return -errno;
  *index = request.ifr_ifindex;
  if (ioctl(fd, SIOCGIFFLAGS, &request) < 0) return -errno;
  return (request.ifr_flags & IFF_UP) != 0 ? 0 : -ENETDOWN;
}

int can_open(can_port_t* port, const char* interface) {
  memset(port, 0, sizeof *port);
  port->fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (port->fd < 0) return -errno;
  struct sockaddr_can address;
  memset(&address, 0, sizeof address);
  address.can_family = AF_CAN;
  int status = check_interface(port->fd, interface, &address.can_ifindex);
  const can_err_mask_t errors =
      CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_ACK | CAN_ERR_TX_TIMEOUT;
  if (status == 0 && setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) < 0)
    status = -errno;
  if (status == 0 && bind(port->fd, (const struct sockaddr*)&address, sizeof address) < 0) status = -errno;
  if (status < 0) can_close(port);
  return status;
}

int can_send(can_port_t* port, const struct can_frame* frame) {
  if (frame->can_dlc > CAN_MAX_DLEN) return -EINVAL;
  const ssize_t n = write(port->fd, frame, sizeof *frame);
  if (n == (ssize_t)sizeof *frame) return 0;
  const int status = n < 0 ? -errno : -EIO;
  if (status == -ENOBUFS || status == -EAGAIN) ++port->dropped;
  return status;
}

void can_update_state(can_port_t* port, const struct can_frame* error) {
  const uint8_t controller = error->data[1];
  if ((error->can_id & CAN_ERR_BUSOFF) != 0) {
    if (port->state != CAN_BUS_OFF) ++port->bus_offs;
    port->state = CAN_BUS_OFF;
    return;
  }
  if ((error->can_id & CAN_ERR_RESTARTED) != 0) port->state = CAN_BUS_ACTIVE;
  if ((error->can_id & CAN_ERR_CRTL) == 0) return;
  if ((controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++port->rx_overruns;
  if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    port->state = CAN_BUS_PASSIVE;
  } else if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
    port->state = CAN_BUS_WARNING;
  } else if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) {
    port->state = CAN_BUS_ACTIVE;
  }
  port->tx_errors = error->data[6];
  port->rx_errors = error->data[7];
}

int can_receive(can_port_t* port, struct can_frame* out) {
  for (int i = 0; i < ERROR_FRAMES_PER_CALL; ++i) {
    struct can_frame frame;
    const ssize_t n = read(port->fd, &frame, sizeof frame);
    if (n < 0) return -errno;
    if (n != (ssize_t)sizeof frame || frame.can_dlc > CAN_MAX_DLEN) return -EBADMSG;
    if ((frame.can_id & CAN_ERR_FLAG) == 0) {
      *out = frame;
      return 0;
    }
    can_update_state(port, &frame);
  }
  return -EAGAIN;
}

void can_close(can_port_t* port) {
  if (port->fd >= 0) close(port->fd);
  port->fd = -1;
}
