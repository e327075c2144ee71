/* thenar_glove_avr.S: the adding up, on an AVR; the .c holds the tables.
   Layout for atmega2560: 16-bit entries, up to 6 switches a look-up, codes compared with thresholds, up to 2 joints
   a look-up, rows added in line: the fastest of 108 layouts in 49152 bytes of flash, at most 137 cycles (284 by
   update()) and 1648 bytes.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME_avr.S.j2. */

/* While rows are added, the sums of 3 classes stay in registers; Z, r31:r30, is where a row is read, and r0 and r1
   hold what is read and multiplied. Inputs come from fixed addresses, for no register is left to point at them. */

#define STRIDE 6 /* bytes of a row */

/* Make Z the address of the row whose number is in register `number`, of those that begin at `rows`. */
.macro to_row rows, number
    ldi   r31, STRIDE
    mul   \number, r31
    movw  r30, r0
    subi  r30, lo8(-(thenar_glove_rows + \rows))
    sbci  r31, hi8(-(thenar_glove_rows + \rows))
.endm

/* Add the row at Z to the sums. */
.macro add_row
    lpm   r0, Z+
    add   r18, r0
    lpm   r0, Z+
    adc   r19, r0
    lpm   r0, Z+
    add   r20, r0
    lpm   r0, Z+
    adc   r21, r0
    lpm   r0, Z+
    add   r22, r0
    lpm   r0, Z+
    adc   r23, r0
.endm

/* Subtract the row at Z from the sums. */
.macro subtract_row
    lpm   r0, Z+
    sub   r18, r0
    lpm   r0, Z+
    sbc   r19, r0
    lpm   r0, Z+
    sub   r20, r0
    lpm   r0, Z+
    sbc   r21, r0
    lpm   r0, Z+
    sub   r22, r0
    lpm   r0, Z+
    sbc   r23, r0
.endm

.macro keep_registers
.endm

.macro store_sums scores
    ldi   r30, lo8(thenar_glove_scores + \scores)
    ldi   r31, hi8(thenar_glove_scores + \scores)
    st    Z+, r18
    st    Z+, r19
    st    Z+, r20
    st    Z+, r21
    st    Z+, r22
    st    Z+, r23
.endm

.macro load_sums scores
    ldi   r30, lo8(thenar_glove_scores + \scores)
    ldi   r31, hi8(thenar_glove_scores + \scores)
    ldd   r18, Z+0
    ldd   r19, Z+1
    ldd   r20, Z+2
    ldd   r21, Z+3
    ldd   r22, Z+4
    ldd   r23, Z+5
.endm

/* Where an input is missing, have it left out and load the sums as they begin then; else go on at 1. */
.macro start_if_missing scores
    lds   r30, thenar_glove_missing
    tst   r30
    breq  1f /* 0 times */
    ldi   r26, lo8(\scores)
    ldi   r27, hi8(\scores)
    lds   r30, thenar_glove_stand_in
    lds   r31, thenar_glove_stand_in + 1
    icall
.endm

/* What the scores are of: the rows that are in them, and joints' codes. When the program begins, all inputs
   are 0, and the scores are initialised accordingly. */
    .section .data.thenar_glove_seen, "aw", @progbits
thenar_glove_seen:
    .byte 0, 11
    .zero 2

    .section .text.thenar_glove_classify, "ax", @progbits

    .global thenar_glove_classify
    .type thenar_glove_classify, @function
thenar_glove_classify:
#ifdef __AVR_HAVE_ELPM__
    /* Tables beyond the first 64 KiB would be misread: stop. */
    ldi   r30, hh8(thenar_glove_rows + 455)
    cpse  r30, r1
    jmp   abort
#endif
    keep_registers

    start_if_missing 0
    rjmp  2f
1:
    ldi   r18, lo8(120) /* power grip */
    ldi   r19, hi8(120)
    ldi   r20, lo8(-40) /* tip pinch */
    ldi   r21, hi8(-40)
    ldi   r22, lo8(7) /* lateral pinch */
    ldi   r23, hi8(7)
2:

    /* switches 0 to 5 */
    lds   r30, thenar_glove_input + 0
    andi  r30, 0x3f
    sts   thenar_glove_seen + 0, r30
    to_row 0, r30
    add_row

    /* thumb_rotation, index_pij */
    lds   r30, thenar_glove_input + 2
    sts   thenar_glove_seen + 3, r30
    clr   r0
    clr   r1
    cpi   r30, lo8(91)
    adc   r0, r1
    cpi   r30, lo8(201)
    adc   r0, r1
    lds   r30, thenar_glove_input + 1
    sts   thenar_glove_seen + 2, r30
    lsl   r0
    lsl   r0
    cpi   r30, lo8(61)
    adc   r0, r1
    cpi   r30, lo8(62)
    adc   r0, r1
    cpi   r30, lo8(141)
    adc   r0, r1
    sts   thenar_glove_seen + 1, r0
    to_row 384, r0
    add_row

    store_sums 0

/* Return the first class whose score is largest; the sums are still in their registers. */
thenar_glove_answer:
    movw  r0, r18
    ldi   r30, 0
    cp    r0, r20
    cpc   r1, r21
    brge  1f
    movw  r0, r20
    ldi   r30, 1
1:
    cp    r0, r22
    cpc   r1, r23
    brge  1f
    movw  r0, r22
    ldi   r30, 2
1:
    mov   r24, r30
    clr   r1
    ret
    .size thenar_glove_classify, . - thenar_glove_classify

    .section .text.thenar_glove_update, "ax", @progbits

    .global thenar_glove_update
    .type thenar_glove_update, @function
thenar_glove_update:
    keep_registers
    start_if_missing 0
1:

    load_sums 0

    /* switches 0 to 5 */
    lds   r30, thenar_glove_input + 0
    andi  r30, 0x3f
    lds   r31, thenar_glove_seen + 0
    cpse  r30, r31
1:  rcall change_0_0

    /* thumb_rotation, index_pij */
    lds   r30, thenar_glove_input + 1
    lds   r31, thenar_glove_seen + 2
    cp    r30, r31
    brne  1f
    lds   r30, thenar_glove_input + 2
    lds   r31, thenar_glove_seen + 3
    cpse  r30, r31
1:  rcall change_0_1

    store_sums 0
    jmp   thenar_glove_answer

change_0_0:
    sts   thenar_glove_seen + 0, r30
    /* Only what has changed: the rows of switches that have closed, less that of switches that have opened. */
    mov   r0, r30
    eor   r0, r31
    and   r31, r0
    push  r31
    and   r30, r0
    breq  1f
    to_row 0, r30
    rcall add_changed
1:  pop   r30
    tst   r30
    breq  1f
    to_row 0, r30
    rcall subtract_changed
1:  ret

change_0_1:
    lds   r30, thenar_glove_input + 2
    sts   thenar_glove_seen + 3, r30
    clr   r0
    clr   r1
    cpi   r30, lo8(91)
    adc   r0, r1
    cpi   r30, lo8(201)
    adc   r0, r1
    lds   r30, thenar_glove_input + 1
    sts   thenar_glove_seen + 2, r30
    lsl   r0
    lsl   r0
    cpi   r30, lo8(61)
    adc   r0, r1
    cpi   r30, lo8(62)
    adc   r0, r1
    cpi   r30, lo8(141)
    adc   r0, r1
    lds   r31, thenar_glove_seen + 1
    cp    r31, r0
    breq  1f
    sts   thenar_glove_seen + 1, r0
    push  r31
    to_row 384, r0
    rcall add_changed
    pop   r30
    to_row 384, r30
    rjmp subtract_changed
1:  ret

add_changed:
    add_row
    ret

subtract_changed:
    subtract_row
    ret
    .size thenar_glove_update, . - thenar_glove_update

    .section .text.thenar_glove_start_without, "ax", @progbits

/* Leave out what is missing, and load the sums of the classes whose scores are X bytes behind the first. */
    .global thenar_glove_start_without
    .type thenar_glove_start_without, @function
thenar_glove_start_without:
    push  r26
    push  r27
    clr   r1
    call  thenar_glove_leave_out
    pop   r27
    pop   r26
    movw  r30, r26
    subi  r30, lo8(-(thenar_glove_start))
    sbci  r31, hi8(-(thenar_glove_start))
    ldd   r18, Z+0
    ldd   r19, Z+1
    ldd   r20, Z+2
    ldd   r21, Z+3
    ldd   r22, Z+4
    ldd   r23, Z+5
    ret
    .size thenar_glove_start_without, . - thenar_glove_start_without
