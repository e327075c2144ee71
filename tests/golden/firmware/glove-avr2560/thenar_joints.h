/* The joints: a CyberGlove on a UART.

   thenar 0.1.0, template board/thenar_joints.h.j2. */
#ifndef THENAR_JOINTS_H
#define THENAR_JOINTS_H

#include "thenar_glove.h"

/* Start to measure. */
void thenar_joints_begin(void);

/* Process some received bytes; call it as often as possible. */
void thenar_joints_attend(uint32_t now_us);

/* Copy the newest codes to the glove's input. Return false if there are none, or they are too old. */
bool thenar_joints_read(thenar_glove *glove, uint32_t now_us);

#endif
