/* thenar_glove_avr.S: the adding up, on an AVR.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME_avr.S.j2. */
#ifdef __AVR__

/* First the rows of all look-ups are found, while Y, r29:r28, points at the glove's state and input; then they are
   added up: the sums of 3 classes stay in registers meanwhile, Z, r31:r30, is where a row is read, and r0 and r1 hold
   what is read and multiplied. What was found stays at a fixed address, for no register is left to point at it. */

#define STRIDE 6 /* bytes of a row */
#define STATE 12 /* what of a glove Y points at: whether something is missing, whether update() has begun, the input */
#define SEEN 17
#define START 6

/* Make Z the address of the row whose number is in r30, of those that begin at `rows`. */
.macro to_row rows
    ldi   r31, STRIDE
    mul   r30, r31
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
    push  r28
    push  r29
.endm

/* Make Z the address of what lies that many bytes into the glove. */
.macro to_glove bytes
    lds   r30, thenar_glove_here
    lds   r31, thenar_glove_here + 1
    subi  r30, lo8(-(\bytes))
    sbci  r31, hi8(-(\bytes))
.endm

/* Begin with the glove at r25:r24. T says in all passes whether an input is missing, which is left out then. */
.macro take_glove
    sts   thenar_glove_here, r24
    sts   thenar_glove_here + 1, r25
    movw  r28, r24
    subi  r28, lo8(-STATE)
    sbci  r29, hi8(-STATE)
    ldd   r30, Y+0
    bst   r30, 0
    brtc  1f /* 0 times */
    start_without 0
    to_glove STATE
    movw  r28, r30
1:
.endm

/* Have what is missing left out, and load the sums as they begin then. */
.macro start_without scores
    ldi   r26, lo8(\scores)
    ldi   r27, hi8(\scores)
    lds   r30, thenar_glove_stand_in
    lds   r31, thenar_glove_stand_in + 1
    icall
.endm

/* The glove, and the rows that its input takes now. */
    .section .bss.thenar_glove_here, "aw", @nobits
thenar_glove_here:
    .zero 2
thenar_glove_found:
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
    ldi   r30, hh8(thenar_glove_bins + 511)
    cpse  r30, r1
    jmp   abort
#endif
    keep_registers
    take_glove
    std   Y+1, r1
    call  thenar_glove_find
thenar_glove_add:

    brtc  1f /* 0 times */
    start_without 0
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
    lds   r30, thenar_glove_found + 0
    to_row 0
    add_row

    /* thumb_rotation, index_pij */
    lds   r30, thenar_glove_found + 1
    to_row 384
    add_row

    to_glove 0
    st    Z+, r18
    st    Z+, r19
    st    Z+, r20
    st    Z+, r21
    st    Z+, r22
    st    Z+, r23

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
    pop   r29
    pop   r28
    ret

/* Find the rows that the input takes. */
thenar_glove_find:

    /* switches 0 to 5 */
    ldd   r30, Y+2
    andi  r30, 0x3f
    sts   thenar_glove_found + 0, r30

    /* thumb_rotation, index_pij */
    ldd   r30, Y+3
    ldi   r31, hi8(thenar_glove_bins + 0)
    lpm   r30, Z
    mov   r0, r30
    ldd   r30, Y+4
    ldi   r31, hi8(thenar_glove_bins + 256)
    lpm   r30, Z
    add   r30, r0
    sts   thenar_glove_found + 1, r30
    ret
    .size thenar_glove_classify, . - thenar_glove_classify

/* The rows that were in the scores before. */
    .section .bss.thenar_glove_before, "aw", @nobits
thenar_glove_before:
    .zero 2

    .section .text.thenar_glove_update, "ax", @progbits

    .global thenar_glove_update
    .type thenar_glove_update, @function
thenar_glove_update:
    keep_registers
    take_glove
    call  thenar_glove_find
    ldd   r19, Y+1
    ldi   r18, 1
    std   Y+1, r18
    to_glove SEEN
    ldi   r26, lo8(thenar_glove_found)
    ldi   r27, hi8(thenar_glove_found)
    ldi   r28, lo8(thenar_glove_before)
    ldi   r29, hi8(thenar_glove_before)
    ldi   r24, lo8(2)
    ldi   r25, hi8(2)
1:  ld    r18, X+
    ld    r0, Z
    st    Z+, r18
    st    Y+, r0
    sbiw  r24, 1
    brne  1b /* 2 times */
    tst   r19
    brne  1f /* 0 times */
    jmp   thenar_glove_add /* the scores are of nothing yet */
1:

    to_glove 0
    ldd   r18, Z+0
    ldd   r19, Z+1
    ldd   r20, Z+2
    ldd   r21, Z+3
    ldd   r22, Z+4
    ldd   r23, Z+5

    /* switches 0 to 5 */
    lds   r30, thenar_glove_found + 0
    lds   r31, thenar_glove_before + 0
    cpse  r30, r31
    rcall change_0_0

    /* thumb_rotation, index_pij */
    lds   r30, thenar_glove_found + 1
    lds   r31, thenar_glove_before + 1
    cpse  r30, r31
    rcall change_0_1

    to_glove 0
    st    Z+, r18
    st    Z+, r19
    st    Z+, r20
    st    Z+, r21
    st    Z+, r22
    st    Z+, r23
    jmp   thenar_glove_answer

change_0_0:
    /* Only what has changed: the rows of switches that have closed, less that of switches that have opened. */
    mov   r0, r30
    eor   r0, r31
    and   r31, r0
    push  r31
    and   r30, r0
    breq  1f
    to_row 0
    rcall add_changed
1:  pop   r30
    tst   r30
    breq  1f
    to_row 0
    rcall subtract_changed
1:  ret

change_0_1:
    push  r31
    to_row 384
    rcall add_changed
    pop   r30
    to_row 384
    rjmp subtract_changed

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
    lds   r24, thenar_glove_here
    lds   r25, thenar_glove_here + 1
    clr   r1
    call  thenar_glove_leave_out
    pop   r27
    pop   r26
    to_glove START
    add   r30, r26
    adc   r31, r27
    ldd   r18, Z+0
    ldd   r19, Z+1
    ldd   r20, Z+2
    ldd   r21, Z+3
    ldd   r22, Z+4
    ldd   r23, Z+5
    set
    ret
    .size thenar_glove_start_without, . - thenar_glove_start_without

#elif defined(__linux__)
    .section .note.GNU-stack, "", %progbits
#endif
