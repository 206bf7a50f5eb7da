/*
 * Process data of several programs in shared memory: one object per master and user, /dev/shm/NAME.UID.MASTER with the
 * slashes of FAKE_EC_PREFIX as underscores.
 *
 * A header, then areas of the same size. An area has a name, which does not change, and the bytes of one PDO. Only its
 * publisher writes: the sequence is odd meanwhile. A reader copies and compares the sequence; after TRIES it keeps what
 * it had. Cycles neither wait nor call the system. Areas are made under flock(2), which ends with its process.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "fake.h"

#define MAGIC 0x454b4146U /* "FAKE" */
#define VERSION 1U
#define AREAS 1024U
#define NAME_BYTES 112U
#define DATA_BYTES 1920U
/* Tries of a reader beside a writer. */
#define TRIES 8
/* Waits for another program that makes areas, of a millisecond each. */
#define LOCK_TRIES 1000

/* 2048 bytes. */
struct area {
    char name[NAME_BYTES]; /* with a zero at its end; empty: unused */
    _Atomic uint32_t bytes, sequence;
    uint8_t unused[8];
    uint8_t data[DATA_BYTES];
};

struct memory {
    _Atomic uint32_t magic, version;
    uint8_t unused[2040];
    struct area areas[AREAS];
};

_Static_assert(sizeof(struct area) == 2048 && sizeof(struct memory) == 2048 * (AREAS + 1), "documented layout");

struct shared {
    struct memory *memory;
    int descriptor;
};

static int lock(int descriptor)
{
    const struct timespec pause = {0, 1000000};
    int tries;

    for (tries = 0; tries < LOCK_TRIES; tries++) {
        if (!flock(descriptor, LOCK_EX | LOCK_NB))
            return 0;
        if (errno != EWOULDBLOCK && errno != EINTR)
            return -errno;
        nanosleep(&pause, NULL);
    }
    return -EBUSY;
}

/* Under the lock: the file has its size, and its header fits. */
static int prepare(struct shared *shared)
{
    struct stat status;
    int error;

    if (fstat(shared->descriptor, &status))
        return -errno;
    if (!S_ISREG(status.st_mode) || status.st_uid != geteuid())
        return -EPERM;
    /* All of it now: a store into memory that does not exist would end the program. */
    error = status.st_size == 0 || status.st_size == (off_t) sizeof(struct memory)
                ? posix_fallocate(shared->descriptor, 0, sizeof(struct memory))
                : 0;
    if (error)
        return -error;
    if (status.st_size != 0 && status.st_size != (off_t) sizeof(struct memory))
        return -EPROTO;
    shared->memory = mmap(NULL, sizeof(struct memory), PROT_READ | PROT_WRITE, MAP_SHARED, shared->descriptor, 0);
    if (shared->memory == MAP_FAILED) {
        shared->memory = NULL;
        return -errno;
    }
    /* New, or the process that made it was killed before it came here. */
    if (shared->memory->magic == 0) {
        shared->memory->version = VERSION;
        shared->memory->magic = MAGIC;
    }
    return shared->memory->magic == MAGIC && shared->memory->version == VERSION ? 0 : -EPROTO;
}

int shared_open(unsigned int master, struct shared **opened)
{
    struct shared *shared = calloc(1, sizeof *shared);
    char name[200], *at;
    int error;

    if (!shared)
        return -ENOMEM;
    snprintf(name, sizeof name, "%.150s.%lu.%u", fake_prefix(), (unsigned long) geteuid(), master);
    for (at = name + 1; *at; at++)
        *at = *at == '/' ? '_' : *at;
    name[0] = '/';
    shared->descriptor = shm_open(name, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    error = shared->descriptor < 0 ? -errno : lock(shared->descriptor);
    if (!error) {
        error = prepare(shared);
        flock(shared->descriptor, LOCK_UN);
    }
    if (error) {
        fake_report("shared memory %s: %s", name, strerror(-error));
        shared_close(shared);
        return error;
    }
    *opened = shared;
    return 0;
}

void shared_close(struct shared *shared)
{
    if (!shared)
        return;
    if (shared->memory)
        munmap(shared->memory, sizeof(struct memory));
    if (shared->descriptor >= 0)
        close(shared->descriptor);
    free(shared);
}

int shared_area(struct shared *shared, const char *name, size_t bytes, struct area **found)
{
    struct area *area, *end = shared->memory->areas + AREAS;
    int error = 0;

    if (strlen(name) >= NAME_BYTES || bytes > DATA_BYTES)
        return -EOVERFLOW;
    error = lock(shared->descriptor);
    if (error)
        return error;
    for (area = shared->memory->areas; area < end && area->name[0]; area++)
        if (!strncmp(area->name, name, NAME_BYTES))
            break;
    if (area == end) {
        error = -ENOSPC;
    } else if (!area->name[0]) {
        atomic_store(&area->bytes, (uint32_t) bytes);
        memcpy(area->name, name, strlen(name));
    } else if (atomic_load(&area->bytes) != bytes) {
        fake_report("%s: expected %zu bytes as in this program, got %u of another one", name, bytes,
            (unsigned int) atomic_load(&area->bytes));
        error = -EPROTO;
    }
    flock(shared->descriptor, LOCK_UN);
    *found = area;
    return error;
}

static unsigned int bit_of(const uint8_t *bytes, size_t bit)
{
    return bytes[bit / 8] >> bit % 8 & 1U;
}

static void copy_bits(uint8_t *to, size_t to_bit, const uint8_t *from, size_t from_bit, size_t bits)
{
    size_t number;

    if (to_bit % 8 == 0 && from_bit % 8 == 0) {
        memcpy(to + to_bit / 8, from + from_bit / 8, bits / 8);
        number = bits - bits % 8;
    } else {
        number = 0;
    }
    for (; number < bits; number++) {
        uint8_t *byte = to + (to_bit + number) / 8, mask = (uint8_t) (1U << (to_bit + number) % 8);

        *byte = (uint8_t) ((*byte & ~mask) | (bit_of(from, from_bit + number) ? mask : 0));
    }
}

void area_publish(struct area *area, const uint8_t *image, size_t bit, size_t bits)
{
    uint32_t sequence = atomic_load_explicit(&area->sequence, memory_order_relaxed) | 1U;

    atomic_store_explicit(&area->sequence, sequence, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    copy_bits(area->data, 0, image, bit, bits);
    atomic_store_explicit(&area->sequence, sequence + 1, memory_order_release);
}

void area_take(struct area *area, uint8_t *image, size_t bit, size_t bits)
{
    uint8_t copy[DATA_BYTES];
    int tries;

    for (tries = 0; tries < TRIES; tries++) {
        uint32_t before = atomic_load_explicit(&area->sequence, memory_order_acquire);

        memcpy(copy, area->data, (bits + 7) / 8);
        atomic_thread_fence(memory_order_acquire);
        if (!(before & 1) && atomic_load_explicit(&area->sequence, memory_order_relaxed) == before) {
            copy_bits(image, bit, copy, 0, bits);
            return;
        }
    }
}
