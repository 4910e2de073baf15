/* companion LINK [--gps-delay S] [--every S] [--digests N]: a navigator beside an autopilot, over MAVLink 2.

   LINK: udp:14540, /dev/ttyUSB0:921600, or - for standard input and output. Readings of the autopilot's sensors go into
   the flownav library; the state of now goes back as ODOMETRY, on the vehicle's own clock. With --digests a line "readings
   digest" goes to standard error after every N readings, as `flownav verify` takes it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "companion.h"

static struct companion companion;

static int usage(const char *wrong) {
  fprintf(stderr, "companion: %s\nusage: companion udp:PORT|PATH:BAUD|- [--gps-delay S] [--every S] [--digests N]\n", wrong);
  return 2;
}

static void say_digest(const struct companion *c) {
  const uint64_t digest = flownav_digest(&c->nav);
  fprintf(stderr, "%lu %08lx%08lx\n", c->readings, (unsigned long)(digest >> 32), (unsigned long)(digest & 0xFFFFFFFFu));
}

static void run(struct companion *c, struct companion_link *link, double every_s) {
  uint8_t bytes[2048], frame[MAVLINK_MAX_PACKET_LEN];
  mavlink_message_t message;
  mavlink_status_t status;
  double told_s = -1.0, beat_s = -1.0;
  unsigned long next = c->digest_every;
  long count, i;
  memset(&status, 0, sizeof status);
  while ((count = link_read(link, bytes, sizeof bytes)) > 0) {
    for (i = 0; i < count; ++i) {
      if (mavlink_parse_char(MAVLINK_COMM_0, bytes[i], &message, &status) != MAVLINK_FRAMING_OK) continue;
      if (!hear(c, &message)) continue;
      if (c->digest_every > 0 && c->readings >= next) {
        say_digest(c);
        next = c->readings + c->digest_every;
      }
      if (c->newest_s - beat_s >= 1.0 || c->newest_s < beat_s) {
        beat_s = c->newest_s;
        link_write(link, frame, heartbeat(frame));
      }
      if (c->newest_s - told_s >= every_s || c->newest_s < told_s) {
        const unsigned size = tell(c, c->newest_s, frame);
        told_s = c->newest_s;
        if (size > 0) link_write(link, frame, size);
      }
    }
  }
  c->damaged = status.packet_rx_drop_count;
}

int main(int argc, char **argv) {
  struct companion_link link;
  struct companion *c = &companion;
  double every_s = 0.02;
  int i;
  if (argc < 2) return usage("where is the vehicle?");
  c->gps_delay_s = 0.22;
  for (i = 2; i < argc; i += 2) {
    if (i + 1 >= argc) return usage("an option lacks its value");
    if (strcmp(argv[i], "--gps-delay") == 0) c->gps_delay_s = atof(argv[i + 1]);
    else if (strcmp(argv[i], "--every") == 0) every_s = atof(argv[i + 1]);
    else if (strcmp(argv[i], "--digests") == 0) c->digest_every = strtoul(argv[i + 1], NULL, 10);
    else return usage("no such option");
  }
  if (link_open(&link, argv[1]) != 0) return 2;
  c->settings = flownav_default_settings;
  if (flownav_begin(&c->nav, &c->settings) != FLOWNAV_TAKEN) return 1;
  run(c, &link, every_s - 1e-4);
  if (c->digest_every > 0) say_digest(c);
  fprintf(stderr, "companion: %lu readings, %lu dropped; ODOMETRY sent %lu times, withheld %lu\n", c->readings, c->dropped,
          c->told, c->withheld);
  return 0;
}
