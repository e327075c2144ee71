/* thenar_glove_avr.S: the addition of rows, on an AVR.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME_avr.S.j2. */
#ifdef __AVR__

/* The sums of 3 classes stay in registers while rows are added. Z, r31:r30, is the address of a row; r0 and r1 hold
   entries and products. Y, r29:r28, points at the glove.
   update() compares the input with that of the previous call, and finds only rows whose input has changed. */

#define STRIDE 6 /* bytes of a row */
#define STATE 12 /* offset in a glove of what Y points at: two flags (input missing, update() begun), the input */
#define START 6

/* Make Z the address of a row: its number is in a register, row 0 is at offset `rows`. */
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
    add   r22, r0
    lpm   r0, Z+
    adc   r23, r0
    lpm   r0, Z+
    add   r24, r0
    lpm   r0, Z+
    adc   r25, r0
    lpm   r0, Z+
    add   r26, r0
    lpm   r0, Z+
    adc   r27, r0
.endm

.macro keep_registers
    push  r28
    push  r29
.endm

/* Make Y point at the state of the glove at r25:r24. */
.macro take_glove
    movw  r28, r24
    subi  r28, lo8(-STATE)
    sbci  r29, hi8(-STATE)
.endm

/* Make Z the address at an offset from there. */
.macro to_state bytes
    movw  r30, r28
    subi  r30, lo8(-(\bytes))
    sbci  r31, hi8(-(\bytes))
.endm

/* Make Z the address at an offset in the glove. */
.macro to_glove bytes
    to_state \bytes - STATE
.endm

/* Leave out missing inputs, and load the initial sums. */
.macro start_without
    lds   r30, thenar_glove_stand_in
    lds   r31, thenar_glove_stand_in + 1
    icall
.endm

    .section .text.thenar_glove_classify, "ax", @progbits

    .global thenar_glove_classify
    .type thenar_glove_classify, @function
thenar_glove_classify:
#ifdef __AVR_HAVE_ELPM__
    /* Tables beyond the first 64 KiB would be misread: stop. */
    ldi   r30, hh8(thenar_glove_rows + 137)
    cpse  r30, r1
    jmp   abort
#endif
    keep_registers
    take_glove
    std   Y+1, r1
    ldd   r30, Y+0
    tst   r30
    breq  1f
    start_without
    rjmp  2f
1:
    ldi   r22, lo8(120) /* power grip */
    ldi   r23, hi8(120)
    ldi   r24, lo8(-40) /* tip pinch */
    ldi   r25, hi8(-40)
    ldi   r26, lo8(7) /* lateral pinch */
    ldi   r27, hi8(7)
2:

    /* switches 0 to 2 */
    ldd   r30, Y+2
    andi  r30, 0x07
    to_row 0, r30
    call  add_row_at_z

    /* switches 3 to 5 */
    ldd   r30, Y+2
    lsl   r30
    swap  r30
    andi  r30, 0x07
    to_row 48, r30
    call  add_row_at_z

    /* thumb_rotation */
    ldd   r30, Y+3
    clr   r0
    clr   r1
    cpi   r30, lo8(61)
    adc   r0, r1
    cpi   r30, lo8(62)
    adc   r0, r1
    cpi   r30, lo8(141)
    adc   r0, r1
    to_row 96, r0
    call  add_row_at_z

    /* index_pij */
    ldd   r30, Y+4
    clr   r0
    clr   r1
    cpi   r30, lo8(91)
    adc   r0, r1
    cpi   r30, lo8(201)
    adc   r0, r1
    to_row 120, r0
    call  add_row_at_z

    to_glove 0
    st    Z+, r22
    st    Z+, r23
    st    Z+, r24
    st    Z+, r25
    st    Z+, r26
    st    Z+, r27

/* Return the first class with the highest score; the sums are still in registers. */
thenar_glove_answer:
    movw  r0, r22
    ldi   r30, 0
    cp    r0, r24
    cpc   r1, r25
    brge  1f
    movw  r0, r24
    ldi   r30, 1
1:
    cp    r0, r26
    cpc   r1, r27
    brge  1f
    movw  r0, r26
    ldi   r30, 2
1:
    mov   r24, r30
    clr   r1
    pop   r29
    pop   r28
    ret

add_row_at_z:
    add_row
    ret
    .size thenar_glove_classify, . - thenar_glove_classify

/* Keep Z, the address of a lookup's rows. */
    .section .bss.thenar_glove_kept, "aw", @nobits
thenar_glove_kept:
    .zero 2

.macro keep_rows
    sts   thenar_glove_kept, r30
    sts   thenar_glove_kept + 1, r31
.endm

/* Make Z, which is still the same, the address of row r0; make Z the address of row r30. */
.macro to_row_r0
    ldi   r31, STRIDE
    mul   r0, r31
    lds   r31, thenar_glove_kept + 1
    add   r30, r0
    adc   r31, r1
.endm
.macro to_row_r30
    ldi   r31, STRIDE
    mul   r30, r31
    lds   r30, thenar_glove_kept
    lds   r31, thenar_glove_kept + 1
    add   r30, r0
    adc   r31, r1
.endm

    .section .text.thenar_glove_update, "ax", @progbits

    .global thenar_glove_update
    .type thenar_glove_update, @function
thenar_glove_update:
    keep_registers
    take_glove
    clt /* T: the sums hold no rows yet */
    ldd   r30, Y+0
    ldd   r31, Y+1
    subi  r31, 1
    or    r30, r31
    breq  1f
    jmp   thenar_glove_prepare
1:

changes_0:
    movw  r30, r24
loads_0:
    ldd   r22, Z+0
    ldd   r23, Z+1
    ldd   r24, Z+2
    ldd   r25, Z+3
    ldd   r26, Z+4
    ldd   r27, Z+5

    /* switches 0 to 2 */
    ldd   r30, Y+2
    andi  r30, 0x07
    ldd   r31, Y+5
    cp    r30, r31
    breq  1f
    std   Y+5, r30
    movw  r0, r30
    ldi   r30, lo8(thenar_glove_rows + 0)
    ldi   r31, hi8(thenar_glove_rows + 0)
    call  switches_0
1:

    /* switches 3 to 5 */
    ldd   r30, Y+2
    lsl   r30
    swap  r30
    andi  r30, 0x07
    ldd   r31, Y+6
    cp    r30, r31
    breq  1f
    std   Y+6, r30
    movw  r0, r30
    ldi   r30, lo8(thenar_glove_rows + 48)
    ldi   r31, hi8(thenar_glove_rows + 48)
    call  switches_0
1:

    /* thumb_rotation */
    ldd   r30, Y+3
    ldd   r31, Y+9
    brts  1f
    cpse  r30, r31
1:  call  change_0_2
2:

    /* index_pij */
    ldd   r30, Y+4
    ldd   r31, Y+10
    brts  1f
    cpse  r30, r31
1:  call  change_0_3
2:

    to_glove 0
    st    Z+, r22
    st    Z+, r23
    st    Z+, r24
    st    Z+, r25
    st    Z+, r26
    st    Z+, r27
    jmp   thenar_glove_answer

/* Leave out missing inputs, or begin: load the initial sums and compare nothing. */
thenar_glove_prepare:
    ldd   r30, Y+0
    tst   r30
    breq  1f /* nothing is missing: update() has not begun */
    start_without
    movw  r24, r28
    subi  r24, lo8(STATE)
    sbci  r25, hi8(STATE)
    clt
    ldd   r30, Y+1
    tst   r30
    breq  1f
    jmp   changes_0
1:  ldi   r30, 1
    std   Y+1, r30
    set
    ldi   r30, 0
    std   Y+5, r30
    std   Y+6, r30
    to_glove START
    jmp   loads_0

change_0_2:
    std   Y+9, r30
    clr   r0
    clr   r1
    cpi   r30, lo8(61)
    adc   r0, r1
    cpi   r30, lo8(62)
    adc   r0, r1
    cpi   r30, lo8(141)
    adc   r0, r1
    mov   r30, r0
    ldd   r31, Y+7
    brts  1f
    cp    r30, r31
    breq  2f
1:
    std   Y+7, r30
    movw  r0, r30
    ldi   r30, lo8(thenar_glove_rows + 96)
    ldi   r31, hi8(thenar_glove_rows + 96)
    jmp   replace_0
2:  ret

change_0_3:
    std   Y+10, r30
    clr   r0
    clr   r1
    cpi   r30, lo8(91)
    adc   r0, r1
    cpi   r30, lo8(201)
    adc   r0, r1
    mov   r30, r0
    ldd   r31, Y+8
    brts  1f
    cp    r30, r31
    breq  2f
1:
    std   Y+8, r30
    movw  r0, r30
    ldi   r30, lo8(thenar_glove_rows + 120)
    ldi   r31, hi8(thenar_glove_rows + 120)
    jmp   replace_0
2:  ret

/* Add row r0 of those at Z, and subtract row r1, unless the sums hold no rows yet. */
replace_0:
    push  r1
    keep_rows
    to_row_r0
    add_row
    pop   r30
    brtc  subtract_0
    ret

/* Add the row of the switches that have closed, and subtract that of those that have opened: r0 has them now, r1 as
   they were before; Z is the address of their rows. */
switches_0:
    eor   r1, r0
    and   r0, r1
    eor   r1, r0
    push  r1
    keep_rows
    tst   r0
    breq  1f
    to_row_r0
    call  add_row_at_z
1:  pop   r30
    tst   r30
    brne  subtract_0
    ret

subtract_0:
    to_row_r30
    lpm   r0, Z+
    sub   r22, r0
    lpm   r0, Z+
    sbc   r23, r0
    lpm   r0, Z+
    sub   r24, r0
    lpm   r0, Z+
    sbc   r25, r0
    lpm   r0, Z+
    sub   r26, r0
    lpm   r0, Z+
    sbc   r27, r0
    ret

    .size thenar_glove_update, . - thenar_glove_update

    .section .text.thenar_glove_start_without, "ax", @progbits

/* Leave out missing inputs, and load the initial sums. */
    .global thenar_glove_start_without
    .type thenar_glove_start_without, @function
thenar_glove_start_without:
    movw  r24, r28
    subi  r24, lo8(STATE)
    sbci  r25, hi8(STATE)
    call  thenar_glove_leave_out
    to_glove START
    ldd   r22, Z+0
    ldd   r23, Z+1
    ldd   r24, Z+2
    ldd   r25, Z+3
    ldd   r26, Z+4
    ldd   r27, Z+5
    ret
    .size thenar_glove_start_without, . - thenar_glove_start_without

#elif defined(__linux__)
    .section .note.GNU-stack, "", %progbits
#endif
