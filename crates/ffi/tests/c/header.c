/* Uses each macro of the header once; the header is the only include. */
#include "ecrt.h"

#ifndef EC_HAVE_STATE_TIMEOUT
#error "features are announced"
#endif

int use(uint8_t *data, const struct timeval *now);

int use(uint8_t *data, const struct timeval *now)
{
    EC_WRITE_BIT(data, 1, 1);
    EC_WRITE_U8(data, EC_READ_U8(data) + EC_READ_BIT(data, 1));
    EC_WRITE_S8(data, EC_READ_S8(data));
    EC_WRITE_U16(data, EC_READ_U16(data));
    EC_WRITE_S16(data, EC_READ_S16(data));
    EC_WRITE_U32(data, EC_READ_U32(data));
    EC_WRITE_S32(data, EC_READ_S32(data));
    EC_WRITE_U64(data, EC_READ_U64(data) + EC_TIMEVAL2NANO(*now));
    EC_WRITE_S64(data, EC_READ_S64(data));
    EC_WRITE_REAL(data, EC_READ_REAL(data));
    EC_WRITE_LREAL(data, EC_READ_LREAL(data));
    return ECRT_VERSION_MAGIC + (int) EC_MAX_SYNC_MANAGERS + (EC_END == 0);
}
