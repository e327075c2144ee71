/* Reads frames from the file "frames" and writes the file "predictions": each prediction is followed by its ticks (32
   bits); before the first come the names of the grasp types and the ticks of a function that does nothing. */
#include "record.h"
#include "semihosting.h"
#include "ticks.h"

typedef uint16_t predict_function(thenar *);

static uint16_t grasp;

void thenar_fault(void);
void thenar_fault(void)
{
    semihosting_print("the program faulted\n");
    for (;;) {
        semihosting_exit(true);
    }
}

/* One instruction. */
__attribute__((naked)) static uint16_t nothing(__attribute__((unused)) thenar *unused)
{
#ifdef __riscv
    __asm volatile("ret");
#else
    __asm volatile("bx lr");
#endif
}

__attribute__((noinline, noclone)) static uint32_t ticks_of(predict_function *function)
{
    const uint32_t before = ticks_left();

    grasp = function(&hand);
    return (before - ticks_left()) & TICKS_MOST;
}

static void put32(uint8_t *to, uint32_t word)
{
    (void)put16(put16(to, (uint16_t)(word & 0xffffu)), (uint16_t)(word >> 16));
}

int main(void)
{
    static uint8_t frame[FRAME_BYTES];
    static uint8_t prediction[PREDICTION_BYTES + 4u];
    static char text[NAME_BYTES];
    const uint32_t frames = semihosting_open("frames", 6, SEMIHOSTING_RB);
    const uint32_t predictions = semihosting_open("predictions", 11, SEMIHOSTING_WB);

    start_ticking();
    put32(prediction, ticks_of(nothing));
    bool whole = true;

    thenar_init(&hand, MODEL, memory);
    for (unsigned k = 0; k < CLASSES; ++k) {
        const unsigned bytes = thenar_name(MODEL, (uint16_t)k, text, NAME_BYTES) + 1u;

        whole = semihosting_write(predictions, text, bytes) && whole;
    }
    whole = semihosting_write(predictions, prediction, 4) && whole;

    while (semihosting_read(frames, frame, sizeof frame)) {
        take_frame(frame);
        put32(prediction + PREDICTION_BYTES, ticks_of(thenar_classify));
        give_prediction(grasp, prediction);
        whole = semihosting_write(predictions, prediction, sizeof prediction) && whole;
    }
    semihosting_exit(!whole);
    return 0;
}
