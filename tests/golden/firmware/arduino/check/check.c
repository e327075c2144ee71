/* The self test of the classifier, for a machine with a console: a few frames with expected predictions from Python. */
#include <stdio.h>
#include "thenar_glove_check.h"

int main(void)
{
    const bool wrong = thenar_glove_check() != 0u;

    (void)puts(wrong ? "predictions differ from Python's" : "18 frames, predicted as by Python");
    return wrong;
}
