/* Lists, and objects behind handles: a handle that has ended is found out by its mark until the next one ends. */
#include <errno.h>
#include <string.h>

#include "fake.h"

/* A zeroed element at the end; NULL without memory. */
void *list_add(struct list *list, size_t size)
{
    uint8_t *element;

    if (list->count == MOST_ELEMENTS)
        return NULL;
    if (list->count == list->room) {
        size_t room = list->room ? 2 * list->room : 4;
        void *elements = realloc(list->elements, room * size);

        if (!elements)
            return NULL;
        list->elements = elements;
        list->room = room;
    }
    element = (uint8_t *) list->elements + list->count++ * size;
    return memset(element, 0, size);
}

void list_drop(struct list *list)
{
    free(list->elements);
    memset(list, 0, sizeof *list);
}

void *child_new(struct ec_master *master, size_t size, uint32_t mark, void (*drop)(struct child *))
{
    struct child *child = calloc(1, size);

    if (child) {
        child->mark = mark;
        child->master = master;
        child->drop = drop;
        child->next = master->children;
        master->children = child;
    }
    return child;
}

void children_free(struct child *children)
{
    while (children) {
        struct child *next = children->next;

        if (children->drop)
            children->drop(children);
        free(children);
        children = next;
    }
}

/* All handles of the application end. Their memory is kept until those of the next one end. */
void children_end(struct ec_master *master)
{
    struct child *child;

    if (!master->children)
        return;
    children_free(master->ended);
    for (child = master->children; child; child = child->next)
        child->mark = MARK_ENDED;
    master->ended = master->children;
    master->children = NULL;
}

bool is_living(const void *handle, uint32_t mark)
{
    return handle && *(const uint32_t *) handle == mark;
}

/* Whether an object may be configured; otherwise the code. */
bool is_configurable(const struct child *child, uint32_t mark, int *error)
{
    *error = !is_living(child, mark) ? -EINVAL : child->master->is_active ? -EBUSY : 0;
    return !*error;
}
