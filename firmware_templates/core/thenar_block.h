/* SPDX-License-Identifier: MIT */
/*
 * thenar_block.h: the sums of eight grasp types, which stay in registers while rows are added; for thenar.c alone.
 *
 * A core of 32 bits takes two entries as one word: the sums of words are the words of the sums, modulo 2^32. They start
 * 32768 too high, so that neither half of the last one is negative. An AVR adds entry after entry.
 */
#ifndef THENAR_BLOCK_H
#define THENAR_BLOCK_H

#include "thenar.h"

#ifdef __AVR__
#include <string.h>

typedef struct {
    uint16_t a, b, c, d, e, f, g, h;
} block;

/* An entry, and a product with one, whose place is in Z: the compiler would compute it anew for each byte. */
#define ADD_ENTRY(sum, row) \
    __asm__("lpm __tmp_reg__, Z+\n\tadd %A0, __tmp_reg__\n\tlpm __tmp_reg__, Z+\n\tadc %B0, __tmp_reg__" \
            : "+r"(sum), "+z"(row))
#define ADD_PRODUCT(sum, slopes) \
    __asm__("lpm %2, Z+\n\tmulsu %2, %3\n\tadd %A0, r0\n\tadc %B0, r1\n\tclr __zero_reg__" \
            : "+r"(sum), "+z"(slopes), "=&a"(slope) : "a"(distance))
#define EIGHT(add, place) \
    add(sums->a, place); add(sums->b, place); add(sums->c, place); add(sums->d, place); \
    add(sums->e, place); add(sums->f, place); add(sums->g, place); add(sums->h, place)

static inline void add_row(block *sums, const int16_t *row)
{
    EIGHT(ADD_ENTRY, row);
}

static inline void add_line(block *sums, uint8_t distance, const int8_t *slopes)
{
    int8_t slope;

    EIGHT(ADD_PRODUCT, slopes);
}

static inline void put(int16_t *scores, const block *sums)
{
    (void)memcpy(scores, sums, sizeof(*sums));
}
#else
typedef struct {
    uint32_t a, b, c, d;
} block;

static inline void add_row(block *sums, const uint32_t *row)
{
    sums->a += row[0];
    sums->b += row[1];
    sums->c += row[2];
    sums->d += row[3];
}

static inline void add_line(block *sums, uint8_t distance, const uint32_t *slopes)
{
    sums->a += distance * slopes[0];
    sums->b += distance * slopes[1];
    sums->c += distance * slopes[2];
    sums->d += distance * slopes[3];
}

static inline void put_pair(int16_t *scores, uint32_t pair)
{
    scores[0] = (int16_t)((int32_t)(pair & 0xffffu) - 32768);
    scores[1] = (int16_t)((int32_t)(pair >> 16) - 32768);
}

static inline void put(int16_t *scores, const block *sums)
{
    put_pair(&scores[0], sums->a);
    put_pair(&scores[2], sums->b);
    put_pair(&scores[4], sums->c);
    put_pair(&scores[6], sums->d);
}
#endif

#endif
