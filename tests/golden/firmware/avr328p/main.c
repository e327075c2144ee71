/* A program around the classifier, to start from. Where the glove is read, give every kept switch to
   thenar_glove_set_switch(number, closed),
   and every joint's code to thenar_glove_input.codes[joint].
   Their order is that of build.json. */
#include "thenar_glove.h"

static volatile uint8_t recognised; /* for whoever shows or sends it */

int main(void)
{
    for (;;) {
        recognised = thenar_glove_update();
    }
}
