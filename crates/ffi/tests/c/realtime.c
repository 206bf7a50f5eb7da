/*
 * realtime own|daemon: cyclic calls beside another thread. The functions that the manual marks as fit for a real-time
 * thread neither allocate nor free, take no lock that waits, and make system calls only for frames; a second caller at
 * the same time gets -EBUSY, and the first one is not disturbed. With "own" receive and send are not counted: the
 * segment that is simulated in this process allocates in them.
 *
 * While it counts, writes to an invalid descriptor mark the parts of the cycle in a trace of system calls: "counted",
 * "frames", "pause". At the end it prints the names of the functions.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "ecrt.h"

#define CHECK(holds) \
    do { if (!(holds)) { fprintf(stderr, "line %d: %s\n", __LINE__, #holds); return 1; } } while (0)

/* Calls a function for real-time threads, and records its name. */
#define RT(function, arguments) (keep(#function), function arguments)
/* The same; it has to return 0. */
#define OK(function, arguments) expect(#function, RT(function, arguments))

enum { DRIVE = 2, PROTOCOLS = 3, AXES = 4, MOST = 80, ROUNDS = 500 };

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *memory, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *memory);

static _Thread_local int counts;
static _Thread_local unsigned long allocations, locks;

void *malloc(size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_realloc(memory, size);
}

void *memalign(size_t alignment, size_t size)
{
    allocations += (unsigned long) counts;
    return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    *memory = memalign(alignment, size);
    return *memory ? 0 : ENOMEM;
}

void free(void *memory)
{
    allocations += counts && memory;
    __libc_free(memory);
}

/* The function of this name in the C library. */
#define NEXT(name) static __typeof__(name) *next; if (!next) *(void **) &next = dlsym(RTLD_NEXT, #name)

void *mmap(void *place, size_t size, int protection, int flags, int descriptor, off_t offset)
{
    NEXT(mmap);
    allocations += (unsigned long) counts;
    return next(place, size, protection, flags, descriptor, offset);
}

void *mmap64(void *place, size_t size, int protection, int flags, int descriptor, off64_t offset)
{
    return mmap(place, size, protection, flags, descriptor, offset);
}

/* Locks of the C library. Those of Rust call syscall(SYS_futex) when they wait or wake. */
int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    NEXT(pthread_mutex_lock);
    locks += (unsigned long) counts;
    return next(mutex);
}

long syscall(long number, ...)
{
    long arguments[6];
    va_list list;
    int i;

    NEXT(syscall);
    locks += (unsigned long) counts;
    va_start(list, number);
    for (i = 0; i < 6; i++)
        arguments[i] = va_arg(list, long);
    va_end(list);
    return next(number, arguments[0], arguments[1], arguments[2], arguments[3], arguments[4], arguments[5]);
}

/* Checks that the counters count. */
static int counting_works(void)
{
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    void *volatile memory[6] = {0};
    void *aligned = NULL;
    int i, result;

    counts = 1;
    memory[0] = malloc(8);
    memory[1] = calloc(1, 8);
    memory[2] = realloc(NULL, 8);
    memory[3] = aligned_alloc(64, 64);
    result = posix_memalign(&aligned, 64, 64);
    memory[4] = aligned;
    memory[5] = mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    counts = 0;
    CHECK(!result && memory[5] != MAP_FAILED && allocations == 6);
    counts = 1;
    for (i = 0; i < 5; i++)
        free(memory[i]);
    pthread_mutex_lock(&mutex);
    pthread_mutex_unlock(&mutex);
    counts = 0;
    munmap(memory[5], 4096);
    CHECK(allocations == 11 && locks == 1);
    allocations = locks = 0;
    return 0;
}

static ec_master_t *master;
static ec_domain_t *domain;
static ec_slave_config_t *sc;
static ec_sdo_request_t *sdo;
static ec_soe_request_t *soe;
static ec_reg_request_t *reg;
static ec_voe_handler_t *voe;
static int is_own, measures, wrongs;
static uint64_t now_ns;
static const char *names[MOST], *first_wrong;
static atomic_int ends;
static atomic_ulong refused;
static unsigned long wrong;

static void keep(const char *name)
{
    int at = 0;

    while (at < MOST - 1 && names[at] && strcmp(names[at], name))
        at++;
    names[at] = name;
}

static void expect(const char *name, int result)
{
    if (result == -EBUSY)
        atomic_fetch_add(&refused, 1);
    if (result != 0 && !first_wrong)
        first_wrong = name;
    wrongs += result != 0;
}

/* The part of the cycle that begins. */
static void part(const char *name, int is_counted)
{
    counts = 0;
    if (measures && write(-1, name, strlen(name)) >= 0)
        abort();
    counts = measures && is_counted;
}

static void pause_us(long us)
{
    struct timespec pause = {0, us * 1000};
    nanosleep(&pause, NULL);
}

static void *disturb(void *unused)
{
    (void) unused;
    while (!atomic_load(&ends)) {
        int results[] = {
            ecrt_master_receive(master), ecrt_domain_process(domain), ecrt_master_application_time(master, now_ns)};
        size_t i;

        for (i = 0; i < sizeof results / sizeof *results; i++) {
            if (results[i] == -EBUSY)
                atomic_fetch_add(&refused, 1);
            wrong += results[i] != -EBUSY && results[i] != 0;
        }
    }
    return NULL;
}

static void of_the_bus(void)
{
    ec_domain_state_t state;
    ec_master_state_t segment;
    ec_master_link_state_t link;
    ec_master_info_t info;
    ec_master_scan_progress_t progress;
    ec_slave_config_state_t drive;

    OK(ecrt_domain_state, (domain, &state));
    OK(ecrt_master_state, (master, &segment));
    OK(ecrt_master_link_state, (master, 0, &link));
    OK(ecrt_slave_config_state, (sc, &drive));
    OK(ecrt_master, (master, &info));
    OK(ecrt_master_scan_progress, (master, &progress));
    wrongs += info.slave_count != AXES + 1 || info.scan_busy || info.app_time != now_ns;
    wrongs += progress.slave_count != AXES + 1 || progress.scan_index != AXES + 1;
    OK(ecrt_master_reset, (master));
    wrongs += RT(ecrt_version_magic, ()) != ECRT_VERSION_MAGIC;
}

static void of_clocks(void)
{
    uint32_t time;
    int result;

    OK(ecrt_master_application_time, (master, now_ns));
    OK(ecrt_master_sync_reference_clock, (master));
    OK(ecrt_master_sync_reference_clock_to, (master, now_ns));
    OK(ecrt_master_sync_slave_clocks, (master));
    OK(ecrt_master_sync_monitor_queue, (master));
    RT(ecrt_master_sync_monitor_process, (master));
    /* Its datagram may be lost. */
    result = RT(ecrt_master_reference_clock_time, (master, &time));
    wrongs += result != 0 && result != -EIO && result != -EBUSY;
}

static void of_objects(void)
{
    static int sdos, soes;

    if (RT(ecrt_sdo_request_state, (sdo)) != EC_REQUEST_BUSY) {
        OK(ecrt_sdo_request_index, (sdo, 0x6066, 0));
        OK(ecrt_sdo_request_timeout, (sdo, 500));
        EC_WRITE_U16(RT(ecrt_sdo_request_data, (sdo)), 10);
        wrongs += RT(ecrt_sdo_request_data_size, (sdo)) != 2;
        if (sdos++ % 2)
            OK(ecrt_sdo_request_write, (sdo));
        else
            OK(ecrt_sdo_request_read, (sdo));
    }
    if (RT(ecrt_soe_request_state, (soe)) != EC_REQUEST_BUSY) {
        OK(ecrt_soe_request_idn, (soe, 0, 2));
        OK(ecrt_soe_request_timeout, (soe, 500));
        EC_WRITE_U16(RT(ecrt_soe_request_data, (soe)), 1000);
        wrongs += RT(ecrt_soe_request_data_size, (soe)) != 2;
        if (soes++ % 2)
            OK(ecrt_soe_request_write, (soe));
        else
            OK(ecrt_soe_request_read, (soe));
    }
}

static void of_registers_and_messages(void)
{
    static int registers, messages;
    uint32_t vendor;
    uint16_t type;

    if (RT(ecrt_reg_request_state, (reg)) != EC_REQUEST_BUSY) {
        EC_WRITE_U16(RT(ecrt_reg_request_data, (reg)), 1000);
        if (registers++ % 2)
            OK(ecrt_reg_request_write, (reg, 0x0420, 2));
        else
            OK(ecrt_reg_request_read, (reg, 0x0420, 2));
    }
    if (RT(ecrt_voe_handler_execute, (voe)) != EC_REQUEST_BUSY) {
        OK(ecrt_voe_handler_send_header, (voe, 0x0c47, 7));
        EC_WRITE_U16(RT(ecrt_voe_handler_data, (voe)), 4711);
        RT(ecrt_voe_handler_data_size, (voe));
        /* Nothing may be received yet. */
        RT(ecrt_voe_handler_received_header, (voe, &vendor, &type));
        /* The SubDevice sends back what it gets. */
        messages++;
        if (messages % 2)
            OK(ecrt_voe_handler_write, (voe, 2));
        else if (messages % 4)
            OK(ecrt_voe_handler_read, (voe));
        else
            OK(ecrt_voe_handler_read_nosync, (voe));
    }
}

static void of_data(void)
{
    uint8_t bytes[8];

    EC_WRITE_U16(RT(ecrt_domain_data, (domain)), 0);
    wrongs += RT(ecrt_domain_size, (domain)) == 0;
    RT(ecrt_write_real, (bytes, 1.5F));
    wrongs += RT(ecrt_read_real, (bytes)) != 1.5F;
    RT(ecrt_write_lreal, (bytes, 2.5));
    wrongs += RT(ecrt_read_lreal, (bytes)) != 2.5;
    wrongs += RT(ecrt_slave_config_emerg_pop, (sc, bytes)) != -ENOENT;
    wrongs += RT(ecrt_slave_config_emerg_overruns, (sc)) != 0;
    OK(ecrt_slave_config_emerg_clear, (sc));
}

/* The number of wrong results. */
static int cycle(void)
{
    wrongs = 0;
    now_ns += 1000000;
    part("frames", !is_own);
    OK(ecrt_master_receive, (master));
    part("counted", 1);
    OK(ecrt_domain_process, (domain));
    of_clocks();
    of_the_bus();
    of_objects();
    of_registers_and_messages();
    of_data();
    OK(ecrt_domain_queue, (domain));
    part("frames", !is_own);
    OK(ecrt_master_send, (master));
    part("pause", 0);
    pause_us(1000);
    return wrongs;
}

/* A cycle may be left out while the delays of clocks are measured. */
static int is_complete(void)
{
    ec_domain_state_t state;

    return ecrt_domain_state(domain, &state) == 0 && state.wc_state == EC_WC_COMPLETE;
}

/* On a busy machine frames come late, and the link counts as down meanwhile. */
static int is_up(void)
{
    ec_master_info_t info;

    return ecrt_master(master, &info) == 0 && info.link_up;
}

static ec_slave_config_t *declare(uint16_t position)
{
    ec_slave_info_t info;

    if (ecrt_master_get_slave(master, position, &info))
        return NULL;
    return ecrt_master_slave_config(master, info.alias, info.alias ? 0 : position, info.vendor_id, info.product_code);
}

static int configure(void)
{
    ec_slave_config_t *protocols, *axes;

    CHECK(master = ecrt_request_master(0));
    CHECK(domain = ecrt_master_create_domain(master));
    CHECK((sc = declare(DRIVE)) && (protocols = declare(PROTOCOLS)) && (axes = declare(AXES)));
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6040, 0, domain, NULL) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) > 0);
    CHECK(ecrt_slave_config_emerg_size(sc, 2) == 0);
    CHECK(sdo = ecrt_slave_config_create_sdo_request(sc, 0x6066, 0, 2));
    CHECK(soe = ecrt_slave_config_create_soe_request(axes, 0, 2, 2));
    CHECK(reg = ecrt_slave_config_create_reg_request(sc, 2));
    CHECK(voe = ecrt_slave_config_create_voe_handler(protocols, 8));
    return ecrt_master_activate(master);
}

/* Two threads call at once: one of them is refused, and the other one is not disturbed. */
static int both(void)
{
    pthread_t other;
    int i;

    atomic_store(&refused, 0);
    CHECK(pthread_create(&other, NULL, disturb, NULL) == 0);
    for (i = 0; i < 1000 || (i < 20000 && !atomic_load(&refused)); i++)
        cycle();
    atomic_store(&ends, 1);
    CHECK(pthread_join(other, NULL) == 0);
    CHECK(wrong == 0 && atomic_load(&refused) > 0);
    return 0;
}

int main(int argc, char **argv)
{
    ec_slave_config_state_t drive = {0, 0, 0};
    int i;

    CHECK(argc == 2);
    CHECK(!counting_works());
    is_own = !strcmp(argv[1], "own");
    CHECK(configure() == 0);
    for (i = 0; i < 10000 && !(drive.operational && is_complete() && is_up()); i++) {
        cycle();
        CHECK(ecrt_slave_config_state(sc, &drive) == 0);
    }
    CHECK(drive.operational && is_complete() && is_up());
    measures = 1;
    for (i = 0; i < ROUNDS; i++)
        if (cycle()) {
            fprintf(stderr, "%d wrong results, the first code of %s\n", wrongs, first_wrong ? first_wrong : "none");
            return 1;
        }
    measures = 0;
    printf("allocations %lu\n", allocations);
    printf("locks %lu\n", locks);
    CHECK(both() == 0);
    for (i = 0; i < 100; i++)
        CHECK(cycle() == 0);
    for (i = 0; i < 10000 && !is_complete(); i++)
        cycle();
    CHECK(is_complete());
    for (i = 0; i < MOST && names[i]; i++)
        printf("function %s\n", names[i]);
    ecrt_release_master(master);
    return 0;
}
