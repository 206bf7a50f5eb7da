/*
 * Inside of libfakeethercat: objects behind the handles of ecrt.h, and the memory that programs share.
 *
 * The library accepts what a program declares and shows all SubDevices in OP. Process data of output PDOs is published
 * in shared memory, that of input PDOs is taken from there: a second program with inverted directions is the machine.
 * docs/ecrt.md describes files, names and the layout of the memory.
 */
#ifndef RINGCAT_FAKE_H
#define RINGCAT_FAKE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "ecrt.h"

/* Marks of living handles; an ended one has none. */
enum mark {
    MARK_ENDED = 0,
    MARK_MASTER = 0x66616b6d,
    MARK_SLAVE = 0x66616b73,
    MARK_DOMAIN = 0x66616b64,
    MARK_REQUEST = 0x66616b72
};

/* Longest list of SDOs, PDOs or entries of one owner: they come from the program. */
#define MOST_ELEMENTS 4096
/* Longest SDO. */
#define MOST_SDO_BYTES 65536

/* A growing list; elements are moved. */
struct list {
    void *elements;
    size_t count, room;
};

struct pdo {
    uint16_t index;
    struct list entries; /* of ec_pdo_entry_info_t */
};

struct sync {
    ec_direction_t direction;
    struct list pdos; /* of struct pdo */
};

struct sdo {
    uint16_t index;
    int subindex; /* -1: complete access */
    uint8_t *data;
    size_t size;
};

/* In front of each object that ends with the application. */
struct child {
    uint32_t mark;
    struct child *next;
    struct ec_master *master;
    void (*drop)(struct child *child); /* frees what the object has */
};

struct ec_slave_config {
    struct child child;
    uint16_t alias, position;
    uint32_t vendor_id, product_code;
    struct sync syncs[EC_MAX_SYNC_MANAGERS];
    struct list sdos; /* of struct sdo */
};

/* An area of the shared memory, see shared.c. */
struct area;

/* A SyncManager in a domain. */
struct mapped {
    struct ec_slave_config *slave;
    uint8_t sync;
    size_t byte, bytes;
};

/* A PDO of an active domain and its area. */
struct link {
    struct area *area;
    size_t bit, bits;
    bool is_published;
};

struct ec_domain {
    struct child child;
    unsigned int number;
    size_t size;
    uint8_t *data; /* NULL while nothing is active */
    struct list mapped, links;
};

/* A request of any kind, with its memory behind it; it ends in an error. */
struct request {
    struct child child;
    ec_request_state_t state;
    size_t size;
};

struct shared;

struct ec_master {
    uint32_t mark;
    unsigned int index;
    bool is_reserved, is_active;
    uint64_t app_time;
    struct child *children, *ended;
    struct shared *shared;
    struct ec_master *next;
};

/* To the end of its block the thread cannot be cancelled: that would leave a master half changed. */
#define UNCANCELLED int held __attribute__((cleanup(fake_let), unused)) = fake_hold()

/* environment.c: variables, files, cancellation */
int fake_hold(void);
void fake_let(const int *held);
const char *fake_prefix(void);
int fake_domain_number(unsigned int created);
int fake_write_slaves(const struct ec_master *master);
void fake_report(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* shared.c */
int shared_open(unsigned int master, struct shared **shared);
void shared_close(struct shared *shared);
/* Finds or makes an area. 0, or a negative error number. */
int shared_area(struct shared *shared, const char *name, size_t bytes, struct area **area);
void area_publish(struct area *area, const uint8_t *image, size_t bit, size_t bits);
void area_take(struct area *area, uint8_t *image, size_t bit, size_t bits);

/* objects.c */
void *list_add(struct list *list, size_t size);
void list_drop(struct list *list);
void *child_new(struct ec_master *master, size_t size, uint32_t mark, void (*drop)(struct child *));
void children_end(struct ec_master *master);
void children_free(struct child *children);
bool is_living(const void *handle, uint32_t mark);
bool is_configurable(const struct child *child, uint32_t mark, int *error);

/* domain.c */
int domain_place(struct ec_domain *domain, struct ec_slave_config *slave, uint8_t sync, size_t bit_in_sync,
        unsigned int *bit_position);
int domains_begin(struct ec_master *master);
void domains_end(struct ec_master *master);

/* config.c */
size_t sync_bits(const struct sync *sync);

#endif
