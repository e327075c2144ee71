/* Reads frames from the file "frames" and writes the file "predictions": each prediction is followed by its ticks (32
   bits); before the first come the names of the grasp types and the ticks of a function that does nothing. */
#include "record.h"
#include "semihosting.h"
#include "ticks.h"

/* The compiler is given NAME, a classifier's, and FUNCTION, _classify or _update. */
#define JOINED_AGAIN(name, part) thenar_##name##part
#define JOINED(name, part) JOINED_AGAIN(name, part)
#define NAMED(part) JOINED(NAME, part)

typedef NAMED(_class) predict_function(NAMED() *);

static NAMED(_class) grasp;

void thenar_fault(void);
void thenar_fault(void)
{
    semihosting_print("the program faulted\n");
    for (;;) {
        semihosting_exit(true);
    }
}

/* One instruction. */
__attribute__((naked)) static NAMED(_class) nothing(__attribute__((unused)) NAMED() *unused)
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

    grasp = function(&glove);
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
    const uint32_t frames = semihosting_open("frames", 6, SEMIHOSTING_RB);
    const uint32_t predictions = semihosting_open("predictions", 11, SEMIHOSTING_WB);

    start_ticking();
    put32(prediction, ticks_of(nothing));
    bool whole = true;

    NAMED(_init)(&glove);
    for (unsigned k = 0; k < CLASSES; ++k) {
        const char *const type = NAMED(_grasp)((NAMED(_class))k);

        whole = semihosting_write(predictions, type, name_bytes(type)) && whole;
    }
    whole = semihosting_write(predictions, prediction, 4) && whole;

    while (semihosting_read(frames, frame, sizeof frame)) {
        take_frame(frame);
        put32(prediction + PREDICTION_BYTES, ticks_of(NAMED(FUNCTION)));
        give_prediction(grasp, prediction);
        whole = semihosting_write(predictions, prediction, sizeof prediction) && whole;
    }
    semihosting_exit(!whole);
    return 0;
}
