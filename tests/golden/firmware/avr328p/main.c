/* An initial program around the classifier: read the glove at the comments. */
#include "thenar_glove.h"

static thenar_glove glove;
static volatile thenar_glove_class recognised; /* for the code that shows or sends it */

int main(void)
{
    thenar_glove_init(&glove);
    for (;;) {
        /* thenar_glove_set_switch(&glove, THENAR_GLOVE_SWITCH_..., closed); */
        /* glove.input.codes[THENAR_GLOVE_JOINT_...] = code; */
        recognised = thenar_glove_update(&glove);
    }
}
