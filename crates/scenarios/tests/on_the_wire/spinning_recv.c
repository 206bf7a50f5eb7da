/* Preloaded into pysoem (LD_PRELOAD), it makes SOEM's receive spin: SOEM waits in a blocking recv() with a time
 * limit of a microsecond and repeats it until the frame is there, so a recv() that returns at once is all that it
 * takes. Built by ci/bench-wire, for a comparison of stacks that wait alike. */
#define _GNU_SOURCE
#include <sys/socket.h>

ssize_t recv(int fd, void *buffer, size_t length, int flags)
{
    return recvfrom(fd, buffer, length, flags | MSG_DONTWAIT, 0, 0);
}
