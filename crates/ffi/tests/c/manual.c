/* The smallest program, as in the manual; it ends at once and says how many SubDevices there are. */
#include <stdio.h>

#include <ecrt.h>

int main(void)
{
    ec_master_t *master = ecrt_request_master(0);
    ec_master_info_t info;

    if (!master)
        return 1;
    if (ecrt_master(master, &info))
        return 2;
    printf("%u\n", info.slave_count);
    ecrt_release_master(master);
    return 0;
}
