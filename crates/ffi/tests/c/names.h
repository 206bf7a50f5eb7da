/* Names of results, as the tables of docs/ecrt.md have them. */
#include <errno.h>
#include <stddef.h>

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
