/*
 * Results and their names, as the tables of docs/ecrt.md have them. "tables.h" is made from these tables: a program
 * compares each result with its row, and at its end finds the rows that it has not called.
 */
#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

struct promise {
    const char *function, *when, *result, *source;
    atomic_int calls;
};

#include "tables.h"

static atomic_int wrong;

static const char *name_of(long result)
{
    static const struct { long code; const char *name; } names[] = {
        {0, "0"}, {-EPERM, "EPERM"}, {-ENOENT, "ENOENT"}, {-EIO, "EIO"}, {-ENXIO, "ENXIO"}, {-EBUSY, "EBUSY"},
        {-EEXIST, "EEXIST"}, {-ENODEV, "ENODEV"}, {-EINVAL, "EINVAL"}, {-EFAULT, "EFAULT"}, {-ENOBUFS, "ENOBUFS"},
        {-EOVERFLOW, "EOVERFLOW"}, {-ETIMEDOUT, "ETIMEDOUT"}, {-EPROTONOSUPPORT, "EPROTONOSUPPORT"},
    };
    size_t i;

    for (i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].code == result)
            return names[i].name;
    return result > 0 ? "positive" : "unknown";
}

/* Compares a result with the row of its function and phase or argument. */
static void compare(struct promise *table, size_t count, const char *function, const char *when, const char *result)
{
    size_t i;

    for (i = 0; i < count; i++) {
        if (strcmp(table[i].function, function) || strcmp(table[i].when, when))
            continue;
        table[i].calls++;
        if (!strcmp(table[i].result, result))
            return;
        fprintf(stderr, "%s, %s: %s, expected %s (%s)\n", function, when, result, table[i].result, table[i].source);
        wrong++;
        return;
    }
    fprintf(stderr, "%s, %s: %s, no row of the table\n", function, when, result);
    wrong++;
}

/* Prints the number of rows, and reports those without a call; 0 if nothing was wrong. */
static int end(const struct promise *table, size_t count)
{
    size_t i;

    for (i = 0; i < count; i++) {
        if (!table[i].calls) {
            fprintf(stderr, "%s, %s: not called\n", table[i].function, table[i].when);
            wrong++;
        }
    }
    printf("%zu rows, %d wrong\n", count, wrong);
    return wrong != 0;
}
