/* A companion computer's program: what a vehicle says over MAVLink 2 goes into the navigator, ODOMETRY comes back. */
#ifndef COMPANION_H
#define COMPANION_H

#include <stdint.h>

#include "flownav.h"
#include "mavlink.h"

/* link.c: where bytes come from and go to. */
struct companion_link {
  int in, out;        /* file descriptors */
  int datagrams;      /* UDP: answers go to whom spoke last */
  struct { unsigned char bytes[32]; unsigned size; } peer;
};
/* "udp:14540" listens; "/dev/ttyUSB0:921600" is a serial line; "-" is standard input and output. 0, or -1 and a message. */
int link_open(struct companion_link *link, const char *name);
/* Up to `room` bytes; 0 at the end, below 0 where it fails. It waits for some. */
long link_read(struct companion_link *link, uint8_t *bytes, unsigned room);
void link_write(struct companion_link *link, const uint8_t *bytes, unsigned count);

/* The program. newest_s: of the vehicle's clock. */
struct companion {
  flownav_nav nav;
  flownav_settings settings;
  flownav_outcome outcome;
  double newest_s, flow_s, origin_deg_m[3], gps_delay_s;
  int has_origin, autopilot;
  uint64_t fix_us;
  unsigned long readings, dropped, resets, told, withheld, damaged, digest_every;
};

/* hearing.c: a message's readings into the navigator. 1 where it was an inertial reading. */
int hear(struct companion *c, const mavlink_message_t *message);

/* telling.c: ODOMETRY of an instant into `frame`; its length, or 0 where the state must not be flown on. */
unsigned tell(struct companion *c, double t_s, uint8_t frame[MAVLINK_MAX_PACKET_LEN]);
unsigned heartbeat(uint8_t frame[MAVLINK_MAX_PACKET_LEN]);

#endif
