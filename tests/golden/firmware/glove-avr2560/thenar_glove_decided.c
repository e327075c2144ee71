/* Early exit of a scan; described in thenar_glove_decided.h.

   thenar 0.1.0, template board/thenar_NAME_decided.c.j2. */
#include "thenar_glove_decided.h"

#ifdef __AVR__
#include <avr/pgmspace.h>
#define IN_FLASH PROGMEM
#define READ(place) pgm_read_word(&(place))
#else
#define IN_FLASH
#define READ(place) (place)
#endif

#define CLASSES 3u
#define LAST_PORT (THENAR_GLOVE_SCANNED_PORTS - 1u)

/* Steps by which the leader (row) must be ahead of a competitor (column) after a port: the most by which the unread
   switches can bring the competitor closer, and one more where it would win a tie. 65535: no lead is enough.

   columns:
   power grip, tip pinch, lateral pinch
*/
static const uint16_t hurdles[LAST_PORT][CLASSES][CLASSES] IN_FLASH = {
    { /* after port 0 */
        /* power grip */
        { 0, 305, 78 },
        /* tip pinch */
        { 711, 0, 346 },
        /* lateral pinch */
        { 976, 797, 0 },
    },
};

bool thenar_glove_decided(
    const thenar_glove *glove, uint8_t port, thenar_glove_class leader)
{
    bool decided = true;

    if (port < LAST_PORT) {
        const uint16_t best = (uint16_t)glove->scores[leader];
        const uint16_t *needed = hurdles[port][leader];

        for (uint16_t competitor = 0u; decided && (competitor < CLASSES); competitor++) {
            const uint16_t lead = (uint16_t)(best - (uint16_t)glove->scores[competitor]);

            decided = lead >= READ(needed[competitor]);
        }
    }
    return decided;
}
