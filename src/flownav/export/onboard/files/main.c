/* The navigator takes the readings of one flight and says after every so many the digest of all it knows. Where all
   digests are those that flownav computed, this processor navigates as flownav's replay does, to the bit.

   Where there is no console (-DFLOWNAV_NO_CONSOLE) the result is main's: 0, or the number of the first that differs. */
#include "flownav.h"
#include "flownav_vectors.h"

#ifndef FLOWNAV_NO_CONSOLE
#include <stdio.h>
#endif

static flownav_nav nav;
static flownav_outcome outcome;
static flownav_state state;

int main(void) {
  unsigned i, step = 0;
  int first_wrong = 0;
  flownav_begin(&nav, &flownav_default_settings);
  for (i = 0; i < FLOWNAV_VECTORS; ++i) {
    const flownav_vector *given = &flownav_vectors[i];
    flownav_take(&nav, &flownav_default_settings, given->t_s, (int)given->sensor, &given->reading, &outcome);
    if ((i + 1) % FLOWNAV_VECTORS_A_DIGEST == 0) {
      const uint64_t found = flownav_digest(&nav);
      const int right = found == flownav_vector_digests[step];
      if (!right && first_wrong == 0) first_wrong = (int)step + 1;
      step += 1;
#ifndef FLOWNAV_NO_CONSOLE
      printf("%u %08lx%08lx %s\n", i + 1, (unsigned long)(found >> 32), (unsigned long)(found & 0xFFFFFFFFu),
             right ? "" : "differs");
#endif
    }
  }
  if (flownav_now(&nav, &flownav_default_settings, flownav_vectors[FLOWNAV_VECTORS - 1].t_s, &state) == FLOWNAV_TOLD) {
#ifndef FLOWNAV_NO_CONSOLE
    printf("at %.3f s: north %.3f, east %.3f, down %.3f m; aided %.2f s ago\n", state.t_s, state.pos_ned_m[0],
           state.pos_ned_m[1], state.pos_ned_m[2], state.aid_age_s);
#endif
  }
  return first_wrong;
}
