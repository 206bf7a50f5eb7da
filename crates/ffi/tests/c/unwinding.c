/* Whether a panic can unwind through functions of the library: they have unwind tables. */
#include <stdio.h>

#include <ecrt.h>

struct bases {
    void *text, *data, *function;
};

extern const void *_Unwind_Find_FDE(void *place, struct bases *bases);

static int has_table(void *function)
{
    struct bases bases = {0};

    return _Unwind_Find_FDE((char *)function + 1, &bases) && bases.function == function;
}

int main(void)
{
    printf("%d\n", has_table(ecrt_request_master) + has_table(ecrt_master_send) + has_table(ecrt_release_master));
    return 0;
}
