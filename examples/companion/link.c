/* Bytes of a UDP port, a serial line, or standard input and output. */
#define _DEFAULT_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "companion.h"

static int failed(const char *name, const char *what) {
  fprintf(stderr, "companion: %s: %s (%s)\n", name, what, strerror(errno));
  return -1;
}

static int open_udp(struct companion_link *link, const char *name) {
  struct sockaddr_in own;
  memset(&own, 0, sizeof own);
  own.sin_family = AF_INET;
  own.sin_port = htons((uint16_t)atoi(name + 4));
  own.sin_addr.s_addr = htonl(INADDR_ANY);
  link->in = link->out = socket(AF_INET, SOCK_DGRAM, 0);
  link->datagrams = 1;
  if (link->in < 0 || bind(link->in, (struct sockaddr *)&own, sizeof own) != 0) return failed(name, "cannot listen there");
  return 0;
}

static speed_t speed_of(long baud) {
  switch (baud) {
    case 57600: return B57600;
    case 115200: return B115200;
    case 230400: return B230400;
    case 460800: return B460800;
    case 921600: return B921600;
    default: return B0;
  }
}

static int open_serial(struct companion_link *link, const char *name, const char *colon) {
  char path[256];
  struct termios line;
  const speed_t speed = speed_of(atol(colon + 1));
  const size_t length = (size_t)(colon - name);
  errno = EINVAL;
  if (length >= sizeof path || speed == B0) return failed(name, "PATH:BAUD, 57600 to 921600, is needed");
  memcpy(path, name, length);
  path[length] = 0;
  link->in = link->out = open(path, O_RDWR | O_NOCTTY);
  if (link->in < 0 || tcgetattr(link->in, &line) != 0) return failed(name, "cannot open it");
  cfmakeraw(&line);
  cfsetispeed(&line, speed);
  cfsetospeed(&line, speed);
  line.c_cflag |= CLOCAL | CREAD;
  return tcsetattr(link->in, TCSANOW, &line) == 0 ? 0 : failed(name, "cannot set its speed");
}

int link_open(struct companion_link *link, const char *name) {
  const char *colon = strrchr(name, ':');
  memset(link, 0, sizeof *link);
  if (strcmp(name, "-") == 0) {
    link->in = 0;
    link->out = 1;
    return 0;
  }
  if (strncmp(name, "udp:", 4) == 0) return open_udp(link, name);
  if (colon != NULL) return open_serial(link, name, colon);
  errno = EINVAL;
  return failed(name, "udp:PORT, PATH:BAUD or - is needed");
}

long link_read(struct companion_link *link, uint8_t *bytes, unsigned room) {
  struct sockaddr_in peer;
  socklen_t size = sizeof peer;
  long count;
  if (!link->datagrams) return read(link->in, bytes, room);
  count = recvfrom(link->in, bytes, room, 0, (struct sockaddr *)&peer, &size);
  if (count > 0 && size <= sizeof link->peer.bytes) {
    memcpy(link->peer.bytes, &peer, size);
    link->peer.size = size;
  }
  return count;
}

void link_write(struct companion_link *link, const uint8_t *bytes, unsigned count) {
  long done = 0;
  if (link->datagrams) {
    if (link->peer.size > 0) done = sendto(link->out, bytes, count, 0, (struct sockaddr *)link->peer.bytes, link->peer.size);
  } else {
    done = write(link->out, bytes, count);
  }
  (void)done; /* a frame that is lost is followed by the next */
}
