/* Requests of all kinds: they exist, have memory, and end in an error once they are started. */
#include <errno.h>

#include "fake.h"

/* Largest memory of a request. */
#define MOST_BYTES (1U << 20)

/* The handles of ecrt.h are of one kind here. */
struct ec_sdo_request { struct request request; };
struct ec_soe_request { struct request request; };
struct ec_voe_handler { struct request request; };
struct ec_reg_request { struct request request; };

static void *create(ec_slave_config_t *sc, size_t size)
{
    struct request *request;
    int error;

    if (!is_configurable(&sc->child, MARK_SLAVE, &error) || size > MOST_BYTES)
        return NULL;
    request = child_new(sc->child.master, sizeof *request + size, MARK_REQUEST, NULL);
    if (request)
        request->size = size;
    return request;
}

static int start(struct request *request)
{
    if (!is_living(request, MARK_REQUEST))
        return -EINVAL;
    request->state = EC_REQUEST_ERROR;
    return 0;
}

static ec_request_state_t state(const struct request *request)
{
    return is_living(request, MARK_REQUEST) ? request->state : EC_REQUEST_ERROR;
}

static uint8_t *data(const struct request *request)
{
    return is_living(request, MARK_REQUEST) && request->size ? (uint8_t *) (uintptr_t) (request + 1) : NULL;
}

static size_t size_of(const struct request *request)
{
    return is_living(request, MARK_REQUEST) ? request->size : 0;
}

static int known(const struct request *request)
{
    return is_living(request, MARK_REQUEST) ? 0 : -EINVAL;
}

ec_sdo_request_t *ecrt_slave_config_create_sdo_request(ec_slave_config_t *sc, uint16_t index, uint8_t subindex,
        size_t size)
{
    (void) index, (void) subindex;
    return create(sc, size);
}

int ecrt_sdo_request_index(ec_sdo_request_t *req, uint16_t index, uint8_t subindex)
{
    (void) index, (void) subindex;
    return known(&req->request);
}

int ecrt_sdo_request_timeout(ec_sdo_request_t *req, uint32_t timeout)
{
    (void) timeout;
    return known(&req->request);
}

uint8_t *ecrt_sdo_request_data(const ec_sdo_request_t *req)
{
    return data(&req->request);
}

size_t ecrt_sdo_request_data_size(const ec_sdo_request_t *req)
{
    return size_of(&req->request);
}

ec_request_state_t ecrt_sdo_request_state(ec_sdo_request_t *req)
{
    return state(&req->request);
}

int ecrt_sdo_request_read(ec_sdo_request_t *req)
{
    return start(&req->request);
}

int ecrt_sdo_request_write(ec_sdo_request_t *req)
{
    return start(&req->request);
}

ec_soe_request_t *ecrt_slave_config_create_soe_request(ec_slave_config_t *sc, uint8_t drive_no, uint16_t idn,
        size_t size)
{
    (void) drive_no, (void) idn;
    return create(sc, size);
}

int ecrt_soe_request_idn(ec_soe_request_t *req, uint8_t drive_no, uint16_t idn)
{
    (void) drive_no, (void) idn;
    return known(&req->request);
}

int ecrt_soe_request_timeout(ec_soe_request_t *req, uint32_t timeout)
{
    (void) timeout;
    return known(&req->request);
}

uint8_t *ecrt_soe_request_data(const ec_soe_request_t *req)
{
    return data(&req->request);
}

size_t ecrt_soe_request_data_size(const ec_soe_request_t *req)
{
    return size_of(&req->request);
}

ec_request_state_t ecrt_soe_request_state(ec_soe_request_t *req)
{
    return state(&req->request);
}

int ecrt_soe_request_read(ec_soe_request_t *req)
{
    return start(&req->request);
}

int ecrt_soe_request_write(ec_soe_request_t *req)
{
    return start(&req->request);
}

ec_voe_handler_t *ecrt_slave_config_create_voe_handler(ec_slave_config_t *sc, size_t size)
{
    return create(sc, size);
}

int ecrt_voe_handler_send_header(ec_voe_handler_t *voe, uint32_t vendor_id, uint16_t vendor_type)
{
    (void) vendor_id, (void) vendor_type;
    return known(&voe->request);
}

int ecrt_voe_handler_received_header(const ec_voe_handler_t *voe, uint32_t *vendor_id, uint16_t *vendor_type)
{
    int error = known(&voe->request);

    (void) vendor_id, (void) vendor_type;
    return error ? error : -ENOENT;
}

uint8_t *ecrt_voe_handler_data(const ec_voe_handler_t *voe)
{
    return data(&voe->request);
}

size_t ecrt_voe_handler_data_size(const ec_voe_handler_t *voe)
{
    return size_of(&voe->request);
}

int ecrt_voe_handler_write(ec_voe_handler_t *voe, size_t size)
{
    int error = known(&voe->request);

    return error ? error : size > voe->request.size ? -ENOBUFS : start(&voe->request);
}

int ecrt_voe_handler_read(ec_voe_handler_t *voe)
{
    return start(&voe->request);
}

int ecrt_voe_handler_read_nosync(ec_voe_handler_t *voe)
{
    return start(&voe->request);
}

ec_request_state_t ecrt_voe_handler_execute(ec_voe_handler_t *voe)
{
    return state(&voe->request);
}

ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *sc, size_t size)
{
    return create(sc, size);
}

uint8_t *ecrt_reg_request_data(const ec_reg_request_t *req)
{
    return data(&req->request);
}

ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *req)
{
    return state(&req->request);
}

static int start_register(ec_reg_request_t *req, size_t size)
{
    int error = known(&req->request);

    return error ? error : size > req->request.size ? -ENOBUFS : start(&req->request);
}

int ecrt_reg_request_write(ec_reg_request_t *req, uint16_t address, size_t size)
{
    (void) address;
    return start_register(req, size);
}

int ecrt_reg_request_read(ec_reg_request_t *req, uint16_t address, size_t size)
{
    (void) address;
    return start_register(req, size);
}
