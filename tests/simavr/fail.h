/* Stop with a message; for a program without libsimavr, too. */
#ifndef THENAR_FAIL_H
#define THENAR_FAIL_H

#include <stdnoreturn.h>

/* Print one line to stderr, after the program's name, and exit with code 2. */
noreturn void fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
