/* Variables of the environment, and the file with the SubDevices that a program has declared. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fake.h"

/* A variable; in a process with more rights than its user none is given. */
static const char *variable(const char *name, const char *otherwise)
{
    const char *value = getauxval(AT_SECURE) ? NULL : getenv(name);

    return value && *value ? value : otherwise;
}

int fake_hold(void)
{
    int held = PTHREAD_CANCEL_ENABLE;

    pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, &held);
    return held;
}

void fake_let(const int *held)
{
    pthread_setcancelstate(*held, NULL);
}

void fake_report(const char *format, ...)
{
    UNCANCELLED;
    va_list arguments;

    va_start(arguments, format);
    fputs("EtherCAT (fake): ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

const char *fake_prefix(void)
{
    return variable("FAKE_EC_PREFIX", "/FakeEtherCAT");
}

/* The number that names a domain: that of its creation, or its place in FAKE_EC_DOMAIN_PERMUTATION ("1,0,2"). */
int fake_domain_number(unsigned int created)
{
    const char *list = variable("FAKE_EC_DOMAIN_PERMUTATION", "");
    unsigned int place;

    for (place = 0; *list; place++) {
        char *end;
        unsigned long number = strtoul(list, &end, 10);

        if (end == list || (*end && *end != ',') || number > 255) {
            fake_report("FAKE_EC_DOMAIN_PERMUTATION: expected numbers up to 255 with commas, got \"%s\"", list);
            return -EINVAL;
        }
        if (place == created)
            return (int) number;
        list = *end ? end + 1 : end;
    }
    return (int) created;
}

/* The directory, made if it is missing. It must be ours and not a link. */
static int home(char *path, size_t size)
{
    const char *temporary = variable("TMPDIR", "/tmp"), *given = variable("FAKE_EC_HOMEDIR", NULL);
    struct stat status;
    int length;

    if (given)
        length = snprintf(path, size, "%s", given);
    else
        length = snprintf(path, size, "%s/FakeEtherCAT-%lu", temporary, (unsigned long) geteuid());
    if (length < 0 || (size_t) length >= size)
        return -ENAMETOOLONG;
    if (mkdir(path, 0700) && errno != EEXIST)
        return -errno;
    if (given)
        return 0;
    if (lstat(path, &status))
        return -errno;
    return S_ISDIR(status.st_mode) && status.st_uid == geteuid() ? 0 : -EPERM;
}

static void write_sdos(FILE *file, const struct ec_slave_config *slave)
{
    const struct sdo *sdos = slave->sdos.elements;
    size_t number, byte;

    for (number = 0; number < slave->sdos.count; number++) {
        const struct sdo *sdo = sdos + number;

        fprintf(file, "%s\n        \"0x%04X", number ? "," : "", sdo->index);
        if (sdo->subindex >= 0)
            fprintf(file, ":%02X", (unsigned int) sdo->subindex);
        fputs("\": \"", file);
        for (byte = 0; byte < sdo->size; byte++)
            fprintf(file, "%02X", sdo->data[byte]);
        fputc('"', file);
    }
}

/* Children are kept newest first; programs read the file in the order of their declarations. */
static void write_slaves(FILE *file, const struct child *child, bool *is_first)
{
    const struct ec_slave_config *slave = (const struct ec_slave_config *) child;

    if (!child)
        return;
    write_slaves(file, child->next, is_first);
    if (child->mark != MARK_SLAVE)
        return;
    fprintf(file, "%s\n    \"0x%04X%04X\": {\n      \"vendor_id\": %" PRIu32 ",\n      \"product_id\": %" PRIu32,
        *is_first ? "" : ",", slave->alias, slave->position, slave->vendor_id, slave->product_code);
    fputs(",\n      \"sdos\": {", file);
    write_sdos(file, slave);
    fputs("\n      }\n    }", file);
    *is_first = false;
}

/* Writes $FAKE_EC_HOMEDIR/$FAKE_EC_NAME_slaves.json, whole or not at all. */
int fake_write_slaves(const struct ec_master *master)
{
    const char *name = variable("FAKE_EC_NAME", "FakeEtherCAT");
    char directory[PATH_MAX], path[PATH_MAX + NAME_MAX], draft[PATH_MAX + NAME_MAX + 16];
    bool is_first = true;
    FILE *file;
    int error = home(directory, sizeof directory), descriptor;

    if (!error && strchr(name, '/'))
        error = -EINVAL;
    if (error)
        return error;
    snprintf(path, sizeof path, "%s/%.200s_slaves.json", directory, name);
    snprintf(draft, sizeof draft, "%s.%ld", path, (long) getpid());
    descriptor = open(draft, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644);
    file = descriptor < 0 ? NULL : fdopen(descriptor, "w");
    if (!file) {
        error = -errno;
        if (descriptor >= 0)
            close(descriptor);
        return error;
    }
    fputs("{\n  \"slaves\": {", file);
    write_slaves(file, master->children, &is_first);
    fputs("\n  }\n}\n", file);
    error = ferror(file) ? -EIO : 0;
    if (fclose(file) && !error)
        error = -errno;
    if (!error && rename(draft, path))
        error = -errno;
    if (error)
        unlink(draft);
    return error;
}
