/* The self test of the classifier on a Cortex-M0+: "make check" runs it in qemu, a debugger with semihosting on the
   part itself. Replace it by the main() of your glove. */
#include "semihosting.h"
#include "thenar_glove_check.h"

int main(void)
{
    const bool wrong = thenar_glove_check() != 0u;

    semihosting_print(wrong ? "predictions differ from Python's\n" : "18 frames, predicted as by Python\n");
    for (;;) {
        semihosting_exit(wrong);
    }
}
